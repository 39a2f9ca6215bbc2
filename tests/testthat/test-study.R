write_study_file <- function(folder, ..., drop = character()) {
  fields <- list(study = "linear", data = "data.csv", time = "hour", target = "Ti", boundary = list("Te", "Gv"),
                 noise_sd = 0.1,
                 unit = "K", calibrate = "hour <= 180", validate = "hour > 180", model = "model.R",
                 catalogue = "catalogue.R",
                 runs = 30, seed = 4,
                 control = list(max_steps = 1, calibration = quick_ais, attribution = list(surrogates = 19)))
  edits <- list(...)
  fields[names(edits)] <- edits
  data <- linear_data()
  data$Ti <- data$Ti + 0.002 * data$Gv
  utils::write.csv(data, file.path(folder, "data.csv"), row.names = FALSE)
  writeLines('function_simulator(function(values, drivers) values[["offset"]] + values[["gain"]] * drivers[, "Te"],
    free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), boundary = "Te", name = "linear")', file.path(
      folder, "model.R"))
  writeLines('catalogue(mechanism("sun", boundary = "Gv", sentence = "The sun shines in.", edit = function(model)
    function_simulator(function(values, drivers) {
      values[["offset"]] + values[["gain"]] * drivers[, "Te"] + values[["sun"]] * drivers[, "Gv"]
    }, free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), free("sun", uniform(0, 0.01), "K/(W/m2)"),
      boundary = c("Te", "Gv"))))',
    file.path(folder, "catalogue.R"))
  path <- file.path(folder, "study.yml")
  yaml::write_yaml(fields[setdiff(names(fields), drop)], path)
  path
}

test_that("a study writes its files with the agreed fields", {
  folder <- withr::local_tempdir()
  out <- file.path(folder, "100 %d")  # a name that R could take for a format
  upgrade <- run_study(write_study_file(folder), out, quiet = TRUE, trust = TRUE)
  expect_null(getOption("amiss.progress"))  # quiet only as long as the study ran
  expect_setequal(list.files(out), c("report.html", "figures", "result.rds", "result.json"))
  expect_gt(length(list.files(file.path(out, "figures"), "png$")), 3)
  json <- jsonlite::read_json(file.path(out, "result.json"))
  expect_true(all(c("schema", "study", "seed", "wall_s", "models", "candidates", "named_cause", "gain",
                    "stopped_because") %in% names(json)))
  expect_true(all(c("name", "parent", "mechanism", "Q", "N", "M", "noise_sd", "discarded_rms", "log10_evidence",
                    "log10_evidence_interval",
                    "trusted", "rmse_calibration", "rmse_validation", "coverage95_validation", "parameters",
                    "attribution") %in% names(json$models[[1]])))
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
  again <- run_study(file.path(folder, "study.yml"), quiet = TRUE, trust = TRUE)
  expect_identical(again$models[[2]]$fit$values, readRDS(file.path(out, "result.rds"))$models[[2]]$fit$values)
})

test_that("an interrupted loop goes on where it stopped, with the same result", {
  folder <- withr::local_tempdir()
  study <- read_study(write_study_file(folder), trust = TRUE)
  loop <- function(catalogue, checkpoint = NULL) {
    upgrade_model(study$model, study$measurements, catalogue, runs = 30, control = study$control, seed = 4,
                  quiet = TRUE, checkpoint = checkpoint)
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
  other <- upgrade_model(function_simulator(function(values, drivers) values[["offset"]] -
                                            values[["gain"]] * drivers[, "Te"],
                                            free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)),
                                            boundary = "Te"),
                         study$measurements, catalogue(), runs = 30, control = study$control, seed = 4, quiet = TRUE,
                         checkpoint = kept)
  expect_false(identical(other$models[[1]]$fit$log_evidence, resumed$models[[1]]$fit$log_evidence))
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
  expect_error(run_study(file.path(folder, "nothing.yml")), class = "amiss_error_input")
})

