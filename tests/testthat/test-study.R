skip_on_cran()  # second tier: tools/test --quick
# Runs are made once for this file.
study_cache <- new.env()

session_folder <- function() withr::local_tempdir(.local_envir = teardown_env())

ran_study <- function() {
  if (is.null(study_cache$ran)) {
    folder <- session_folder()
    out <- file.path(folder, "100 %d")  # a name that R could take for a format
    path <- write_study_file(folder)
    upgrade <- run_study(path, out, quiet = TRUE, trust = TRUE)
    study_cache$ran <- list(path = path, out = out, upgrade = upgrade,
                            json = jsonlite::read_json(file.path(out, "result.json")))
  }
  study_cache$ran
}

test_that("a study writes its files", {
  skip_on_cran()
  out <- ran_study()$out
  expect_setequal(list.files(out), c("report.html", "figures", "result.rds", "result.json"))
  expect_gt(length(list.files(file.path(out, "figures"), "png$")), 3)
})

test_that("a study is quiet only as long as it runs", {
  ran_study()
  expect_null(getOption("amiss.progress"))
})

test_that("a study's result has the agreed fields", {
  json <- ran_study()$json
  expect_true(all(c("schema", "study", "seed", "wall_s", "models", "candidates", "named_cause",
                    "gain", "stopped_because") %in% names(json)))
  expect_true(all(c("name", "parent", "mechanism", "Q", "N", "M", "noise_sd", "discarded_rms",
                    "log10_evidence", "log10_evidence_interval", "trusted", "rmse_calibration",
                    "rmse_validation", "coverage95_validation", "parameters", "attribution") %in%
                  names(json$models[[1]])))
  expect_named(json$models[[1]]$parameters[[1]], c("name", "unit", "median", "lower95", "upper95",
                                                     "physical_lower", "physical_upper"))
  expect_named(json$models[[1]]$attribution[[1]],
               c("boundary", "log10_bf_dropped", "share", "p_value", "significant", "group"))
  expect_true(all(c("from", "mechanism", "log10_bf", "interval", "probability") %in%
                  names(json$candidates[[1]])))
  expect_true(all(c("verdict", "doubts", "confounded_with", "held_out_gain", "emulator_error",
                    "emulator_ratio", "emulator_checked", "refinements", "reach", "trust") %in%
                  names(json$models[[2]])))
})

test_that("a study's result says of an adopted model what the upgrade says", {
  adopted <- ran_study()$json$models[[2]]
  own <- ran_study()$upgrade$models[[2]]
  expect_equal(adopted$verdict, own$verdict)
  expect_equal(adopted$doubts, as.list(own$doubts))
  expect_equal(adopted$confounded_with, as.list(own$confounded_with))
  expect_equal(adopted$held_out_gain, own$held_out_gain[c("mean", "standard_error")])
  expect_equal(adopted$emulator_error, own$fit$check$error)
  expect_true(adopted$emulator_checked)
  expect_equal(adopted$trust, own$fit$trust$verdict)
  expect_named(adopted$reach, "13")
})

test_that("the base model has no parent and no verdict", {
  base <- ran_study()$json$models[[1]]
  expect_null(base$parent)
  expect_null(base$verdict)
})

test_that("a study's result names the cause, with the gain and the seed", {
  json <- ran_study()$json
  expect_equal(json$diagnosis$verdict, "named")
  expect_equal(json$named_cause$mechanism, "sun")
  expect_equal(json$named_cause$boundary, list("Gv"))
  expect_length(json$gain$interval, 2)
  expect_equal(json$seed, 4)
})

test_that("a study run again, without a folder, gives the same result", {
  again <- run_study(ran_study()$path, quiet = TRUE, trust = TRUE)
  expect_identical(again$models[[2]]$fit$values,
                   readRDS(file.path(ran_study()$out, "result.rds"))$models[[2]]$fit$values)
})

