# Its table says how many runs there were.
reported_figures <- setdiff(figure_names, "runs")

skip_on_cran()  # second tier: tools/test --quick
skip_without_pandoc <- function() {
  skip_if_not_installed("rmarkdown")
  skip_if_not(rmarkdown::pandoc_available("2.0"), "pandoc is not installed")
  skip_if(system.file("rmarkdown", package = "amiss") == "", "the template is not installed")
}

test_that("a summary tells the cause, how sure it is and what it brings", {
  told <- summary(small_upgrade())
  expect_identical(told$verdict, "named")
  expect_match(told$headline, "Sun enters")
  expect_match(told$sure[1], "decisive")
  expect_match(told$gain[1], "falls from")
  expect_identical(told$changes$name, "sun_gain")
  expect_identical(told$candidates$decision[1], "adopted")
  expect_true(any(grepl("Cause named", capture.output(print(told)))))
})

test_that("a summary says when nothing is named, and why", {
  upgrade <- base_only(small_upgrade())
  upgrade$models[[1]]$attribution$table$significant <- c(TRUE, FALSE)
  lead <- upgrade$models[[1]]$attribution$table$boundary[1]
  told <- summary(upgrade)
  expect_identical(told$verdict, "unexplained")
  expect_match(told$headline, lead)
  upgrade$models[[1]]$attribution$table$significant <- FALSE
  told <- summary(upgrade)
  # the sun is left out: the error is far above the noise
  expect_identical(told$verdict, "unexplained")
  expect_match(told$headline, "times the stated noise")
  upgrade$measurements$noise_sd <- 10  # as if so much noise had been stated
  told <- summary(without_held_out(upgrade))
  expect_identical(told$verdict, "nothing")
  expect_match(told$gain, "No data were held out", all = FALSE)
  upgrade["candidates"] <- list(NULL)
  expect_match(summary(upgrade)$sure, "No mechanism was tried")
})

test_that("a cause with rivals is only likely", {
  doubtful <- small_upgrade()
  doubtful$candidates$probability <- c(0.6, 0.3)
  told <- summary(rejudged(doubtful))
  expect_identical(told$verdict, "likely")
  expect_identical(told$tag, "The cause is sun or drift; this record does not distinguish them")
  expect_match(told$headline, "^Most likely: Sun enters")
  expect_match(told$change, "this record does not distinguish it from drift (30 %)", fixed = TRUE,
               all = FALSE)
})

test_that("a change without gain on held-out data is a hint, and no cause", {
  upgrade <- small_upgrade()
  held <- upgrade$models[[2]]$prediction$use == "validate"
  upgrade$models[[2]]$prediction$mean[held] <- upgrade$models[[1]]$prediction$mean[held] + 1
  upgrade$models[[2]]$scores <- amiss:::prediction_scores(upgrade$models[[2]]$prediction)
  told <- summary(rejudged(upgrade))
  expect_identical(told$verdict, "unexplained")
  expect_identical(told$tag, "Unexplained; a stand-in fits")
  expect_match(told$note, "does not clearly improve predictions of data the model has not seen")
  expect_match(told$change, "on held-out data it rises from .*, no gain", all = FALSE)
})

test_that("each step tells what it brought, and what could do the same", {
  told <- summary(small_upgrade())$change
  expect_match(told[1], "^sun \\(named\\), driven by Gv: Sun enters")
  expect_match(told, paste("With sun the typical error falls from .* in calibration; on held-out",
                           "data it falls .*, a gain of"), all = FALSE)
  upgrade <- small_upgrade()
  upgrade$models[[2]]$confounded_with <- "gain"
  expect_match(summary(upgrade)$change,
               "The estimate of sun is correlated with gain .by more than 0.4", all = FALSE)
  upgrade$models[[2]]["confounded_with"] <- list(character())
  expect_no_match(paste(summary(upgrade)$change, collapse = " "), "could also be done")
})

