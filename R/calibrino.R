# The command line of exec/calibrino: Calibro's command, as ESP-r calls it. Exit status: 0 done, 1
# failed, 2 bad usage.

calibrino_formats <- c("json", "html", "pdf")
calibrino_results <- c("cal", "sa", "train", "ds")

calibrino_parser <- function() {
  option <- function(flags, help, ...) optparse::make_option(flags, help = help, ...)
  optparse::OptionParser(
    usage = "usage: calibrino -c NAME -b bc.csv -i inputs.csv -o obs.csv -s sims.csv [options]",
    add_help_option = FALSE, option_list = list(
      option(c("-c", "--cal"), "name of the calibration", metavar = "NAME"),
      option(c("-b", "--bc"), "boundary conditions, one a column", metavar = "FILE"),
      option(c("-i", "--input"), "values of the parameters, one run a row", metavar = "FILE"),
      option(c("-o", "--obs"), "what was measured, one column", metavar = "FILE"),
      option(c("-s", "--sim"), "the runs, one a column", metavar = "FILE"),
      option("--fmt", "what calibro_report is written as (json): some of json,html,pdf",
             default = "json", metavar = "LIST"),
      option("--res", paste("what calibro_report.json holds (all): some of cal,sa,train,ds",
                            "(calibration, sensitivity, training of the emulator, data set)"),
             default = paste(calibrino_results, collapse = ","), metavar = "LIST"),
      option("--noise", paste("standard deviation of the measurement error; by second differences",
                              "of the record if not given"), metavar = "SD"),
      option("--step", "hours between rows (1)", default = "1", metavar = "HOURS"),
      option("--threads", "threads to use (1); results do not depend on it", default = "1",
             metavar = "N"),
      option("--seed", "seed of the random numbers", metavar = "N"),
      option(c("-h", "--help"), "this text, and nothing else", action = "store_true",
             default = FALSE)),
    description = paste("\nCalibrates a simulator by runs of it and writes calibro_report.json",
                        "into the working directory."))
}

run_calibrino <- function(words) {
  parser <- calibrino_parser()
  help <- utils::capture.output(optparse::print_help(parser))
  asked <- tryCatch(read_calibrino(words, parser), error = identity)
  if (inherits(asked, "error")) {
    message(paste(c(paste("calibrino:", conditionMessage(asked)), help), collapse = "\n"))
    return(2)
  }
  if (asked$help) {
    writeLines(help)
    return(0)
  }
  failed <- function(e) list(error = cli::ansi_strip(conditionMessage(e)))
  asked_for <- function(format) format %in% asked$fmt
  # ESP-r copies what it finds: a report of an earlier call must not pass for this one's.
  unlink(paste0("calibro_report.", calibrino_formats))
  results <- tryCatch({
    fit <- calibrino_fit(asked)
    if (asked_for("json")) calibro_results(fit, asked)
  }, error = failed)
  if (asked_for("json")) write_calibro_json(results)
  if (is.null(results[["error"]])) {
    results <- tryCatch({
      for (format in setdiff(asked$fmt, "json")) report(fit, paste0("calibro_report.", format))
      print(fit)
      NULL
    }, error = failed)
  }
  if (is.null(results[["error"]])) return(0)
  message("calibrino: ", results[["error"]])
  1
}

# What is asked for; an error says what is wrong with the usage.
read_calibrino <- function(words, parser) {
  parsed <- optparse::parse_args(parser, words, print_help_and_exit = FALSE,
                                 positional_arguments = TRUE)
  asked <- parsed$options
  if (asked$help) return(asked)
  if (length(parsed$args)) stop("'", parsed$args[1], "' belongs to no option")
  for (name in c("cal", "bc", "input", "obs", "sim"))
    if (is.null(asked[[name]])) stop("'--", name, "' is needed")
  between_commas <- function(text) trimws(strsplit(text, ",", fixed = TRUE)[[1]])
  asked[c("obs", "sim")] <- lapply(asked[c("obs", "sim")], between_commas)
  if (length(asked$obs) != length(asked$sim)) {
    stop("'--obs' names ", length(asked$obs), " files and '--sim' ", length(asked$sim),
         "; each record needs its runs")
  }
  known <- list(fmt = calibrino_formats, res = calibrino_results)
  for (name in names(known)) {
    asked[[name]] <- between_commas(asked[[name]])
    unknown <- setdiff(asked[[name]], known[[name]])
    if (length(unknown))
      stop("'--", name, "' does not know '", unknown[1], "'; it knows ", listed(known[[name]]))
  }
  asked$threads <- whole_number(asked$threads, "threads", 1, 1024)
  asked$step <- positive_number(asked$step, "step")
  if (!is.null(asked$noise)) asked$noise <- positive_number(asked$noise, "noise")
  if (!is.null(asked$seed)) asked$seed <- whole_number(asked$seed, "seed", 0, .Machine$integer.max)
  asked
}

