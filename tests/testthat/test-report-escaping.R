skip_on_cran()  # second tier: tools/test --quick
# Text from data, thrown at every place that it has in a report: nothing of it becomes an element or
# an attribute.

hostile <- c(
  "a\" onload=\"probe(1)\" x=\"", "b' onerror='probe(2)' y='", "<script>probe(3)</script>",
  "<img src=x onerror=probe(4)>", "```\n</div><script>probe(5)</script>\n```{=html}",
  "`<b id=probe6>`{=html}", "[x](javascript:probe(7)){onclick=probe(7)}", "![p](probe8.png)",
  "\" src=\"probe9.png", "\" srcset=\"probe10.png 2x", "<!-- part: words -->", "::: {.a}",
  "---\ntitle: x\n---", "`r probe(13)`", "```{r}\nprobe(14)\n```", "\\input{/etc/probe} $\\x$ %",
  "&lt;b&gt; &#60;i&#62; &amp", "{probe(17)} {.val x}", "</style></title></body>",
  "\u202e\u2028\u0007\u001b[31m\u00e9\u4e2d", "ends in \\", "a|b||c", "{{x}} %s %d", "../../probe",
  "//<![CDATA[ ]]>", "#a .b\n## d", "@import url(probe); .a{b:c}", "javascript:probe()", "1. a",
  "a\n: b", "-- ... ---",
  "(@a) [^1]: x", "  ")

# A run of hostile strings, each another one.
hostile_source <- function(first) {
  at <- first - 1
  function() {
    at <<- at + 1
    hostile[(at - 1) %% length(hostile) + 1]
  }
}

# The small study with hostile words for names, units, labels and sentences.
hostile_pieces <- function(word) {
  columns <- c(word(), word(), word())
  record <- stats::setNames(small_record(), c("time", columns))
  k <- c(word(), word(), word())
  own <- function(name, prior) free(name, prior, word(), word())
  third <- NULL
  f <- function(values, drivers) values[[k[1]]] + values[[k[2]]] * lagged(drivers[, columns[1]], 6)
  with_sun <- function(values, drivers, base)
    base(values) + values[[k[3]]] * lagged(drivers[, columns[2]], 3)
  list(
    measurements = measurements(record, time = "time", target = columns[3], boundary = columns[1:2],
                                noise_sd = 0.05, unit = word(), name = word(),
                                calibrate = seq_len(240) <= 168, validate = seq_len(240) > 168,
                                warmup = 12),
    model = function_simulator(f, own(k[1], uniform(10, 20)), own(k[2], uniform(0, 2)),
                               boundary = columns[1], name = word()),
    sun = mechanism(word(), boundary = columns[2], sentence = word(), edit = function(model) {
      third <<- third %||% own(k[3], uniform(0, 0.02))  # an edit is made more than once
      with_parameters(model, third, boundary = columns[2], f = with_sun)
    }))
}

coarse_ais <- list(pilot_chains = 24, groups = 4, importance_draws = 200)

hostile_upgrade <- function(word) {
  made <- hostile_pieces(word)
  control <- list(max_steps = 1, calibration = list(ais = c(coarse_ais, chains = 8)),
                  attribution = list(surrogates = 39, ais = coarse_ais))
  upgrade <- upgrade_model(made$model, made$measurements, catalogue(made$sun), runs = 30, seed = 1,
                           quiet = TRUE, control = control)
  upgrade$title <- word()
  upgrade
}

hostile_comparison <- function(word) {
  made <- hostile_pieces(word)
  models <- stats::setNames(list(made$model, extend(made$model, made$sun)), c(word(), word()))
  comparison <- compare_models(models, made$measurements, "history", runs = 20, seed = 1,
                               quiet = TRUE,
                               control = list(calibration = list(ais = c(coarse_ais, chains = 8))))
  comparison$title <- word()
  comparison
}

# Drawing takes most of a report's time; the text of figures goes into the page as well.
quick_figures <- function(frame = parent.frame()) {
  stand_in(save_figure = function(figure, path, ...) {
    ggplot2::ggplot_build(figure)
    ragg::agg_png(path, 4, 4)
    grid::grid.newpage()
    grDevices::dev.off()
  }, frame = frame)
}

# What the package's own page is made of.
own_elements <- strsplit(
  paste("html head body meta title style script div span p h1 h2 h3 h4 b strong em sup ol ul li",
        "dl dt dd table thead tbody tr th td picture source img br"), " ")[[1]]
own_attributes <-
  strsplit("lang charset name content http-equiv class id custom-style style media type", " ")[[1]]

# What in a page is not the package's own.
foreign_in <- function(page) {
  elements <- setdiff(xml2::xml_name(xml2::xml_find_all(page, "//*")), own_elements)
  attributes <- xml2::xml_find_all(page, "//@*")
  name <- xml2::xml_name(attributes)
  text <- xml2::xml_text(attributes)
  fine <- name %in% own_attributes & !grepl("probe(", text, fixed = TRUE) | name == "alt" |
    name %in% c("src", "srcset") & grepl("^data:image/png;base64,[A-Za-z0-9+/=]+$", text)
  code <- xml2::xml_text(xml2::xml_find_all(page, "//script | //style"))
  c(elements, paste(name, text)[!fine], grep("probe", code, value = TRUE))
}