test_that("conditions that cannot be distinguished are reported as such in what remains", {
  upgrade <- base_only(small_upgrade())
  attribution <- upgrade$models[[1]]$attribution
  attribution$table[c("significant", "group")] <- list(TRUE, "Te or Gv")
  attribution$groups <- list(list(conditions = c("Te", "Gv"), log10_bf_dropped = 9, p_value = 0.01,
                                  significant = TRUE, correlation = 0.97))
  upgrade$models[[1]]$attribution <- attribution
  told <- summary(upgrade)
  expect_match(told$headline, "Something that responds to Te or Gv is missing")
  # Where the error is not larger than the noise, no more is said than that.
  seen <- upgrade$models[[1]]$prediction
  upgrade$models[[1]]$prediction$mean <- seen$observed + 0.05 * rep_len(c(1, -1), nrow(seen))
  expect_match(summary(upgrade)$headline,
               "of the size of the stated noise .1.0 times.*responds to Te or Gv: something small")
  expect_match(told$remains, "In this record Te and Gv cannot be distinguished", all = FALSE)
})

test_that("an upgrade prints each mechanism with its verdict, within fifteen lines", {
  upgrade <- small_upgrade()
  lines <- capture.output(print(upgrade))
  expect_lte(length(lines), 15)
  expect_match(lines, "named: .*sun.* \\(Gv\\), log10 Bayes factor [0-9.]+", all = FALSE)
  # As if five had been adopted, and all doubted: each is printed.
  upgrade$models[[2]][c("verdict", "doubts")] <- list("likely", c(
    "does not distinguish it from", "the numbers behind it are not trusted",
    "the error in calibration rose with it", "the error still responds to what drives it",
    "its value lies at the edge of what was thought possible", "a good part of the error remains",
    "a drifting sensor would explain the error as well"))
  sun <- upgrade$models[[2]]
  for (name in paste("mechanism", letters[1:4])) {
    parent <- upgrade$models[[length(upgrade$models)]]
    step <- utils::modifyList(sun, list(name = paste(parent$name, "+", name), parent = parent$name,
                                        mechanism = name))
    row <- upgrade$candidates[1, ]
    row[c("from", "mechanism")] <- list(parent$name, name)
    upgrade$candidates <- rbind(upgrade$candidates, row)
    upgrade$catalogue[[name]] <- upgrade$catalogue$sun
    upgrade$models <- c(upgrade$models, list(step))
  }
  lines <- capture.output(print(upgrade))
  expect_lte(length(lines), 15)
  expect_match(lines[1], "5 mechanisms adopted")
  expect_match(lines, "likely: .*mechanism a", all = FALSE)
  expect_length(grep("log10 Bayes factor [0-9]", lines), 5)
})

test_that("odds are written out while they can be read", {
  expect_identical(odds(2), "100 to 1 in favour")
  expect_identical(odds(3.924), "8,400 to 1 in favour")
  expect_identical(odds(168.2), "10^168 to 1 in favour")
  # Ends that read the same are left out only where they lie on one side.
  expect_identical(odds_interval(c(2, 2.001)), "")
  expect_match(odds_interval(c(-0.3, 0.3)), "2 to 1 against, to 2 to 1 in favour")
  expect_identical(odds(-17), "10^17 to 1 against")
  expect_identical(odds(0.01), "1 to 1, neither for nor against")
})

test_that("text from data is never markup", {
  skip_without_pandoc()
  hostile <- c("javascript:alert(1)", "see http://a.b/c", "```\n\n# x", "1. a", "- a", "[a](b)",
               "![a](b)", "$a$ \\(b\\) 'c'", "<script>alert(1)</script>", "&lt;b&gt;",
               "{.a} *b* _c_", "# h", ": d", "a | b", "~~s~~ @k", "`r stop()`")
  file <- withr::local_tempfile(fileext = ".md")
  html <- withr::local_tempfile(fileext = ".html")
  for (text in hostile) {
    writeLines(markdown_text(text), file)
    rmarkdown::pandoc_convert(file, "html", "markdown+autolink_bare_uris+tex_math_single_backslash",
                              html)
    expect_identical(paste(readLines(html), collapse = "\n"),
                     paste0("<p>", gsub("\\s+", " ", htmltools::htmlEscape(text)), "</p>"),
                     info = text)
  }
  sheet <- utils::capture.output(html_sheet(data.frame(unit = "```\n<b>")))
  expect_length(grep("```", sheet), 2)
  expect_match(sheet, "&#96;&#96;&#96; &lt;b&gt;", all = FALSE, fixed = TRUE)
})