positive_number <- function(text, option) {
  number <- suppressWarnings(as.numeric(text))
  if (!isTRUE(is.finite(number) && number > 0))
    stop("'--", option, "' needs a positive number, not '", text, "'")
  number
}

calibrino_fit <- function(asked) {
  if (length(asked$obs) > 1) {
    abort_input(c("{length(asked$obs)} records are given; one is calibrated at a time.",
                  i = "Call calibrino once for each of {.file {asked$obs}}, with its own runs."),
                call = NULL)
  }
  files <- read_calibro(".", step_h = asked$step,
                        files = list(obs = asked$obs, bc = asked$bc, inputs = asked$input,
                                     sims = asked$sim))
  record <- as.character(fs::path_ext_remove(basename(asked$obs)))
  if (!record %in% names(files$data)) names(files$data)[2] <- record
  amiss(files$data, files$design, files$outputs, noise_sd = asked$noise, seed = asked$seed,
        threads = asked$threads)
}

# What calibro_report.json holds. ESP-r reads it by lines and by the tags in capitals and
# theta.stats: a tag that begins with CALIBRO stands before all parameters, and parameters before
# goodness of fit; no other tag may begin with one of theirs, or with "error", which says that there
# are no results.
calibro_results <- function(fit, asked) {
  parts <- list(cal = calibration_results, sa = sensitivity_results, train = training_results,
                ds = data_results)
  sections <- lapply(unname(parts[intersect(names(parts), asked$res)]),
                     function(section) section(fit))
  c(list(CALIBRO = asked$cal, program = paste("amiss", utils::packageVersion("amiss")),
         seed = fit$seed),
    do.call(c, sections))
}

calibration_results <- function(fit) {
  table <- parameter_table(fit)
  m <- fit$measurements
  rmse <- function(simulated) sqrt(mean((m$y[fit$rows] - simulated)^2))
  statistics <- data.frame(PARAMETER = esp_name(table$name), ESTIMATE = table$median,
                           LOWER = table$lower95, UPPER = table$upper95)
  fitness <- data.frame(DATASET = m$target, BEFORE = rmse(uncalibrated(fit)),
                        AFTER = rmse(stats::fitted(fit)))
  list(CALIBRATION_RESULTS = list(theta.stats = statistics,
                                  log10_evidence = fit$log_evidence / log(10),
                                  trusted = fit$trust$trusted, verdict = fit$trust$verdict),
       CALIBRATED_MODEL_GOF = fitness)
}

# ESP-r writes "what:where" and reads "what.where".
esp_name <- function(name) sub(":", ".", name, fixed = TRUE)

# The base case, where the runs hold it; otherwise the simulation at the medians of the priors, by
# the emulator.
uncalibrated <- function(fit) {
  given <- fit$emulator$given
  base <- which(rowSums(given$values != 0) == 0)
  if (length(base)) return(given$outputs[, base[1]])
  parameters <- fit$emulator$parameters
  stats::predict(fit$emulator,
                 unit_to_values(matrix(0.5, 1, length(parameters)), parameters))$mean[, 1]
}

sensitivity_results <- function(fit) {
  indices <- sobol_indices(fit, seed = fit$seed)
  columns <- c("parameter", "first", "first_sampling", "first_emulator", "total", "total_sampling",
               "total_emulator")
  table <- indices$table[columns]
  table$parameter <- esp_name(table$parameter)
  list(SENSITIVITY_ANALYSIS = list(sobol = table, unexplained = indices$unexplained))
}

training_results <- function(fit) {
  emulator <- fit$emulator
  diagnostics <- emulator$diagnostics
  list(TRAINING = list(runs = nrow(emulator$processes$inputs),
                       vectors = ncol(emulator$basis$vectors), explained = emulator$basis$explained,
                       left_out_rmse = diagnostics$series_rmse, left_out_r2 = diagnostics$series_r2,
                       left_out_coverage95 = diagnostics$series_coverage95,
                       trusted = emulator$trust$trusted, verdict = emulator$trust$verdict))
}

data_results <- function(fit) {
  m <- fit$measurements
  list(DATA = list(record = m$target, steps = length(m$y), step_h = m$step_h, noise_sd = m$noise_sd,
                   boundary = I(m$conditions),
                   inputs = I(esp_name(names(fit$emulator$parameters)))))
}

# One tag a line, as ESP-r reads it.
write_calibro_json <- function(results, file = "calibro_report.json") {
  jsonlite::write_json(results, file, pretty = TRUE, auto_unbox = TRUE, digits = I(15))
}