test_that("the command follows its exit codes", {
  command <- system.file("exec", "amiss", package = "amiss")
  skip_if(command == "", "the command is not installed")
  folder <- withr::local_tempdir()
  study <- write_study_file(folder)
  run <- function(...) {
    suppressWarnings(system2(file.path(R.home("bin"), "Rscript"), c(shQuote(command), ...), stdout = FALSE,
                             stderr = FALSE,
                             env = paste0("R_LIBS=", paste(.libPaths(), collapse = ":"))))
  }
  expect_equal(run("run", shQuote(study), "--out", shQuote(file.path(folder, "out")), "--quiet", "--trust", "--seed",
                   "9"), 0)
  expect_equal(jsonlite::read_json(file.path(folder, "out", "result.json"))$seed, 9)
  expect_equal(run("run", shQuote(study)), 2)
  expect_equal(run("run", "--help"), 0)
  bad <- write_study_file(folder, target = "nothing")
  expect_equal(run("run", shQuote(bad), "--out", shQuote(file.path(folder, "bad")), "--trust"), 1)
  expect_false(file.exists(file.path(folder, "bad")))
})

test_that("the command's words are checked", {
  study <- write_study_file(withr::local_tempdir())
  said <- function(...) {
    told <- NULL
    status <- withCallingHandlers(run_command(c("run", study, "--out", "x", ...)), message = function(m) {
      told <<- conditionMessage(m)
      invokeRestart("muffleMessage")
    })
    expect_equal(status, 2)
    strsplit(told, "\n")[[1]][1]
  }
  for (seed in c("Inf", "1.5", "NaN", "1e20", "x"))
    expect_match(said("--seed", seed), "'--seed' needs a whole number", fixed = TRUE)
  expect_match(said("--threads", "0"), "from 1 to 1024, not '0'")
  expect_match(said("--colour"), "colour")
  expect_match(said("another.yml"), "one study file")
  expect_output(expect_equal(run_command(c("run", "--help")), 0), "--trust")
  expect_output(expect_equal(run_command("--version"), 0), as.character(utils::packageVersion("amiss")))
  for (words in list("walk", character(), c("run", study), c("run", study, "--out")))
    expect_equal(suppressMessages(run_command(words)), 2)
})

test_that("a folder that cannot be used is refused before anything is computed", {
  folder <- withr::local_tempdir()
  study <- write_study_file(folder)
  file.create(file.path(folder, "afile"))
  expect_error(run_study(study, file.path(folder, "afile", "sub"), quiet = TRUE, trust = TRUE), "not a folder",
               class = "amiss_error_input")
})

test_that("a condition of a study is no R code", {
  folder <- withr::local_tempdir()
  data <- data.frame(hour = 1:6, phase = rep(c("a", "b"), 3), y = c(-1, 2, NA, 4, 5, 6))
  rows <- function(text) row_condition(text, data, "calibrate")
  expect_equal(rows("hour <= 3 & phase == 'a'"), c(TRUE, FALSE, TRUE, FALSE, FALSE, FALSE))
  expect_equal(rows("!(hour %in% c(1, 6)) | phase %in% c('a', \"c\")"), c(TRUE, TRUE, TRUE, TRUE, TRUE, FALSE))
  expect_equal(rows("-hour + 2 * y / 2 - 1 != -3"), with(data, -hour + 2 * y / 2 - 1 != -3))
  expect_equal(rows("y > -1"), data$y > -1)
  refuse <- function(text, part) expect_error(rows(text), part, fixed = TRUE, class = "amiss_error_input")
  touched <- file.path(folder, "x")
  refuse(sprintf("{system('touch %s'); hour <= 3}", touched), "system(")
  refuse(sprintf("hour <= file.create('%s')", touched), "file.create(")
  refuse(sprintf("hour %%in%% c(1, file.create('%s'))", touched), "file.create(")
  refuse("(function() hour > 1)()", "function()")
  for (part in c("hour$x", "hour[1]", "base::exp(hour)", "hour <- 3", "hour && y", "~hour", "c(1, 2)", "if (hour) y",
                 "TRUE", "`!`(hour, y)", "`<`(e1 = hour, 3)")) {
    refuse(part, part)
  }
  refuse("hours < 3", "`hours` is not a column")
  refuse("hour %in% hour", "is not c()")
  refuse("hour < ", "cannot be read")
  refuse("hour < 3; y", "not one condition")
  refuse("phase + 1 > 2", "non-numeric")
  refuse(strrep("-", 3000), "longer than 2000")
  refuse("hour", "logical")
  study <- write_study_file(folder, calibrate = sprintf("{file.create('%s'); hour <= 180}", touched))
  expect_error(read_study(study, trust = TRUE), "not allowed", class = "amiss_error_input")
  expect_false(file.exists(touched))
})