# The report of the small upgrade, made once.
report_cache <- new.env()

small_report <- function() {
  if (is.null(report_cache$file)) {
    report_cache$file <- tempfile(fileext = ".html")
    report(small_upgrade(), report_cache$file)
  }
  report_cache$file
}

# Tables of a page or, as XML, of a Word document, as lists of rows of cells.
tables_of <- function(page, table = "//table", row = ".//tr", cell = "th|td") {
  lapply(xml2::xml_find_all(page, table), function(t) {
    lapply(xml2::xml_find_all(t, row),
           function(r) trimws(xml2::xml_text(xml2::xml_find_all(r, cell))))
  })
}

# The rows of the table whose first row begins with these names.
table_with <- function(tables, names) {
  own <- Filter(function(t) identical(t[[1]][seq_along(names)], names), tables)
  do.call(rbind, own[[length(own)]][-1])
}

word_body <- function(file) {
  folder <- withr::local_tempdir()
  utils::unzip(file, exdir = folder)
  xml2::read_xml(file.path(folder, "word", "document.xml"))
}

word_tables <- function(body) tables_of(body, "//w:tbl", ".//w:tr", "./w:tc")

test_that("a report folds away all but three of the sentences on what to inspect next", {
  skip_without_pandoc()
  skip_if_not_installed("xml2")
  told <- sprintf("Sentence %d.", 1:5)
  rmd <- c("::: {.card}", "```{r, echo = FALSE, results = 'asis'}",
           "amiss:::markdown_inspections(told)", "```", ":::")
  page <- function(told, format) {
    source <- withr::local_tempfile(fileext = ".Rmd")
    writeLines(c("---", "title: x", "---", "", rmd), source)
    rmarkdown::render(source, format, envir = list2env(list(told = told), parent = globalenv()),
                      quiet = TRUE)
  }
  html <- xml2::read_html(page(told, "html_document"))
  items <- function(path) trimws(xml2::xml_text(xml2::xml_find_all(html, path)))
  expect_identical(items("//details//li"), told[4:5])
  expect_identical(items("//details/summary"), "2 more to inspect")
  expect_identical(items("//li[not(ancestor::details)]"), told[1:3])
  expect_length(xml2::xml_find_all(html, "//details[@open]"), 0)
  html <- xml2::read_html(page(told[1:3], "html_document"))
  expect_length(items("//details"), 0)
  # So does the summary of a report.
  rmd <- c("```{r, echo = FALSE}", "report_fragment(told, \"summary\")", "```")
  upgrade <- without_held_out(small_upgrade())
  upgrade$models[[2]]$confounded_with <- "gain"
  html <- xml2::read_html(page(upgrade, "html_document"))
  expect_identical(gsub("\\s+", " ", items("//details//li")),
                   unname(upgrade_inspections(upgrade)["steps"]))
  # Word folds nothing: there all follow under a head.
  rmd <- c("```{r, echo = FALSE, results = 'asis'}", "amiss:::markdown_inspections(told)", "```")
  text <- xml2::xml_text(word_body(page(told, "word_document")))
  expect_match(text, "Sentence 3.*2 more to inspect.*Sentence 4.*Sentence 5")
})

test_that("a report is one file that names the cause and needs nothing from outside", {
  skip_on_cran()
  skip_without_pandoc()
  folder <- withr::local_tempdir()
  file <- file.path(folder, "diagnosis.html")
  file.copy(small_report(), file)
  expect_identical(list.files(dirname(small_report()), "^[.]amiss-report", all.files = TRUE),
                   character())
  expect_lt(file.size(file), 3e6)
  html <- paste(readLines(file, warn = FALSE), collapse = "\n")
  expect_on_page(html, "Sun enters through a window &lt;that&gt; the model *leaves* out.")
  links <- regmatches(html, gregexpr("(src|srcset|href)=\"[^\"]{0,20}", html))[[1]]
  expect_true(all(grepl("=\"(data:|#)", links)))
  expect_gte(sum(grepl("src=\"data:image/png", links)), length(reported_figures))
})

