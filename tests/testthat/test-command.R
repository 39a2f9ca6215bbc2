# Exit code of the installed command.
exit_code <- function(...) {
  command <- system.file("exec", "amiss", package = "amiss")
  skip_if(command == "", "the command is not installed")
  suppressWarnings(system2(file.path(R.home("bin"), "Rscript"), c(shQuote(command), ...),
                           stdout = FALSE, stderr = FALSE,
                           env = paste0("R_LIBS=", paste(.libPaths(), collapse = ":"))))
}

test_that("the command ends with 0 when the study ran, with the seed that it was given", {
  skip_on_cran()
  folder <- withr::local_tempdir()
  expect_equal(exit_code("run", shQuote(write_study_file(folder)), "--out",
                         shQuote(file.path(folder, "out")), "--quiet", "--trust", "--seed", "9"), 0)
  expect_equal(jsonlite::read_json(file.path(folder, "out", "result.json"))$seed, 9)
})

test_that("the command ends with 2 when a word lacks", {
  skip_on_cran()  # second tier: tools/test --quick
  expect_equal(exit_code("run", shQuote(write_study_file(withr::local_tempdir()))), 2)
})

test_that("the command ends with 0 when it was asked for help", {
  skip_on_cran()  # second tier: tools/test --quick
  expect_equal(exit_code("run", "--help"), 0)
})

test_that("the command ends with 1 when the study is refused, and leaves nothing", {
  folder <- withr::local_tempdir()
  bad <- write_study_file(folder, target = "nothing")
  expect_equal(
    exit_code("run", shQuote(bad), "--out", shQuote(file.path(folder, "bad")), "--trust"), 1)
  expect_false(file.exists(file.path(folder, "bad")))
})

# What the command says of words that it refuses.
said <- function(...) {
  told <- NULL
  study <- write_study_file(withr::local_tempdir())
  status <- withCallingHandlers(run_command(c("run", study, "--out", "x", ...)),
                                message = function(m) {
    told <<- conditionMessage(m)
    invokeRestart("muffleMessage")
  })
  expect_equal(status, 2)
  strsplit(told, "\n")[[1]][1]
}

test_that("numbers among the command's words are checked", {
  for (seed in c("Inf", "1.5", "NaN", "1e20", "x"))
    expect_match(said("--seed", seed), "'--seed' needs a whole number", fixed = TRUE)
  expect_match(said("--threads", "0"), "from 1 to 1024, not '0'")
})

test_that("the command refuses words that it does not know", {
  expect_match(said("--colour"), "colour")
  expect_match(said("another.yml"), "one study file")
  study <- write_study_file(withr::local_tempdir())
  for (words in list("walk", character(), c("run", study), c("run", study, "--out")))
    expect_equal(suppressMessages(run_command(words)), 2)
})

test_that("the command says its options and its version", {
  expect_output(expect_equal(run_command(c("run", "--help")), 0), "--trust")
  expect_output(expect_equal(run_command("--version"), 0),
                as.character(utils::packageVersion("amiss")))
})