test_that("R files and files outside a study's folder need trust", {
  folder <- withr::local_tempdir()
  path <- write_study_file(folder)
  touched <- file.path(folder, "touched")
  write(sprintf("file.create('%s')", touched), file.path(folder, "model.R"), append = TRUE)
  error <- expect_error(run_study(path, file.path(folder, "out"), quiet = TRUE), "model.R.*catalogue.R",
                        class = "amiss_error_trust")
  expect_false(grepl("data.csv", conditionMessage(error)))
  expect_false(file.exists(touched) || file.exists(file.path(folder, "out")))
  withr::with_options(list(rlang_interactive = TRUE, askYesNo = function(...) FALSE),
                      expect_error(read_study(path), class = "amiss_error_trust"))
  expect_equal(suppressMessages(run_command(c("run", path, "--out", file.path(folder, "out")))), 1)
  inside <- file.path(folder, "inside")
  dir.create(inside)
  file.symlink(file.path(folder, "data.csv"), file.path(inside, "linked.csv"))
  file.copy(file.path(folder, "data.csv"), inside)
  need <- function(data) require_trust(c(data = file.path(inside, data)), normalizePath(inside), FALSE)
  expect_silent(need("data.csv"))
  expect_error(need("../data.csv"), "outside its folder", class = "amiss_error_trust")
  expect_error(need("linked.csv"), "outside its folder", class = "amiss_error_trust")
  path <- write_study_file(folder)
  withr::with_options(list(rlang_interactive = TRUE, askYesNo = function(...) TRUE),
                      expect_named(read_study(path)$catalogue, "sun"))
  expect_s3_class(read_study(twinhouse_study("O5"))$catalogue, "amiss_catalogue")
})

test_that("a study file is UTF-8, one document, without tags", {
  folder <- withr::local_tempdir()
  path <- file.path(folder, "study.yml")
  read <- function(..., bytes = charToRaw(paste0(c(...), "\n", collapse = ""))) {
    writeBin(bytes, path)
    read_study_file(path)
  }
  refuse <- function(pattern, ...) expect_error(read(...), pattern, class = "amiss_error_input")
  expect_equal(read(bytes = c(as.raw(c(0xef, 0xbb, 0xbf)), charToRaw("study: a\r\nunit: \u00b0C\r\n"))),
               list(study = "a", unit = "\u00b0C"))
  refuse("line 2", bytes = c(charToRaw("a: 1\nb: "), as.raw(0xb0), charToRaw("C\n")))
  refuse("line 2", bytes = c(charToRaw("a: 1\nb: "), as.raw(0), charToRaw("C\n")))
  refuse("tag !expr", "a: !expr file.create('x')")
  refuse("tag !!python/object:x", "a: !!python/object:x {b: 1}")
  refuse("tag !foo", "a: [!foo 1, 2]")
  refuse("Tags cannot be declared", "%TAG !e! tag:x,2000:", "---", "a: !e!foo 1")
  expect_equal(read("# see !this", "a: 'no !expr here'", "b: wait !important"),
               list(a = "no !expr here", b = "wait !important"))
  refuse("several documents", "a: 1", "---", "b: 2")
  refuse("several documents", "---", "a: 1", "...", "b: 2")
  expect_equal(read("# note", "---", "a: 1", "..."), list(a = 1L))
  refuse("nested deeper", paste0("a: ", strrep("[", 20), strrep("]", 20)))
  levels <- letters[2:9]
  refuse("more than", "a: &a [1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1]",
         sprintf("%s: &%s [%s]", levels, levels,
                 vapply(c("a", levels[-8]), function(l) paste(rep(paste0("*", l), 21), collapse = ","), "")))
  expect_equal(read("target: y", "a: [yes, no, on, off, n]", "b: true", "c: false"),
               list(target = "y", a = c("yes", "no", "on", "off", "n"), b = TRUE, c = FALSE))
  expect_error(read_study(write_study_file(folder, title = 2024L), trust = TRUE), "title", class = "amiss_error_input")
  expect_error(read_study(write_study_file(folder, unit = list(1, 2)), trust = TRUE), "unit",
               class = "amiss_error_input")
  expect_error(read_study_file(folder), "not a regular file", class = "amiss_error_input")
  expect_error(read_study(write_study_file(folder, data = "."), trust = TRUE), "not a regular file",
               class = "amiss_error_input")
  skip_on_os("windows")
  pipe <- file.path(folder, "pipe")
  system2("mkfifo", shQuote(pipe))
  expect_error(read_study_file(pipe), "not a regular file", class = "amiss_error_input")
})