# A loop whose first edit fails, and the same when the edit works.
interrupted_loop <- function() {
  if (is.null(study_cache$loop)) {
    folder <- session_folder()
    kept <- file.path(folder, "kept")
    study <- read_study(write_study_file(folder), trust = TRUE)
    loop <- function(catalogue, checkpoint = NULL, model = study$model) {
      upgrade_model(model, study$measurements, catalogue, runs = 30, control = study$control,
                    seed = 4, quiet = TRUE, checkpoint = checkpoint)
    }
    edits <- new.env()
    edits$broken <- FALSE
    fragile <- catalogue(mechanism("sun", boundary = "Gv", sentence = "Sun.",
                                   edit = function(model) {
      if (edits$broken) stop("power cut")
      edits$broken <- is.null(edits$mended)  # it could be applied when the loop began
      study$catalogue$sun$edit(model)
    }))
    stopped <- rlang::catch_cnd(loop(fragile, kept), "error")
    before <- list.files(kept, full.names = TRUE)
    times <- file.mtime(before)
    edits$broken <- FALSE
    edits$mended <- TRUE
    resumed <- loop(fragile, kept)
    study_cache$loop <- list(study = study, loop = loop, kept = kept, stopped = stopped,
                             before = before,
                             times = times, times_after = file.mtime(before), resumed = resumed)
  }
  study_cache$loop
}

test_that("an interrupted loop keeps the stages that were done", {
  own <- interrupted_loop()
  expect_error(rlang::cnd_signal(own$stopped), "power cut", class = "amiss_error_input")
  # The base model's runs: over the priors, of searches, in the region, at its centre, of checks.
  expect_gte(length(own$before), 5)
})

test_that("an interrupted loop goes on where it stopped, with the same result", {
  own <- interrupted_loop()
  expect_identical(own$times_after, own$times)
  expect_identical(own$resumed$models[[2]]$fit$values,
                   own$loop(own$study$catalogue)$models[[2]]$fit$values)
})

test_that("what is kept of one model does not serve another", {
  own <- interrupted_loop()
  turned <- function_simulator(
    function(values, drivers) values[["offset"]] - values[["gain"]] * drivers[, "Te"],
    free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), boundary = "Te")
  other <- own$loop(catalogue(), own$kept, model = turned)
  expect_false(identical(other$models[[1]]$fit$log_evidence,
                         own$resumed$models[[1]]$fit$log_evidence))
})

test_that("a bad study is refused and nothing is written", {
  folder <- withr::local_tempdir()
  out <- file.path(folder, "out")
  refuse <- function(pattern, ...) {
    expect_error(run_study(write_study_file(folder, ...), out, quiet = TRUE, trust = TRUE), pattern,
                 class = "amiss_error_input")
    expect_false(file.exists(out))
  }
  refuse("lacks field.*target", drop = "target")
  refuse("unknown field.*colour", colour = "red")
  refuse("does not exist", data = "none.csv")
  refuse("Gh.*not in the data", boundary = list("Te", "Gh"))
  refuse("unknown option.*steps", control = list(steps = 3))
  writeLines("stop('broken model')", file.path(folder, "bad.R"))
  refuse("broken model", model = "bad.R")
})

test_that("a study that does not exist is refused", {
  expect_error(run_study(file.path(withr::local_tempdir(), "nothing.yml")),
               class = "amiss_error_input")
})

test_that("a study refused for its settings leaves nothing", {
  folder <- withr::local_tempdir()
  out <- file.path(folder, "out")
  dir.create(out)
  for (control in list(list(calibration = list(nonsense = 1)),
                       list(attribution = list(nonsense = 1)),
                       list(emulator = list(nonsense = 1)))) {
    expect_error(run_study(write_study_file(folder, control = control), out, quiet = TRUE,
                           trust = TRUE),
                 "nonsense", class = "amiss_error_input")
    expect_length(dir(out, all.files = TRUE, no.. = TRUE), 0)
  }
})

test_that("a folder that cannot be used is refused before anything is computed", {
  folder <- withr::local_tempdir()
  study <- write_study_file(folder)
  file.create(file.path(folder, "afile"))
  expect_error(run_study(study, file.path(folder, "afile", "sub"), quiet = TRUE, trust = TRUE),
               "not a folder", class = "amiss_error_input")
})

