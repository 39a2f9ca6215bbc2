#' Calibrate with runs made elsewhere, in one call
#'
#' Calibrates on what was measured, the values that a simulator was run with, and its runs. It calls
#' [measurements()], [ensemble()], [train_emulator()] and [calibrate()], each with its defaults.
#' [report()] writes down what was found.
#'
#' @param data The [measurements()], or a data frame of one regular record, as [read_calibro()]
#'   gives it. All rows of a data frame calibrate. Its first column is the time, its second the
#'   measured target, and the others are boundary conditions.
#' @param design,runs Values of the parameters, one run a row, and the runs, one a column: `design`
#'   and `outputs` of [ensemble()].
#' @param parameters The [free()] parameters that the columns of `design` are, in a list. If not
#'   given, each gets a uniform prior over the range of its column.
#' @param noise_sd Standard deviation of the target's measurement error, if `data` is a data frame.
#'   If not given, it is estimated from second differences of the record (Gasser, Sroka and
#'   Jennen-Steinmetz 1986), which cancel a smooth course. The estimate is only a scale: the
#'   calibration hardly believes it (`confidence` of [calibrate()]).
#' @param control List of two lists, `emulator` and `calibration`, as [train_emulator()] and
#'   [calibrate()] take them.
#' @inheritParams calibrate
#' @return A calibration, as from [calibrate()].
#' @source Gasser, Sroka and Jennen-Steinmetz (1986), Residual variance and residual pattern in
#'   nonlinear regression, Biometrika 73, 625-633.
#' @examples
#' record <- data.frame(hour = 1:48, Ti = 0, Te = 5 + 3 * sin(1:48 / 4))
#' record$Ti <- 20 + 0.4 * record$Te + 0.1 * sin(61 * (1:48)^2)
#' gain <- seq(0, 1, 0.1)
#' fit <- amiss(record, cbind(gain), 20 + outer(record$Te, gain), seed = 1,
#'              control = list(calibration = list(ais = list(pilot_chains = 48, groups = 4))))
#' tidy(fit)
#' @export
amiss <- function(data, design, runs, parameters = NULL, noise_sd = NULL, control = NULL,
                  seed = NULL, threads = 1) {
  check_arguments()
  m <- if (inherits(data, "amiss_measurements")) {
    if (!is.null(noise_sd))
      abort_input("{.arg noise_sd} is part of the {.cls amiss_measurements} given.")
    data
  } else {
    record_measurements(data, noise_sd)
  }
  runs <- as_number_matrix(runs)
  check_input(checkmate::check_matrix(runs, "numeric"), "runs")
  made <- ensemble(design, runs, parameters, m)
  calibrate_refined(made, m, rounds = 0, control = control, seed = seed, threads = threads)
}

record_measurements <- function(data, noise_sd, call = rlang::caller_env()) {
  check_input(checkmate::check_data_frame(data, min.rows = 10, min.cols = 3), "data",
              "Its columns are time, target and boundary conditions; or give {.fun measurements}.",
              call = call)
  data <- plain_table(as.list(data), nrow(data))
  names <- names(data)
  if (is.null(noise_sd)) {
    require_numeric(data, names[2], call)
    time <- suppressMessages(read_time(data[[1]], names[1], call = call),
                             classes = "amiss_message_time")
    noise_sd <- difference_sd(time_hours(time), data[[2]])
    cli::cli_inform(c(paste("The noise of {.val {names[2]}} is taken as {signif(noise_sd, 3)},",
                            "from second differences."),
                      i = "Give {.arg noise_sd} where it is known."),
                    class = "amiss_message_noise")
  }
  measurements(data, time = names[1], target = names[2], boundary = names[-(1:2)],
               noise_sd = noise_sd)
}

# Of independent errors, y[i - 1] - 2 y[i] + y[i + 1] has six times their variance.
difference_sd <- function(hours, y) {
  step <- diff(hours)
  beside <- step < 1.5 * stats::median(step)
  whole <- beside[-1] & beside[-length(beside)]
  sqrt(mean(diff(y, differences = 2)[whole]^2, na.rm = TRUE) / 6)
}
