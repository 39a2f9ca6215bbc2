skip_on_cran()  # second tier: tools/test --quick
# A study run once into a folder in which files of others stand.
used_folder <- local({
  used <- NULL
  function() {
    if (is.null(used)) {
      folder <- withr::local_tempdir(.local_envir = teardown_env())
      out <- file.path(folder, "out")
      theirs <- file.path(out, c("probe", "stages/notes.txt", "stages/mine.rds", "figures/mine.png"))
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

test_that("a copy that is cut short, as on a full disk, is refused and removed", {
  folder <- withr::local_tempdir()
  work <- file.path(folder, "work")
  out <- file.path(folder, "out")
  dir.create(work)
  dir.create(out)
  writeLines("all of it", file.path(work, "result.json"))
  short <- function(from, to, ...) {
    file.copy(from, to, ...)
    cat("all", file = file.path(to, basename(from), "result.json"))
    TRUE
  }
  expect_error(copy_whole(work, out, copy = short), "could not be copied", class = "amiss_error_input")
  expect_length(dir(out), 0)
  expect_equal(readLines(file.path(copy_whole(work, out), "result.json")), "all of it")
})

test_that("a folder is used by one run at a time, and free when that is killed", {
  skip_on_os("windows")
  folder <- withr::local_tempdir()
  out <- file.path(folder, "out")
  code <- sprintf("h <- amiss:::hold_folder('%s'); cat(Sys.getpid(), file = '%s'); Sys.sleep(60)", out,
                  file.path(folder, "pid"))
  withr::local_envvar(R_LIBS = paste(.libPaths(), collapse = ":"))
  system2(file.path(R.home("bin"), "Rscript"), c("-e", shQuote(code)), wait = FALSE)
  while (!isTRUE(file.size(file.path(folder, "pid")) > 0)) Sys.sleep(0.1)
  pid <- scan(file.path(folder, "pid"), quiet = TRUE)
  refused <- expect_error(hold_folder(out), paste0("in use by process ", pid, " on "), class = "amiss_error_input")
  expect_match(conditionMessage(refused), Sys.info()[["nodename"]], fixed = TRUE)
  tools::pskill(pid, tools::SIGKILL)
  Sys.sleep(0.5)
  release_folder(hold_folder(out))
  expect_length(dir(out, all.files = TRUE, no.. = TRUE), 0)
})