# A study whose model leaves a file behind when its code is run.
tracing_study <- function(folder) {
  path <- write_study_file(folder)
  write(sprintf("file.create('%s')", file.path(folder, "touched")), file.path(folder, "model.R"),
        append = TRUE)
  path
}

test_that("R files need trust and are not run without it", {
  folder <- withr::local_tempdir()
  path <- tracing_study(folder)
  error <- expect_error(run_study(path, file.path(folder, "out"), quiet = TRUE),
                        "model.R.*catalogue.R", class = "amiss_error_trust")
  expect_false(grepl("data.csv", conditionMessage(error)))
  expect_false(file.exists(file.path(folder, "touched")) || file.exists(file.path(folder, "out")))
})

test_that("at a terminal one is asked whether a study is trusted", {
  folder <- withr::local_tempdir()
  withr::with_options(list(rlang_interactive = TRUE, askYesNo = function(...) FALSE),
                      expect_error(read_study(tracing_study(folder)), class = "amiss_error_trust"))
  withr::with_options(list(rlang_interactive = TRUE, askYesNo = function(...) TRUE),
                      expect_named(read_study(write_study_file(folder))$catalogue, "sun"))
})

test_that("the command does not run R files that are not trusted", {
  folder <- withr::local_tempdir()
  path <- tracing_study(folder)
  expect_equal(suppressMessages(run_command(c("run", path, "--out", file.path(folder, "out")))), 1)
  expect_false(file.exists(file.path(folder, "touched")))
})

test_that("files outside a study's folder need trust", {
  folder <- withr::local_tempdir()
  write_study_file(folder)
  inside <- file.path(folder, "inside")
  dir.create(inside)
  file.symlink(file.path(folder, "data.csv"), file.path(inside, "linked.csv"))
  file.copy(file.path(folder, "data.csv"), inside)
  need <- function(data)
    require_trust(c(data = file.path(inside, data)), normalizePath(inside), FALSE)
  expect_silent(need("data.csv"))
  expect_error(need("../data.csv"), "outside its folder", class = "amiss_error_trust")
  expect_error(need("linked.csv"), "outside its folder", class = "amiss_error_trust")
})

test_that("a study that ships needs no trust", {
  expect_s3_class(read_study(twinhouse_study("O5"))$catalogue, "amiss_catalogue")
})

test_that("a study with other letters is read whole in the C locale", {
  folder <- withr::local_tempdir()
  path <- write_study_file(folder, title = "K\u00fche in der K\u00e4lte", unit = "\u00b0C",
                           calibrate = "`T\u00fcr` <= 180", validate = "`T\u00fcr` > 180")
  csv <- file.path(folder, "data.csv")
  writeLines(sub("\"hour\"", "\"hour\",\"T\u00fcr\"",
                 sub("^([0-9]+),", "\\1,\\1,", readLines(csv))),
             csv, useBytes = TRUE)
  code <- sprintf("s <- amiss::read_study('%s', trust = TRUE); saveRDS(s, '%s')", path,
                  file.path(folder, "s.rds"))
  withr::with_envvar(c(LC_ALL = "C", R_LIBS = paste(.libPaths(), collapse = ":")),
                     system2(file.path(R.home("bin"), "Rscript"), c("-e", shQuote(code))))
  study <- readRDS(file.path(folder, "s.rds"))
  expect_equal(study$title, "K\u00fche in der K\u00e4lte")
  expect_equal(study$measurements$unit, "\u00b0C")
  expect_equal(study$seed, 4)
  expect_equal(sum(study$measurements$use == "calibrate"), 180)
})

ran_comparison <- function() {
  if (is.null(study_cache$comparison)) {
    folder <- session_folder()
    writeLines(paste('list(simulator = source("models.R", local = TRUE)$value$line,',
                     "values = c(offset = 20, gain = 0.4))"), file.path(folder, "truth.R"))
    out <- file.path(folder, "out")
    comparison <- run_study(write_comparison_study(folder, truth = "truth.R"), out, quiet = TRUE,
                            trust = TRUE)
    study_cache$comparison <- list(out = out, comparison = comparison,
                                   json = jsonlite::read_json(file.path(out, "result.json")))
  }
  study_cache$comparison
}

