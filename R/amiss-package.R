#' amiss: find what a simulation gets wrong, name the cause, measure the gain
#'
#' The way the data goes: [measurements()] and a simulator ([zone()], [function_simulator()]) give
#' an ensemble ([simulate_design()], or [ensemble()] for runs made elsewhere); [train_emulator()],
#' [calibrate()], [attribute_discrepancy()] follow. [upgrade_model()] runs the whole loop with a
#' [catalogue()] of [mechanism()]s, [compare_models()] sets several simulators against each other,
#' [report()] writes either down, and [run_study()] does all of it from one file.
#'
#' Long work shows how far it is and what time it will take: at a terminal in a line that changes,
#' elsewhere (log files, batches) in a line now and then, in tests and knitr documents not at all.
#' It is silent in functions called with `quiet = TRUE`. It can be interrupted: the session goes on,
#' and [upgrade_model()], [compare_models()] and [run_study()] go on from their `checkpoint` or
#' folder.
#'
#' Words that choose something (`method = "history"`) and names of options and columns are
#' case-sensitive.
#'
#' @section Options:
#' * `amiss.progress`: `"bar"`, `"lines"` or `"none"` for progress as at a terminal, as in a log, or
#'   none, wherever the session runs.
#' * `amiss.progress_interval`: least number of seconds between two such lines (30).
#' * `amiss.allow_large`: `TRUE` lets work begin that is estimated to need more than a day or 4 GB.
#' * `amiss.font`: font of the figures.
#'
#' @section Conditions: Errors have the class `amiss_error` and one of `amiss_error_input` (what was
#'   asked cannot be done as it was given; also `amiss_error_trust`, a study whose trust was not
#'   given, `amiss_error_edit`, a mechanism that cannot be applied, and `amiss_error_fmu`, an FMU
#'   that cannot be used) or `amiss_error_numerical` (the computation failed). Warnings have
#'   `amiss_warning` and one of `amiss_warning_input` or `amiss_warning_result` (also
#'   `amiss_warning_missing`, a file of a study's results that could not be made); messages
#'   `amiss_message_gap`, `_time`, `_kept`, `_noise` and `_base_case`. That numbers are not to be
#'   trusted is no condition: see `trust` and `check` of a calibration.
#'
#' @useDynLib amiss, .registration = TRUE
#' @importFrom Rcpp evalCpp
#' @importFrom rlang %||% .data
#' @importFrom stats coef confint fitted logLik nobs predict residuals simulate update vcov
#' @importFrom generics tidy glance augment
#' @importFrom ggplot2 autoplot
#' @aliases amiss-package
#' @keywords internal
"_PACKAGE"

#' @export
generics::tidy

#' @export
generics::glance

#' @export
generics::augment

# A seed given by the user, or one drawn from R's generator, so that set.seed() governs.
pick_seed <- function(seed, call = rlang::caller_env()) {
  if (is.null(seed)) return(sample.int(.Machine$integer.max, 1))
  check_seed(seed, "seed", call)
}

# Whole, so that no two seeds are one; R's generator takes none above the largest integer.
check_seed <- function(seed, name, call = rlang::caller_env()) {
  check_input(checkmate::check_int(seed, lower = 0, upper = .Machine$integer.max), name,
              "A seed is a whole number from 0 to 2147483647.", call = call)
  as.numeric(seed)
}

# Evaluates an expression under a seed of its own and leaves R's generator as it was.
with_seed <- function(seed, expression) {
  old <- globalenv()$.Random.seed
  on.exit(if (is.null(old)) rm(list = ".Random.seed", envir = globalenv())
          else assign(".Random.seed", old, envir = globalenv()))
  set.seed(as.integer(seed), kind = "Mersenne-Twister", normal.kind = "Inversion",
           sample.kind = "Rejection")
  expression
}

check_threads <- function(threads, call = rlang::caller_env()) {
  check_input(checkmate::check_int(threads, lower = 1, upper = 1024), "threads", call = call)
  as.integer(threads)
}

engine_context <- function(seed, threads) list(seed = seed, threads = threads)

# The engine's own exceptions become the package's conditions.
call_engine <- function(expression, call = rlang::caller_env()) {
  tryCatch(expression, `C++Error` = function(e) {
    numerical <- inherits(e, "std::runtime_error")
    (if (numerical) abort_numerical else abort_input)(
      "The computation stopped: {conditionMessage(e)}.", call = call)
  })
}

#' @export
ggplot2::autoplot
