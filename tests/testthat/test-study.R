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
  out <- file.path(folder, "100 %d")  # a name that R could take for a format
  upgrade <- run_study(write_study_file(folder), out, quiet = TRUE)
  expect_setequal(list.files(out), c("report.html", "figures", "result.rds", "result.json"))
  expect_gt(length(list.files(file.path(out, "figures"), "png$")), 3)
  json <- jsonlite::read_json(file.path(out, "result.json"))
  expect_true(all(c("schema", "study", "seed", "wall_s", "models", "candidates", "named_cause", "gain", "stopped_because") %in% names(json)))
  expect_true(all(c("name", "parent", "mechanism", "Q", "N", "M", "noise_sd", "discarded_rms", "log10_evidence", "log10_evidence_interval",
                    "trusted", "rmse_calibration", "rmse_validation", "coverage95_validation", "parameters", "attribution") %in% names(json$models[[1]])))
  expect_null(json$models[[1]]$parent)
  expect_named(json$models[[1]]$parameters[[1]], c("name", "unit", "median", "lower95", "upper95"))
  expect_named(json$models[[1]]$attribution[[1]],
               c("boundary", "log10_bf_dropped", "share", "p_value", "significant", "group"))
  expect_true(all(c("from", "mechanism", "log10_bf", "interval", "probability") %in% names(json$candidates[[1]])))
  adopted <- json$models[[2]]
  expect_true(all(c("verdict", "doubts", "confounded_with", "held_out_gain", "emulator_error", "emulator_ratio",
                    "emulator_checked", "refinements",
                    "reach", "trust") %in% names(adopted)))
  own <- upgrade$models[[2]]
  expect_equal(adopted$verdict, own$verdict)
  expect_equal(adopted$doubts, as.list(own$doubts))
  expect_equal(adopted$confounded_with, as.list(own$confounded_with))
  expect_equal(adopted$held_out_gain, own$held_out_gain[c("mean", "standard_error")])
  expect_equal(adopted$emulator_error, own$fit$check$error)
  expect_true(adopted$emulator_checked)
  expect_equal(adopted$trust, own$fit$trust$verdict)
  expect_named(adopted$reach, c("13", "300", "Inf"))
  expect_null(json$models[[1]]$verdict)
  expect_equal(json$diagnosis$verdict, "named")
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
  expect_length(before, 3)  # the base model: coarse, in full, measured
  times <- file.mtime(file.path(kept, before))
  edits$broken <- FALSE
  resumed <- loop(fragile, kept)
  expect_identical(file.mtime(file.path(kept, before)), times)
  expect_identical(resumed$models[[2]]$fit$values, loop(study$catalogue)$models[[2]]$fit$values)
  other <- upgrade_model(function_simulator(function(values, drivers) values[["offset"]] - values[["gain"]] * drivers[, "Te"],
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
})