test_that("a comparison study writes its files", {
  skip_on_cran()
  own <- ran_comparison()
  expect_s3_class(own$comparison, "amiss_comparison")
  expect_setequal(list.files(own$out), c("report.html", "figures", "result.rds", "result.json"))
  figures <- figures_of(own$comparison)
  expect_gt(length(figures), 0)
  expect_setequal(list.files(file.path(own$out, "figures")), paste0(figures, ".png"))
})

test_that("a comparison study's result has the agreed fields", {
  json <- ran_comparison()$json
  expect_true(all(c("schema", "study", "seed", "wall_s", "method", "best", "models",
                    "disagreements", "doubts",
                    "truth") %in% names(json)))
  model <- json$models[[2]]
  expect_true(all(c("log10_evidence", "log10_evidence_interval", "log10_bf", "against", "word",
                    "probability", "criteria", "parameters", "attribution") %in% names(model)))
  expect_true(all(c("aic", "bic", "lr", "rmse_validation", "k") %in% names(model$criteria)))
})

test_that("a comparison study's result says what the comparison found", {
  own <- ran_comparison()
  expect_equal(own$json$best, "line")
  expect_equal(own$json$truth$values, list(offset = 20, gain = 0.4))
  boundary <- own$comparison$models$line$attribution$boundary
  expect_gt(length(boundary), 0)
  expect_equal(vapply(own$json$models[[2]]$attribution, `[[`, "", "boundary"), boundary)
})

test_that(
  "a comparison study's report says for which model the record is, and needs no other file", {
  html <- paste(readLines(file.path(ran_comparison()$out, "report.html"), warn = FALSE),
                collapse = "\n")
  expect_on_page(html, "The record is decisively for line among 2 models")
  links <- regmatches(html, gregexpr("(src|href)=\"[^\"]{0,20}", html))[[1]]
  expect_gt(length(links), 0)
  expect_true(all(grepl("=\"(data:|#)", links)))
})

refuse_comparison <- function(pattern, path) {
  expect_error(read_study(path, trust = TRUE), pattern, class = "amiss_error_input")
}

test_that("a bad comparison study is refused", {
  folder <- withr::local_tempdir()
  refuse_comparison("does not exist", write_comparison_study(folder, models = "none.R"))
  refuse_comparison("method", write_comparison_study(folder, method = "guess"))
  refuse_comparison("method", write_comparison_study(folder, method = 3))
})

test_that("a comparison study whose code gives no simulators or no data is refused", {
  folder <- withr::local_tempdir()
  path <- write_comparison_study(folder)
  writeLines("list(a = 1)", file.path(folder, "models.R"))
  refuse_comparison("Model \"a\" is no simulator", path)
  path <- write_comparison_study(folder)
  writeLines("1:3", file.path(folder, "made.R"))
  refuse_comparison("data", path)
})

test_that("the fields of a comparison and of an upgrade do not mix", {
  folder <- withr::local_tempdir()
  expect_error(read_study(write_study_file(folder, truth = "model.R")), "models.*only",
               class = "amiss_error_input")
  expect_error(read_study(write_study_file(folder, drop = "catalogue")), "lacks field.*catalogue",
               class = "amiss_error_input")
  path <- write_comparison_study(folder)
  both <- yaml::read_yaml(path)
  both$catalogue <- "catalogue.R"
  yaml::write_yaml(both, path)
  refuse_comparison("field.*catalogue.*which goes with", path)
})

paper_study <- function(name)
  read_study(system.file("studies", paste0(name, ".yml"), package = "amiss"))

test_that("the paper's studies that ship can be read", {
  for (name in c("paper_synthetic", "paper_real_like")) {
    study <- paper_study(name)
    expect_identical(sum(study$measurements$use == "calibrate"), 384L)
    expect_identical(study$measurements$conditions, c("Te", "Gv", "Ws", "Wd", "RHP"))
    known <- names(study$truth$values)
    expect_gt(length(known), 0)
    expect_true(all(known %in% names(free_parameters(study$truth$simulator))))
  }
})

