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
  expect_true(any(grepl("Cause named", cli::cli_fmt(print(told)))))
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

test_that("a cause with rivals, or without gain on held-out data, is only likely", {
  upgrade <- small_upgrade()
  doubtful <- upgrade
  doubtful$candidates$probability <- c(0.6, 0.3)
  expect_match(summary(doubtful)$tag, "other causes are possible")
  doubtful <- upgrade
  doubtful$models[[2]]$scores$validate[["rmse"]] <- 2 * doubtful$models[[1]]$scores$validate[["rmse"]]
  told <- summary(doubtful)
  expect_identical(told$verdict, "likely")
  expect_match(told$note, "does not improve")
})

test_that("odds are written out while they can be read", {
  expect_identical(odds(2), "100 to 1 in favour")
  expect_identical(odds(3.924), "8,400 to 1 in favour")
  expect_identical(odds(168.2), "10^168 to 1 in favour")
  expect_identical(odds(-17), "10^17 to 1 against")
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
  expect_error(report(list(), file.path(folder, "a.html")), "amiss_upgrade", class = "amiss_error_input")
  skip_without_pandoc()
  broken <- small_upgrade()
  broken$models[[1]]$prediction <- NULL
  expect_error(suppressMessages(report(broken, file.path(folder, "a.html"))))
  expect_length(list.files(folder, all.files = TRUE, no.. = TRUE), 0)
})
