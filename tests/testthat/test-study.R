write_study_file <- function(folder, ..., drop = character()) {
  fields <- list(study = "linear", data = "data.csv", time = "hour", target = "Ti", boundary = list("Te", "Gv"), noise_sd = 0.1,
                 unit = "K", calibrate = "hour <= 180", validate = "hour > 180", model = "model.R", catalogue = "catalogue.R",
                 runs = 30, seed = 4, control = list(max_steps = 1, calibration = quick_ais, attribution = list(surrogates = 19)))
  edits <- list(...)
  fields[names(edits)] <- edits
  data <- linear_data()
  data$Ti <- data$Ti + 0.002 * data$Gv
  utils::write.csv(data, file.path(folder, "data.csv"), row.names = FALSE)
  writeLines('function_simulator(function(values, drivers) values[["offset"]] + values[["gain"]] * drivers[, "Te"],
    free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), boundary = "Te", name = "linear")', file.path(folder, "model.R"))
  writeLines('catalogue(mechanism("sun", boundary = "Gv", sentence = "The sun shines in.", edit = function(model)
    function_simulator(function(values, drivers) values[["offset"]] + values[["gain"]] * drivers[, "Te"] + values[["sun"]] * drivers[, "Gv"],
      free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), free("sun", uniform(0, 0.01), "K/(W/m2)"), boundary = c("Te", "Gv"))))',
    file.path(folder, "catalogue.R"))
  path <- file.path(folder, "study.yml")
  yaml::write_yaml(fields[setdiff(names(fields), drop)], path)
  path
}

test_that("a study writes its files with the agreed fields", {
  folder <- withr::local_tempdir()
  out <- file.path(folder, "out")
  upgrade <- run_study(write_study_file(folder), out, quiet = TRUE)
  expect_setequal(list.files(out), c("report.html", "figures", "result.rds", "result.json"))
  expect_gt(length(list.files(file.path(out, "figures"), "png$")), 3)
  json <- jsonlite::read_json(file.path(out, "result.json"))
  expect_true(all(c("schema", "study", "seed", "wall_s", "models", "candidates", "named_cause", "gain", "stopped_because") %in% names(json)))
  expect_true(all(c("name", "parent", "mechanism", "Q", "N", "M", "noise_sd", "discarded_rms", "log10_evidence", "log10_evidence_interval",
                    "trusted", "rmse_calibration", "rmse_validation", "coverage95_validation", "parameters", "attribution") %in% names(json$models[[1]])))
  expect_null(json$models[[1]]$parent)
  expect_named(json$models[[1]]$parameters[[1]], c("name", "unit", "median", "lower95", "upper95"))
  expect_named(json$models[[1]]$attribution[[1]], c("boundary", "log10_bf_dropped", "share", "p_value", "significant"))
  expect_true(all(c("from", "mechanism", "log10_bf", "interval", "probability") %in% names(json$candidates[[1]])))
  expect_equal(json$named_cause$mechanism, "sun")
  expect_equal(json$named_cause$boundary, list("Gv"))
  expect_length(json$gain$interval, 2)
  expect_equal(json$seed, 4)
  again <- run_study(file.path(folder, "study.yml"), quiet = TRUE)
  expect_identical(again$models[[2]]$fit$values, readRDS(file.path(out, "result.rds"))$models[[2]]$fit$values)
})

test_that("an interrupted loop goes on where it stopped, with the same result", {
  folder <- withr::local_tempdir()
  study <- read_study(write_study_file(folder))
  loop <- function(catalogue, checkpoint = NULL) {
    upgrade_model(study$model, study$measurements, catalogue, runs = 30, control = study$control, seed = 4, quiet = TRUE, checkpoint = checkpoint)
  }
  kept <- file.path(folder, "kept")
  edits <- new.env()
  edits$broken <- TRUE
  fragile <- catalogue(mechanism("sun", boundary = "Gv", sentence = "Sun.", edit = function(model) {
    if (edits$broken) stop("power cut")
    study$catalogue$sun$edit(model)
  }))
  expect_error(loop(fragile, kept), "power cut", class = "amiss_error_input")
  before <- list.files(kept)
  expect_length(before, 2)
  times <- file.mtime(file.path(kept, before))
  edits$broken <- FALSE
  resumed <- loop(fragile, kept)
  expect_identical(file.mtime(file.path(kept, before)), times)
  expect_identical(resumed$models[[2]]$fit$values, loop(study$catalogue)$models[[2]]$fit$values)
  other <- upgrade_model(function_simulator(function(values, drivers) values[["offset"]] + 0 * drivers[, "Te"],
                                            free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), boundary = "Te"),
                         study$measurements, catalogue(), runs = 30, control = study$control, seed = 4, quiet = TRUE, checkpoint = kept)
  expect_false(identical(other$models[[1]]$fit$log_evidence, resumed$models[[1]]$fit$log_evidence))
})

test_that("a bad study is refused and nothing is written", {
  folder <- withr::local_tempdir()
  out <- file.path(folder, "out")
  refuse <- function(pattern, ...) {
    expect_error(run_study(write_study_file(folder, ...), out, quiet = TRUE), pattern, class = "amiss_error_input")
    expect_false(file.exists(out))
  }
  refuse("lacks field.*target", drop = "target")
  refuse("unknown field.*colour", colour = "red")
  refuse("does not exist", data = "none.csv")
  refuse("Gh.*not in the data", boundary = list("Te", "Gh"))
  refuse("unknown option.*steps", control = list(steps = 3))
  writeLines("stop('broken model')", file.path(folder, "bad.R"))
  refuse("broken model", model = "bad.R")
  expect_error(run_study(file.path(folder, "nothing.yml")), class = "amiss_error_input")
})

test_that("the command follows its exit codes", {
  command <- system.file("exec", "amiss", package = "amiss")
  skip_if(command == "", "the command is not installed")
  folder <- withr::local_tempdir()
  study <- write_study_file(folder)
  run <- function(...) {
    suppressWarnings(system2(file.path(R.home("bin"), "Rscript"), c(shQuote(command), ...), stdout = FALSE, stderr = FALSE,
                             env = paste0("R_LIBS=", paste(.libPaths(), collapse = ":"))))
  }
  expect_equal(run("run", shQuote(study), "--out", shQuote(file.path(folder, "out")), "--quiet", "--seed", "9"), 0)
  expect_equal(jsonlite::read_json(file.path(folder, "out", "result.json"))$seed, 9)
  expect_equal(run("run", shQuote(study)), 2)
  expect_equal(run("run", shQuote(study), "--out"), 2)
  expect_equal(run("run", shQuote(study), "--out", "x", "--threads", "many"), 2)
  expect_equal(run("walk"), 2)
  expect_equal(run("--help"), 0)
  bad <- write_study_file(folder, target = "nothing")
  expect_equal(run("run", shQuote(bad), "--out", shQuote(file.path(folder, "bad"))), 1)
  expect_false(file.exists(file.path(folder, "bad")))
})

test_that("a folder that cannot be used is refused before anything is computed", {
  folder <- withr::local_tempdir()
  study <- write_study_file(folder)
  file.create(file.path(folder, "afile"))
  expect_error(run_study(study, file.path(folder, "afile", "sub"), quiet = TRUE), "not a folder", class = "amiss_error_input")
  out <- file.path(folder, "100 %d")
  run_study(study, out, quiet = TRUE)
  expect_true(file.exists(file.path(out, "report.html")))
})