test_that("the noise of the paper's studies is as stated", {
  for (name in c("paper_synthetic", "paper_real_like")) {
    m <- paper_study(name)$measurements
    rows <- m$use == "calibrate"
    noise <- m$y[rows] - m$raw$drivers[rows, "Ti_clean"]
    # Standard deviation of 384 normal values: 3.6 % standard error.
    expect_equal(stats::sd(noise), m$noise_sd, tolerance = 0.12)
  }
})

test_that("the noise of the paper's synthetic study has a hundredth of the record's variance", {
  m <- paper_study("paper_synthetic")$measurements
  expect_equal(m$noise_sd^2, 0.01 * stats::var(m$raw$drivers[m$use == "calibrate", "Ti_clean"]),
               tolerance = 0.01)
})

test_that("a study says which values are missing and where a sensor ends", {
  folder <- withr::local_tempdir()
  data <- linear_data(120)
  data$Ti[7] <- -9999
  data$Ti[20] <- 31
  write.csv(data, file.path(folder, "data.csv"), row.names = FALSE)
  writeLines(c("library(amiss)",
               "function_simulator(function(v, d) v[['a']] * d[, 'Te'], free('a', uniform(0, 1)),",
               "                   boundary = 'Te')"), file.path(folder, "model.R"))
  writeLines("amiss::catalogue()", file.path(folder, "catalogue.R"))
  written <- function(...) {
    path <- file.path(folder, "study.yml")
    writeLines(c("study: marks", "data: data.csv", "time: hour", "target: Ti", "boundary: [Te, Gv]",
                 "noise_sd: 0.1", "model: model.R", "catalogue: catalogue.R", ...), path)
    read_study(path, trust = TRUE)$measurements
  }
  expect_error(written(), "-9999", class = "amiss_error_input")
  expect_setequal(which(is.na(written("missing: -9999")$y)), 7)
  expect_setequal(which(is.na(written("missing: [-9999, 85]", "range: [-.inf, 31]")$y)), c(7, 20))
  expect_equal(written("missing: none")$y[7], -9999)
  expect_error(written("missing: [-9999]", "range: [31, 0]"), "lower end comes first",
               class = "amiss_error_input")
  expect_error(written("missing: broken"), "missing", class = "amiss_error_input")
})

test_that("a study prints as a person reads it, and is a list still", {
  shipped <- function(name) read_study(system.file("studies", name, package = "amiss"))
  study <- shipped("twinhouse_O5.yml")
  expect_s3_class(study, "amiss_study")
  expect_type(study, "list")
  expect_lte(length(capture.output(print(study))), 15)
  told <- printed(study)
  for (part in c("twinhouse_O5.*Twin House O5, living-room", "mechanisms of the catalogue",
                 "624 rows of 1 h, from 2013-08-30 01:00:00 to 2013-10-01.* 336 calibrate, 240 val",
                 "target air of the living room \\[K\\], noise 0.1 K", "sun from the south \\[W/m",
                 "model: a zone with 9", "8 mechanisms: south solar aperture", "options: seed = 1",
                 "next: .*run_study")) {
    expect_match(told, part)
  }
  # Options that are what they would be anyway are not shown.
  study$control <- list(max_steps = 1L, decisive = 2, calibration = list(ais = list(groups = 4L)))
  expect_match(printed(study), "seed = 1, max_steps = 1, calibration$ais$groups = 4 ", fixed = TRUE)
  study$measurements <- list(a = study$measurements, b = study$measurements)
  study$model <- list(a = study$model, b = study$model)
  expect_match(printed(study), "a: record.*b: record.*model a: a zone.*model b: a zone")
  compared <- printed(shipped("paper_synthetic.yml"))
  expect_match(compared, "3 models.*none held out.*model M1: a zone with 3.*compare_models")
  expect_match(compared, "options: seed = 1 ", fixed = TRUE)
})