test_that("a candidate is shown by how it was judged, and one without a number not at all", {
  upgrade <- small_upgrade()
  at <- function(mechanism) which(upgrade$candidates$mechanism == mechanism)
  estimate <- function(...) {
    upgrade$candidates[at("drift"), c("judged_by", "trusted")] <- list(...)
    told <- amiss:::candidates_words(upgrade)
    told$estimate[told$mechanism == "drift"]
  }
  expect_equal(estimate("runs", TRUE), "verified")
  expect_equal(estimate("trial", TRUE), "trial")
  expect_equal(estimate("trial", FALSE), "rough")
  upgrade$candidates[at("drift"), c("judged_by", "trusted")] <- list("trial", FALSE)
  shown <- plot(upgrade, "candidates")
  drift <- shown$data$mechanism == "drift"
  expect_equal(as.character(shown$data$state[drift]), "estimate rough")
  expect_equal(nrow(ggplot2::layer_data(shown, 3)), 2)  # a line each
  upgrade$candidates[at("drift"), c("log10_bf", "lower95", "upper95", "error_ratio")] <- NA_real_
  for (why in c("silent", "none")) {
    upgrade$candidates$judged_by[at("drift")] <- why
    expect_equal(amiss:::candidates_words(upgrade)$mechanism, "sun")
    expect_equal(plot(upgrade, "candidates")$data$mechanism, "sun")
    expect_no_error(summary(upgrade))
    expect_no_error(summary(base_only(upgrade)))
  }
  none <- base_only(upgrade)
  none$candidates[c("log10_bf", "lower95", "upper95", "error_ratio")] <- NA_real_
  none$candidates$judged_by <- "none"
  expect_match(summary(none)$sure, "No mechanism could be computed", all = FALSE)
  expect_match(plot(none, "candidates")$labels$title, "No mechanism was tried")
})

test_that("a report says what result.json says", {
  skip_without_pandoc()
  skip_if_not_installed("xml2")
  file <- withr::local_tempfile(fileext = ".json")
  jsonlite::write_json(result_list(small_upgrade()), file, auto_unbox = TRUE, digits = NA,
                       null = "null", na = "null")
  told <- jsonlite::read_json(file)
  page <- xml2::read_html(small_report())
  text <- function(class)
    trimws(xml2::xml_text(xml2::xml_find_all(page,
                                             sprintf("//*[contains(@class, '%s')]", class))))
  expect_identical(text("headline"), told$diagnosis$headline)
  expect_identical(text("tag"), told$diagnosis$tag)
  expect_true(grepl(told$diagnosis$verdict, text("verdict")[1]) ||
              length(text(told$diagnosis$verdict)) > 0)
  tables <- tables_of(page)

  adopted <- Filter(function(m) !is.null(m$mechanism), told$models)
  heads <- gsub("\\s+", " ",
                xml2::xml_text(xml2::xml_find_all(page, "//*[contains(@class, 'mechanism')]//h3")))
  expect_identical(heads, vapply(adopted, function(m) paste(m$mechanism, m$verdict), ""))
  for (doubt in unlist(lapply(adopted, `[[`, "doubts")))
    expect_match(text("mechanism"), doubt, fixed = TRUE)

  trials <- table_with(tables, c("step", "mechanism"))
  for (trial in told$candidates) {
    row <- trials[trials[, 2] == trial$mechanism, ]
    ends <- unlist(trial$interval)
    factor <- amiss:::same_decimals(trial$log10_bf, ends[[1]], ends[[2]], "+")
    expect_identical(row[c(4, 5, 7, 8, 9, 10, 11)],
                     c(factor$estimate, paste(factor$lower, "to", factor$upper),
                       signed(trial$beside_unknown), signed(trial$standing),
                       if (startsWith(row[12], "refused")) "" else percent(trial$probability),
                       if (is.null(trial$error_ratio)) ""
                       else paste(short(trial$error_ratio), "times"),
                       if (trial$judged_by == "runs") "verified"
                       else if (trial$trusted) "trial" else "rough"))
    expect_identical(row[12] == "adopted",
                     trial$mechanism %in% vapply(adopted, `[[`, "", "mechanism"))
  }

  first <- told$models[[1]]
  last <- told$models[[length(told$models)]]
  tiles <- xml2::xml_text(xml2::xml_find_all(page, "//*[@class = 'big']//b"))
  expect_identical(
    tiles[1:2],
    c(paste(short(first$rmse_validation), "\u2192", short(last$rmse_validation), "K"),
      paste(short(first$rmse_calibration), "\u2192", short(last$rmse_calibration), "K")))
  parameters <- table_with(tables, c("parameter", "unit", "median", "95 % interval",
                                     "physical value", "range thought possible"))
  expect_setequal(parameters[, 3], vapply(last$parameters, function(p) short(p$median, 3), ""))
  drivers <- table_with(tables, "boundary condition")
  for (condition in last$attribution) {
    row <- drivers[drivers[, 1] == condition$boundary, ]
    expect_identical(row[c(2, 5)], c(sprintf("%+.1f", condition$log10_bf_dropped),
                                     if (condition$significant) "yes" else "no"))
  }
  method <- table_with(tables, "quantity")
  expect_identical(as.numeric(method[1:3, 3]), as.numeric(unlist(last[c("N", "Q", "M")])))
  if (!any(vapply(last$attribution, `[[`, NA, "significant")))
    expect_match(text("wide"), "responds to no boundary", all = FALSE)
})

