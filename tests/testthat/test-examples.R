# Sessions of their own, as users have them; they find the package where this one does.
run_example <- function(file, arguments = character(), folder = withr::local_tempdir()) {
  withr::local_envvar(R_LIBS = paste(.libPaths(), collapse = .Platform$path.sep))
  processx::run(file.path(R.home("bin"), "Rscript"), c(file, arguments), wd = folder,
                error_on_status = FALSE)
}

example_file <- function(...) system.file("examples", ..., package = "amiss", mustWork = TRUE)

test_that("every exported function has a help page with an example", {
  pages <- tools::Rd_db("amiss")
  tags <- function(page) vapply(page, attr, "", "Rd_tag")
  aliases <- function(page)
    vapply(page[tags(page) == "\\alias"], function(x) as.character(x[[1]]), "")
  shown <- unlist(lapply(pages, function(page) if ("\\examples" %in% tags(page)) aliases(page)))
  # of generics and ggplot2; their methods are among the pages
  others <- c("tidy", "glance", "augment", "autoplot")
  expect_setequal(setdiff(getNamespaceExports("amiss"), c(shown, others)), character())
})

test_that("the R session finds the sun", {
  skip_on_cran()
  result <- run_example(example_file("session.R"))
  expect_equal(result$status, 0, info = result$stderr)
  expect_match(result$stdout, "named: sun|sun \\(named\\)")
})

test_that("the R Markdown report names the window", {
  skip_on_cran()
  skip_if_not(rmarkdown::pandoc_available("2.0"))
  folder <- withr::local_tempdir()
  made <- new.env()
  file <- rmarkdown::render(example_file("report.Rmd"), "html_document", output_dir = folder,
                            intermediates_dir = folder,
                            params = list(runs = 30), envir = made, quiet = TRUE)
  expect_gt(file.size(file), 1e5)
  expect_equal(made$words$headline, "The window passes another share of the sun than assumed.")
})

test_that("the targets pipeline runs", {
  skip_if_not_installed("targets")
  folder <- withr::local_tempdir()
  file.copy(list.files(example_file("targets"), full.names = TRUE), folder)
  writeLines("targets::tar_make(callr_function = NULL); cat(targets::tar_read(parameters)$term)",
             file.path(folder, "make.R"))
  result <- run_example("make.R", folder = folder)
  expect_equal(result$status, 0, info = result$stderr)
  expect_match(result$stdout, "gain$")
})

test_that("the batch job runs both houses and refuses to guess where to write", {
  skip_on_cran()  # second tier: tools/test --quick
  expect_match(run_example(example_file("batch.R"))$stderr, "usage: Rscript batch.R OUT")
  skip_if_not(identical(Sys.getenv("AMISS_EXTENDED_TESTS"), "true"),
              "the long forms (AMISS_EXTENDED_TESTS)")
  skip_if_not_installed("future")
  folder <- withr::local_tempdir()
  result <- run_example(example_file("batch.R"), c("out", "--quick"), folder)
  expect_equal(result$status, 0, info = result$stderr)
  expect_equal(read.csv(file.path(folder, "out", "found.csv"))$house, c("N2", "O5"))
})
