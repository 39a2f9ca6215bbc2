# Several outputs of one function, each a simulator; a run is made once for all.

#' Outputs of one simulator
#'
#' Makes one simulator for each output of a simulator whose function returns several series in one
#' run ([calibrate_jointly()]). The simulators share their runs. For the same values, drivers and,
#' if the function takes it, `info`, the function is called only once. Runs are kept as long as
#' the session lasts, or until the memory of runs holds ten million numbers.
#'
#' @param simulator A [function_simulator()] whose function returns a matrix with named columns, or
#'   a data frame.
#' @param outputs Names of the columns.
#' @return A named list of simulators.
#' @section Errors: A run that lacks a column stops as a run that fails does.
#' @examples
#' wall <- function_simulator(function(values, drivers) {
#'   warmed <- values[["gain"]] * drivers[, "Te"]
#'   cbind(Ti = 20 + warmed, flux = 3 - 5 * warmed)
#' }, free("gain", uniform(0, 1)), boundary = "Te")
#' outputs_of(wall, c("Ti", "flux"))
#' @export
outputs_of <- function(simulator, outputs) {
  check_arguments()
  check_object(simulator, "amiss_function_simulator", "simulator")
  check_input(checkmate::check_character(outputs, min.len = 1, any.missing = FALSE, unique = TRUE),
              "outputs")
  recall <- run_memory(simulator$f)
  lapply(stats::setNames(nm = outputs), function(output) {
    one <- simulator
    one$name <- paste0(simulator$name, ", ", output)
    one$f <- function(values, drivers, info) {
      run <- as.matrix(plain_numbers(recall(values, drivers, info)))
      if (!output %in% colnames(run)) {
        stop("it returned the columns ", paste(colnames(run), collapse = ", "), ", not ", output,
             call. = FALSE)
      }
      unname(run[, output])
    }
    one
  })
}

most_remembered <- 1e7  # numbers

# `f`, called once for the same arguments.
run_memory <- function(f) {
  kept <- new.env(parent = emptyenv())
  size <- 0
  function(values, drivers, info) {
    asks <- "info" %in% names(formals(args(f)))
    key <- rlang::hash(list(values, drivers, if (asks) info))
    if (is.null(kept[[key]])) {
      run <- call_run_function(f, values, drivers, info = info)
      if (size + length(run) > most_remembered) {
        rm(list = ls(kept), envir = kept)
        size <<- 0
      }
      size <<- size + length(run)
      kept[[key]] <- run
    }
    kept[[key]]
  }
}
