skip_on_cran()  # second tier: tools/test --quick
# A study run once into a folder in which files of others stand.
used_folder <- local({
  used <- NULL
  function() {
    if (is.null(used)) {
      folder <- withr::local_tempdir(.local_envir = teardown_env())
      out <- file.path(folder, "out")
      theirs <- file.path(out,
                          c("probe", "stages/notes.txt", "stages/mine.rds", "figures/mine.png"))
      for (file in theirs) {
        dir.create(dirname(file), recursive = TRUE, showWarnings = FALSE)
        writeLines("theirs", file)
      }
      run_study(write_comparison_study(folder), out, quiet = TRUE, trust = TRUE)
      used <<- list(out = out, theirs = theirs)
    }
    used
  }
})

test_that("what lies in the folder is never removed", {
  skip_on_cran()
  own <- used_folder()
  for (file in own$theirs[1:3]) expect_equal(readLines(file), "theirs")
  expect_setequal(list.files(file.path(own$out, "stages")), c("notes.txt", "mine.rds"))
})

test_that("old and new results do not mix", {
  out <- used_folder()$out
  earlier <- dir(out, "^earlier-", full.names = TRUE)
  expect_equal(readLines(file.path(earlier, "figures", "mine.png")), "theirs")
  expect_false(file.exists(file.path(out, "figures", "mine.png")))
})

# Results of three pieces, written into a folder; why some are missing.
write_pieces <- function(out, ...) {
  pieces <- list(result.rds = function(path) saveRDS(1:3, path),
                 result.json = function(path) writeLines("3", path),
                 "figures/fit.png" = function(path) writeLines("fit", path),
                 "figures/gain.png" = function(path) writeLines("gain", path),
                 report.html = function(path) writeLines("all of it", path))
  write_study(NULL, out, quiet = TRUE, pieces = utils::modifyList(pieces, list(...)))
}

fails <- function(path) {
  writeLines("half", path)
  stop("no {pandoc} here")
}

test_that("what cannot be made is missed, and told; the result is there", {
  out <- withr::local_tempdir()
  expect_null(write_pieces(out))
  told <- expect_warning(missing <- write_pieces(out, report.html = fails,
                                                 "figures/gain.png" = fails),
                         class = "amiss_warning_missing")
  expect_match(conditionMessage(told),
               "2 files .*gain.png.*report.html.*no \\{pandoc\\} here.*result.rds")
  expect_named(missing, c("figures/gain.png", "report.html"))
  expect_equal(readRDS(file.path(out, "result.rds")), 1:3)
  there <- dir(out, recursive = TRUE)
  expect_setequal(grep("^earlier", there, value = TRUE, invert = TRUE),
                  c("result.rds", "result.json", "figures/fit.png"))
  # What was there before has been moved as a whole: the old report does not stand beside the new
  # result.
  expect_length(grep("^earlier", there), 5)
})

test_that("without room for the result nothing is written", {
  out <- withr::local_tempdir()
  expect_error(write_pieces(out, result.rds = fails), "could not be written.*pandoc",
               class = "amiss_error_input")
  expect_error(write_pieces(out, result.rds = function(path) writeLines("cut", path)),
               "could not be written", class = "amiss_error_input")
  expect_length(dir(out, all.files = TRUE, no.. = TRUE), 0)
})

test_that("a copy that is cut short, as on a full disk, is missed and removed", {
  work <- withr::local_tempdir()
  beside <- withr::local_tempdir()
  short <- function(from, to) {
    cat("all", file = to)
    TRUE
  }
  make <- function(path) writeLines("all of it", path)
  expect_match(make_piece(make, "a/report.html", work, beside, copy = short), "as a whole")
  expect_length(dir(beside, recursive = TRUE), 0)
  expect_null(make_piece(make, "a/report.html", work, beside))
  expect_equal(readLines(file.path(beside, "a", "report.html")), "all of it")
})

test_that(
  "a study whose report fails keeps its result and its stages, and the same call makes the rest", {
  folder <- withr::local_tempdir()
  out <- file.path(folder, "out")
  study <- write_comparison_study(folder)
  stand_in(report = function(...) stop("pandoc stopped"),
           save_figure = function(figure, path, ...) writeLines("a figure", path))
  words <- c("run", study, "--out", out, "--trust", "--quiet")
  expect_warning(expect_equal(run_command(words), 1), "report.html.*pandoc stopped",
                 class = "amiss_warning_missing")
  kept <- jsonlite::read_json(file.path(out, "result.json"))
  expect_s3_class(readRDS(file.path(out, "result.rds")), "amiss_comparison")
  expect_length(dir(file.path(out, "stages")), 1)
  stand_in(report = function(x, file, ...) writeLines("the report", file))
  expect_equal(run_command(words), 0)
  expect_identical(readLines(file.path(out, "report.html")), "the report")
  expect_identical(jsonlite::read_json(file.path(out, "result.json"))$models, kept$models)
  expect_false(dir.exists(file.path(out, "stages")))
})

test_that("a folder is used by one run at a time, and free when that is killed", {
  skip_on_os("windows")
  folder <- withr::local_tempdir()
  out <- file.path(folder, "out")
  code <- sprintf("h <- amiss:::hold_folder('%s'); cat(Sys.getpid(), file = '%s'); Sys.sleep(60)",
                  out, file.path(folder, "pid"))
  withr::local_envvar(R_LIBS = paste(.libPaths(), collapse = ":"))
  system2(file.path(R.home("bin"), "Rscript"), c("-e", shQuote(code)), wait = FALSE)
  while (!isTRUE(file.size(file.path(folder, "pid")) > 0)) Sys.sleep(0.1)
  pid <- scan(file.path(folder, "pid"), quiet = TRUE)
  refused <- expect_error(hold_folder(out), paste0("in use by process ", pid, " on "),
                          class = "amiss_error_input")
  expect_match(conditionMessage(refused), Sys.info()[["nodename"]], fixed = TRUE)
  tools::pskill(pid, tools::SIGKILL)
  Sys.sleep(0.5)
  release_folder(hold_folder(out))
  expect_length(dir(out, all.files = TRUE, no.. = TRUE), 0)
})