test_that("a study with other letters is read whole in the C locale", {
  folder <- withr::local_tempdir()
  path <- write_study_file(folder, title = "K\u00fche in der K\u00e4lte", unit = "\u00b0C",
                           calibrate = "`T\u00fcr` <= 180", validate = "`T\u00fcr` > 180")
  csv <- file.path(folder, "data.csv")
  writeLines(sub("\"hour\"", "\"hour\",\"T\u00fcr\"", sub("^([0-9]+),", "\\1,\\1,", readLines(csv))), csv,
             useBytes = TRUE)
  code <- sprintf("s <- amiss::read_study('%s', trust = TRUE); saveRDS(s, '%s')", path, file.path(folder, "s.rds"))
  withr::with_envvar(c(LC_ALL = "C", R_LIBS = paste(.libPaths(), collapse = ":")),
                     system2(file.path(R.home("bin"), "Rscript"), c("-e", shQuote(code))))
  study <- readRDS(file.path(folder, "s.rds"))
  expect_equal(study$title, "K\u00fche in der K\u00e4lte")
  expect_equal(study$measurements$unit, "\u00b0C")
  expect_equal(study$seed, 4)
  expect_equal(sum(study$measurements$use == "calibrate"), 180)
})

write_comparison_study <- function(folder, ...) {
  writeLines('offset <- free("offset", uniform(10, 30), "K")
    list(level = function_simulator(function(values, drivers) {
           values[["offset"]] + 0 * drivers[, "Te"] + 0.4 * values[["a"]] * drivers[, "Gv"]
         }, offset, free("a", uniform(0, 0.01)), boundary = c("Te", "Gv")),
         line = function_simulator(function(values, drivers) values[["offset"]] + values[["gain"]] * drivers[, "Te"],
                                   offset, free("gain", uniform(0, 1)), boundary = "Te"))', file.path(
                                     folder, "models.R"))
  writeLines('source("values.R", local = TRUE)$value', file.path(folder, "made.R"))
  writeLines(paste("data.frame(hour = 1:80, Te = 10 + 5 * sin(1:80 / 4), Gv = pmax(0, 300 * sin(1:80 / 5)),",
                   "Ti = 24 + 2 * sin(1:80 / 4) + with_seed(3, rnorm(80, 0, 0.1)))"), file.path(folder, "values.R"))
  write_study_file(folder, data = "made.R", models = "models.R", calibrate = "hour <= 60", validate = "hour > 60",
                   runs = 12,
                   control = list(calibration = list(ais = list(pilot_chains = 24, groups = 4, chains = 12,
                                                                importance_draws = 200))), ...,
                   drop = c("model", "catalogue"))
}