write_comparison_study <- function(folder, ...) {
  writeLines('offset <- free("offset", uniform(10, 30), "K")
    list(level = function_simulator(function(values, drivers) values[["offset"]] + 0 * drivers[, "Te"] + 0.4 * values[["a"]] * drivers[, "Gv"],
                                    offset, free("a", uniform(0, 0.01)), boundary = c("Te", "Gv")),
         line = function_simulator(function(values, drivers) values[["offset"]] + values[["gain"]] * drivers[, "Te"],
                                   offset, free("gain", uniform(0, 1)), boundary = "Te"))', file.path(folder, "models.R"))
  writeLines('source("values.R", local = TRUE)$value', file.path(folder, "made.R"))
  writeLines('data.frame(hour = 1:80, Te = 10 + 5 * sin(1:80 / 4), Gv = pmax(0, 300 * sin(1:80 / 5)), Ti = 24 + 2 * sin(1:80 / 4) + with_seed(3, rnorm(80, 0, 0.1)))',
             file.path(folder, "values.R"))
  write_study_file(folder, data = "made.R", models = "models.R", calibrate = "hour <= 60", validate = "hour > 60", runs = 12,
                   control = list(calibration = list(ais = list(pilot_chains = 24, groups = 4, chains = 12, importance_draws = 200))), ...,
                   drop = c("model", "catalogue"))
}

test_that("a comparison study writes its files with the agreed fields", {
  folder <- withr::local_tempdir()
  writeLines('list(simulator = source("models.R", local = TRUE)$value$line, values = c(offset = 20, gain = 0.4))', file.path(folder, "truth.R"))
  path <- write_comparison_study(folder, truth = "truth.R")
  out <- file.path(folder, "out")
  comparison <- run_study(path, out, quiet = TRUE)
  expect_s3_class(comparison, "amiss_comparison")
  expect_setequal(list.files(out), c("report.html", "figures", "result.rds", "result.json"))
  expect_setequal(list.files(file.path(out, "figures")), paste0(figures_of(comparison), ".png"))
  json <- jsonlite::read_json(file.path(out, "result.json"))
  expect_true(all(c("schema", "study", "seed", "wall_s", "method", "best", "models", "disagreements", "doubts", "truth") %in% names(json)))
  expect_equal(json$best, "line")
  expect_equal(json$truth$values, list(offset = 20, gain = 0.4))
  model <- json$models[[2]]
  expect_true(all(c("log10_evidence", "log10_evidence_interval", "log10_bf", "against", "word", "probability", "criteria", "parameters", "attribution") %in% names(model)))
  expect_true(all(c("aic", "bic", "lr", "rmse_validation", "k") %in% names(model$criteria)))
  expect_equal(vapply(model$attribution, `[[`, "", "boundary"), comparison$models$line$attribution$boundary)
  html <- paste(readLines(file.path(out, "report.html"), warn = FALSE), collapse = "\n")
  expect_match(html, "The record is decisively for line among 2 models", fixed = TRUE)
  links <- regmatches(html, gregexpr("(src|href)=\"[^\"]{0,20}", html))[[1]]
  expect_true(all(grepl("=\"(data:|#)", links)))
})

test_that("a bad comparison study is refused", {
  folder <- withr::local_tempdir()
  refuse <- function(pattern, ...) expect_error(read_study(write_comparison_study(folder, ...)), pattern, class = "amiss_error_input")
  refuse("does not exist", models = "none.R")
  refuse("method", method = "guess")
  refuse("method", method = 3)
  expect_error(read_study(write_study_file(folder, truth = "model.R")), "models.*only", class = "amiss_error_input")
  expect_error(read_study(write_study_file(folder, drop = "catalogue")), "lacks field.*catalogue", class = "amiss_error_input")
  path <- write_comparison_study(folder)
  writeLines("list(a = 1)", file.path(folder, "models.R"))
  expect_error(read_study(path), "Model \"a\" is no simulator", class = "amiss_error_input")
  path <- write_comparison_study(folder)
  writeLines("1:3", file.path(folder, "made.R"))
  expect_error(read_study(path), "data", class = "amiss_error_input")
  both <- yaml::read_yaml(path)
  both$catalogue <- "catalogue.R"
  yaml::write_yaml(both, path)
  expect_error(read_study(path), "field.*catalogue.*which goes with", class = "amiss_error_input")
})

test_that("the paper's studies that ship can be read", {
  for (name in c("paper_synthetic", "paper_real_like")) {
    study <- read_study(system.file("studies", paste0(name, ".yml"), package = "amiss"))
    m <- study$measurements
    expect_identical(sum(m$use == "calibrate"), 384L)
    expect_identical(m$conditions, c("Te", "Gv", "Ws", "Wd", "RHP"))
    expect_true(all(names(study$truth$values) %in% names(free_parameters(study$truth$simulator))))
    rows <- m$use == "calibrate"
    noise <- m$y[rows] - m$raw$drivers[rows, "Ti_clean"]
    # Standard deviation of 384 normal values: 3.6 % standard error.
    expect_equal(stats::sd(noise), m$noise_sd, tolerance = 0.12)
    if (name == "paper_synthetic") expect_equal(m$noise_sd^2, 0.01 * stats::var(m$raw$drivers[rows, "Ti_clean"]), tolerance = 0.01)
  }
})