test_that(
  "no element, attribute or script of a report comes from data, and all of its text is there", {
  skip_if_not_installed("rmarkdown")
  skip_if_not(rmarkdown::pandoc_available("2.0"), "pandoc is not installed")
  skip_if_not_installed("xml2")
  quick_figures()
  file <- withr::local_tempfile(fileext = ".html")
  made <- list(hostile_upgrade(hostile_source(1)), hostile_upgrade(hostile_source(17)),
               hostile_comparison(hostile_source(8)))
  for (result in made) {
    report(result, file)
    page <- xml2::read_html(file)
    expect_identical(foreign_in(page), character())
    title <- xml2::xml_text(xml2::xml_find_first(page, "//*[contains(@class, 'study')]/p"))
    expect_identical(title, trimws(one_line(result$title)))
    expect_no_error(capture.output(print(result), print(summary(result))))
  }
})

test_that(
  "parameters of one label, and a label that is another's name, come through figures and report", {
  skip_if_not_installed("rmarkdown")
  skip_if_not(rmarkdown::pandoc_available("2.0"), "pandoc is not installed")
  words <- c("Te", "Gv", "Ti", "p", "q", "r", "K", "room", "K", "gain", "K", "gain", "model", "sun",
             "Sun.", "K", "p", "title")
  at <- 0
  upgrade <- hostile_upgrade(function() {
    at <<- at + 1
    words[at]
  })
  expect_setequal(tidy(upgrade)$label, c("gain (p)", "gain (q)", "p (r)"))
  quick_figures()
  file <- withr::local_tempfile(fileext = ".html")
  report(upgrade, file)
  expect_match(paste(readLines(file), collapse = " "), "<td>p (r)</td>", fixed = TRUE)
})

# Strings of signs, letters and spaces.
random_strings <- function(n) {
  withr::with_seed(1, vapply(seq_len(n), function(i) {
    signs <- sample(c(33:47, 58:64, 91:96, 123:126), 12, replace = TRUE)
    intToUtf8(sample(c(signs, utf8ToInt("ab 12\u00e9"))))
  }, ""))
}

test_that("any text comes out of markdown, an element and an attribute as it went in", {
  skip_if_not_installed("rmarkdown")
  skip_if_not(rmarkdown::pandoc_available("2.0"), "pandoc is not installed")
  skip_if_not_installed("xml2")
  text <- c(trimws(one_line(hostile[hostile != "  "])), trimws(random_strings(300)))
  file <- withr::local_tempfile(fileext = ".md")
  html <- withr::local_tempfile(fileext = ".html")
  tags <- c(paste0("<b>", html_text(text), "</b>"),
            paste0("<i title=\"", html_attribute(text), "\"></i>"))
  writeLines(enc2utf8(c(paste0("x", markdown_text(text), "\n"), "```{=html}", tags, "```")), file,
             useBytes = TRUE)
  rmarkdown::pandoc_convert(file, "html", "markdown+autolink_bare_uris+tex_math_single_backslash",
                            html)
  page <- xml2::read_html(html, encoding = "UTF-8")
  flat <- function(x) gsub("[\\s\u00a0]+", " ", x, perl = TRUE)
  expect_identical(flat(xml2::xml_text(xml2::xml_find_all(page, "//p"))), flat(paste0("x", text)))
  expect_identical(flat(xml2::xml_text(xml2::xml_find_all(page, "//b"))), flat(text))
  expect_identical(flat(xml2::xml_attr(xml2::xml_find_all(page, "//i"), "title")), flat(text))
})

test_that("names of figures become names of files, each its own and none outside the folder", {
  records <- c("../../x", "a/b", "a_b", "a\\b", "..", "\u00e9\nx", strrep("long ", 99))
  names <- c("fit of north", paste("fit of", records))
  files <- figure_files(names)
  expect_identical(files[1], "fit_of_north.png")
  expect_false(anyDuplicated(files) > 0)
  expect_true(all(stays_inside(files) & nchar(files) < 100 & !grepl("[/\\]", files)))
})

test_that("a message never evaluates what stands in a name", {
  k <- "k {stop('evaluated')}"
  model <- function_simulator(function(values, drivers) values[[k]] * drivers[, "Te"],
                              free(k, uniform(0, 1), "{1 + 1}", "{2}"), boundary = "Te",
                              name = "{3}")
  program <- program_simulator(
    c("cat", paste0("{{", "a", "}}")), free("a", uniform(0, 1), "{1 + 1}"),
    output = c(file = "a.csv", column = "b"), cache = tempfile("{4}"), name = "{5}")
  expect_match(printed(model), "evaluated.*\\{1 \\+ 1\\}")
  expect_match(printed(program), "\\{5\\}.*\\{1 \\+ 1\\}")
})
