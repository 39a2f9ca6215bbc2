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
  expect_identical(told$verdict, "unexplained")  # the sun is left out: the error is far above the noise
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
  expect_identical(told$tag, "Likely cause, but other causes are possible")
  expect_match(told$headline, "^Most likely: Sun enters")
  expect_match(told$change, "Against sun speaks that other causes are possible", all = FALSE)
})

test_that("a change without gain on held-out data is a hint, and no cause", {
  upgrade <- small_upgrade()
  held <- upgrade$models[[2]]$prediction$use == "validate"
  upgrade$models[[2]]$prediction$mean[held] <- upgrade$models[[1]]$prediction$mean[held] + 1
  upgrade$models[[2]]$scores <- amiss:::prediction_scores(upgrade$models[[2]]$prediction)
  told <- summary(rejudged(upgrade))
  expect_identical(told$verdict, "unexplained")
  expect_identical(told$tag, "Unexplained; a stand-in fits")
  expect_match(told$note, "does not improve predictions of data the model has not seen")
  expect_match(told$change, "not more than the uncertainty of that change", all = FALSE)
})

test_that("each step tells what it brought, and what could do the same", {
  told <- summary(small_upgrade())$change
  expect_match(told[1], "^sun \\(named\\), driven by Gv: Sun enters")
  expect_match(told,
               "With sun the typical error falls from .* K in calibration; on held-out data it falls .* more than",
               all = FALSE)
  upgrade <- small_upgrade()
  upgrade$models[[2]]$confounded_with <- "gain"
  expect_match(summary(upgrade)$change, "What sun does, gain could do in part as well .correlated beyond 0.4",
               all = FALSE)
  upgrade$models[[2]]["confounded_with"] <- list(character())
  expect_no_match(paste(summary(upgrade)$change, collapse = " "), "could do in part")
})

test_that("conditions that cannot be told apart are told as such in what remains", {
  upgrade <- base_only(small_upgrade())
  attribution <- upgrade$models[[1]]$attribution
  attribution$table[c("significant", "group")] <- list(TRUE, "Te or Gv")
  attribution$groups <- list(list(conditions = c("Te", "Gv"), log10_bf_dropped = 9, p_value = 0.01,
                                  significant = TRUE, correlation = 0.97))
  upgrade$models[[1]]$attribution <- attribution
  told <- summary(upgrade)
  expect_match(told$headline, "Something that answers to Te or Gv is missing")
  expect_match(told$remains, "Te and Gv cannot be told apart in this record", all = FALSE)
})

test_that("an upgrade prints each mechanism with its verdict, within fifteen lines", {
  upgrade <- small_upgrade()
  lines <- capture.output(print(upgrade))
  expect_lte(length(lines), 15)
  expect_match(lines, "named: .*sun.* \\(Gv\\), log10 Bayes factor [0-9.]+", all = FALSE)
  # As if five had been adopted, and all doubted: each is printed.
  upgrade$models[[2]][c("verdict", "doubts")] <- list("likely", c(
    "other causes are possible", "the numbers behind it are not trusted", "the error in calibration rose with it",
    "what drives it is still answered to", "its value lies at the edge of what was thought possible",
    "a good part of the error remains", "a drifting sensor would explain the error as well"))
  sun <- upgrade$models[[2]]
  for (name in paste("mechanism", letters[1:4])) {
    parent <- upgrade$models[[length(upgrade$models)]]
    step <- utils::modifyList(sun, list(name = paste(parent$name, "+", name), parent = parent$name, mechanism = name))
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
  expect_identical(odds(-17), "10^17 to 1 against")
  expect_identical(odds(0.01), "1 to 1, neither for nor against")
})

test_that("text from data is never markup", {
  skip_without_pandoc()
  hostile <- c("javascript:alert(1)", "see http://a.b/c", "```\n\n# x", "1. a", "- a", "[a](b)", "![a](b)", "$a$ \\(b\\) 'c'",
               "<script>alert(1)</script>", "&lt;b&gt;", "{.a} *b* _c_", "# h", ": d", "a | b", "~~s~~ @k", "`r stop()`")
  file <- withr::local_tempfile(fileext = ".md")
  html <- withr::local_tempfile(fileext = ".html")
  for (text in hostile) {
    writeLines(markdown_text(text), file)
    rmarkdown::pandoc_convert(file, "html", "markdown+autolink_bare_uris+tex_math_single_backslash", html)
    expect_identical(paste(readLines(html), collapse = "\n"),
                     paste0("<p>", gsub("\\s+", " ", htmltools::htmlEscape(text)), "</p>"), info = text)
  }
  sheet <- utils::capture.output(html_sheet(data.frame(unit = "```\n<b>")))
  expect_length(grep("```", sheet), 2)
  expect_match(sheet, "&#96;&#96;&#96; &lt;b&gt;", all = FALSE, fixed = TRUE)
})

test_that("a report is one file that names the cause and needs nothing from outside", {
  skip_without_pandoc()
  folder <- withr::local_tempdir()
  file <- file.path(folder, "diagnosis.html")
  expect_identical(report(small_upgrade(), file), file)
  expect_identical(list.files(folder, all.files = TRUE, no.. = TRUE), "diagnosis.html")
  expect_lt(file.size(file), 3e6)
  html <- paste(readLines(file, warn = FALSE), collapse = "\n")
  expect_match(html, "Sun enters through a window &lt;that&gt; the model *leaves* out.", fixed = TRUE)
  links <- regmatches(html, gregexpr("(src|href)=\"[^\"]{0,20}", html))[[1]]
  expect_true(all(grepl("=\"(data:|#)", links)))
  expect_gte(sum(grepl("data:image/png", links)), 8)
})

test_that("a report is refused with a reason, and nothing half-written stays", {
  folder <- withr::local_tempdir()
  expect_error(report(small_upgrade(), file.path(folder, "absent", "a.html")), "does not exist", class = "amiss_error_input")
  expect_error(report(small_upgrade(), folder), "is a folder", class = "amiss_error_input")
  expect_error(report(small_upgrade(), file.path(folder, "a.pdf")), "HTML only", class = "amiss_error_input")
  expect_error(report(list(), file.path(folder, "a.html")), "amiss_upgrade", class = "amiss_error_input")
  skip_without_pandoc()
  broken <- small_upgrade()
  broken$models[[1]]$prediction <- NULL
  expect_error(suppressMessages(report(broken, file.path(folder, "a.html"))))
  expect_length(list.files(folder, all.files = TRUE, no.. = TRUE), 0)
})