test_that("a report of one calibration has its tables in Word, too", {
  skip_without_pandoc()
  skip_if_not_installed("xml2")
  file <- withr::local_tempfile(fileext = ".docx")
  fit <- plain_linear_fit()
  expect_identical(report(fit, file), file)
  body <- word_body(file)
  text <- xml2::xml_text(body)
  expect_match(text, "What to inspect next")
  expect_match(text, "attribute_discrepancy()", fixed = TRUE)
  rows <- table_with(word_tables(body), c("parameter", "unit", "median"))
  expect_identical(rows[, 1], c("offset", "gain"))
  expect_identical(rows[, 3], short(tidy(fit)$estimate, 3))
  expect_length(xml2::xml_find_all(body, "//pic:pic"), 11)
})

test_that("a new file from the template works at once", {
  skip_on_cran()
  skip_without_pandoc()
  skip_if_not_installed("xml2")
  folder <- withr::local_tempdir()
  draft <- rmarkdown::draft(file.path(folder, "mine.Rmd"), "report", "amiss", edit = FALSE)
  made <- rmarkdown::render(draft, "word_document", envir = new.env(), quiet = TRUE)
  body <- word_body(made)
  expect_match(xml2::xml_text(body), "This shows a made-up example")
  expect_match(xml2::xml_text(body), "sun: named")
  expect_identical(table_with(word_tables(body), c("step", "mechanism"))[, 2], "sun")
})

test_that("fragments go into a document of one's own, of any level, twice", {
  skip_without_pandoc()
  made <- small_upgrade()
  text <- c("# Mine", "```{r}", "report_fragment(made, \"mechanisms\", level = 3)", "```", "```{r}",
            "1 + 1", "```", "```{r}", "report_fragment(made, \"words\", level = 1)", "```")
  figures <- withr::local_tempdir()
  withr::local_dir(figures)
  said <- knitr::knit(text = text, quiet = TRUE,
                      envir = list2env(list(made = made), parent = globalenv()))
  expect_match(said, "\n### What would change in the model")
  expect_match(said, "\n#### sun: named")
  expect_match(said, "\n# Words")
  expect_match(said, "```r\n1 + 1\n```", fixed = TRUE)  # the options of the document are its own
  expect_no_match(said, "What drives the error")
  expect_length(list.files(figures, "png$", recursive = TRUE), 1)
  expect_error(report_fragment(made), "belongs in a chunk", class = "amiss_error_input")
  withr::local_options(knitr.in.progress = TRUE)
  expect_error(report_fragment(made, "nonsense"), "parts", class = "amiss_error_input")
  expect_error(report_fragment(made, level = 7), "level", class = "amiss_error_input")
  expect_error(report_fragment(1), "upgrade_model", class = "amiss_error_input")
})