test_that("a comparison study writes its files with the agreed fields", {
  folder <- withr::local_tempdir()
  writeLines('list(simulator = source("models.R", local = TRUE)$value$line, values = c(offset = 20, gain = 0.4))',
             file.path(folder, "truth.R"))
  path <- write_comparison_study(folder, truth = "truth.R")
  out <- file.path(folder, "out")
  comparison <- run_study(path, out, quiet = TRUE, trust = TRUE)
  expect_s3_class(comparison, "amiss_comparison")
  expect_setequal(list.files(out), c("report.html", "figures", "result.rds", "result.json"))
  expect_setequal(list.files(file.path(out, "figures")), paste0(figures_of(comparison), ".png"))
  json <- jsonlite::read_json(file.path(out, "result.json"))
  expect_true(all(c("schema", "study", "seed", "wall_s", "method", "best", "models", "disagreements", "doubts",
                    "truth") %in% names(json)))
  expect_equal(json$best, "line")
  expect_equal(json$truth$values, list(offset = 20, gain = 0.4))
  model <- json$models[[2]]
  expect_true(all(c("log10_evidence", "log10_evidence_interval", "log10_bf", "against", "word", "probability",
                    "criteria", "parameters", "attribution") %in% names(model)))
  expect_true(all(c("aic", "bic", "lr", "rmse_validation", "k") %in% names(model$criteria)))
  expect_equal(vapply(model$attribution, `[[`, "", "boundary"), comparison$models$line$attribution$boundary)
  html <- paste(readLines(file.path(out, "report.html"), warn = FALSE), collapse = "\n")
  expect_match(html, "The record is decisively for line among 2 models", fixed = TRUE)
  links <- regmatches(html, gregexpr("(src|href)=\"[^\"]{0,20}", html))[[1]]
  expect_true(all(grepl("=\"(data:|#)", links)))
})

test_that("what lies in the folder is never removed, and old and new results do not mix", {
  folder <- withr::local_tempdir()
  path <- write_comparison_study(folder)
  out <- file.path(folder, "out")
  theirs <- file.path(out, c("probe", "stages/notes.txt", "stages/mine.rds", "figures/mine.png"))
  for (file in theirs) {
    dir.create(dirname(file), recursive = TRUE, showWarnings = FALSE)
    writeLines("theirs", file)
  }
  run_study(path, out, quiet = TRUE, trust = TRUE)
  for (file in theirs[1:3]) expect_equal(readLines(file), "theirs")
  expect_setequal(list.files(file.path(out, "stages")), c("notes.txt", "mine.rds"))
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

test_that("a folder is used by one run at a time", {
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

test_that("a study refused for its settings leaves nothing", {
  folder <- withr::local_tempdir()
  out <- file.path(folder, "out")
  dir.create(out)
  for (control in list(list(calibration = list(nonsense = 1)), list(attribution = list(nonsense = 1)),
                       list(emulator = list(nonsense = 1)))) {
    expect_error(run_study(write_study_file(folder, control = control), out, quiet = TRUE, trust = TRUE), "nonsense",
                 class = "amiss_error_input")
    expect_length(dir(out, all.files = TRUE, no.. = TRUE), 0)
  }
})

test_that("a bad comparison study is refused", {
  folder <- withr::local_tempdir()
  refuse <- function(pattern, ...) expect_error(read_study(write_comparison_study(folder, ...), trust = TRUE), pattern,
                                                class = "amiss_error_input")
  refuse("does not exist", models = "none.R")
  refuse("method", method = "guess")
  refuse("method", method = 3)
  expect_error(read_study(write_study_file(folder, truth = "model.R")), "models.*only", class = "amiss_error_input")
  expect_error(read_study(write_study_file(folder, drop = "catalogue")), "lacks field.*catalogue",
               class = "amiss_error_input")
  path <- write_comparison_study(folder)
  writeLines("list(a = 1)", file.path(folder, "models.R"))
  expect_error(read_study(path, trust = TRUE), "Model \"a\" is no simulator", class = "amiss_error_input")
  path <- write_comparison_study(folder)
  writeLines("1:3", file.path(folder, "made.R"))
  expect_error(read_study(path, trust = TRUE), "data", class = "amiss_error_input")
  both <- yaml::read_yaml(path)
  both$catalogue <- "catalogue.R"
  yaml::write_yaml(both, path)
  expect_error(read_study(path, trust = TRUE), "field.*catalogue.*which goes with", class = "amiss_error_input")
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
    if (name == "paper_synthetic")
      expect_equal(m$noise_sd^2, 0.01 * stats::var(m$raw$drivers[rows, "Ti_clean"]), tolerance = 0.01)
  }
})