test_that("a report is refused with a reason, and nothing half-written stays", {
  folder <- withr::local_tempdir()
  expect_error(report(small_upgrade(), file.path(folder, "absent", "a.html")), "does not exist",
               class = "amiss_error_input")
  expect_error(report(small_upgrade(), folder), "is a folder", class = "amiss_error_input")
  expect_error(report(small_upgrade(), file.path(folder, "a.tex")), "html.*pdf.*docx",
               class = "amiss_error_input")
  expect_error(report(list(), file.path(folder, "a.html")), "upgrade_model",
               class = "amiss_error_input")
  skip_without_pandoc()
  withr::local_envvar(CHROMOTE_CHROME = "/nowhere/chrome")
  expect_error(report(small_upgrade(), file.path(folder, "a.pdf")), "apt-get install chromium",
               class = "amiss_error_input")
  broken <- small_upgrade()
  broken$models[[1]]$prediction <- NULL
  expect_error(suppressMessages(report(broken, file.path(folder, "a.html"))))
  expect_length(list.files(folder, all.files = TRUE, no.. = TRUE), 0)
})

browser_or_skip <- function()
  tryCatch(find_browser(),
           amiss_error_input = function(e) skip("no browser of the Chromium family"))

# What a browser makes of a page in a frame of a given width, and what its console says.
seen_in_browser <- function(browser, file, width) {
  page <- withr::local_tempfile(fileext = ".html")
  html <- htmltools::htmlEscape(
    paste(readLines(file, warn = FALSE, encoding = "UTF-8"), collapse = "\n"), attribute = TRUE)
  script <- "frame.onload = function() {
    const page = frame.contentDocument, images = [...page.images];
    probe.textContent = JSON.stringify({width: page.documentElement.scrollWidth,
      letters: Math.min(...[...page.querySelectorAll('p, li')].map(
        e => parseFloat(getComputedStyle(e).fontSize))),
      natural: images.map(i => i.naturalWidth), shown: images.map(i => i.clientWidth)});
  }"
  writeLines(sprintf("<pre id='probe'></pre><script>%s</script>",
                     paste0("</script><iframe id='frame' style='border:0; height:900px; width:",
                            width, "px' srcdoc=\"", html, "\"></iframe><script>", script)),
             page, useBytes = TRUE)
  ran <- browse(browser, page, c("--enable-logging=stderr", "--dump-dom"))
  seen <- jsonlite::fromJSON(sub(".*<pre id=\"probe\">(\\{[^<]*\\}).*", "\\1",
                                 substr(ran$stdout, 1, 10000)))
  c(seen, console = list(grep("CONSOLE", strsplit(ran$stderr, "\n")[[1]], value = TRUE)))
}

test_that("a browser shows the report on a desk and on a phone, and prints it", {
  skip_on_cran()
  skip_without_pandoc()
  browser <- browser_or_skip()
  for (width in c(400, 1400)) {
    seen <- seen_in_browser(browser, small_report(), width)
    expect_identical(seen$console, character())
    expect_length(seen$natural, length(reported_figures))
    expect_true(all(seen$natural > 0))
    expect_lte(seen$width, width)
    expect_gte(seen$letters, 12)
    # Letters of a figure have 9 points on the narrow canvas and 15 on the wide one.
    inches <- if (width == 400) narrow_canvas else canvas_width
    expect_true(all((if (width == 400) 9 else 15) / 72 * seen$shown / inches > 10))
    expect_identical(all(seen$natural < 800), width == 400)
  }
  pdf <- withr::local_tempfile(fileext = ".pdf")
  print_page(small_report(), pdf, browser)
  expect_identical(readChar(pdf, 5, useBytes = TRUE), "%PDF-")
  expect_gt(file.size(pdf), 2e5)
  expect_error(print_page(small_report(), file.path(tempdir(), "absent", "a.pdf"),
                          Sys.which("false")),
               "did not print", class = "amiss_error_input")
})
