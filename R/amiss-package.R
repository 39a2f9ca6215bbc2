#' amiss: find what a simulation gets wrong, name the cause, measure the gain
#'
#' @description
#' The data take this path:
#'
#' 1. [measurements()] prepares the record. [zone()], [function_simulator()] and others make a
#'   simulator.
#' 2. [simulate_design()] makes an ensemble of runs; [ensemble()] takes runs made elsewhere.
#' 3. [train_emulator()], [calibrate()] and [attribute_discrepancy()] follow.
#'
#' Four functions do more at once:
#'
#' * [upgrade_model()] runs the whole loop with a [catalogue()] of [mechanism()]s.
#' * [compare_models()] compares several simulators.
#' * [report()] writes either down.
#' * [run_study()] does all of it from one file.
#'
#' @details
#' Words that choose something (`method = "history"`) and names of options and columns are
#' case-sensitive.
#'
#' # Progress
#'
#' Long work shows its progress and the time at which it will end. A terminal shows a line that
#' changes. Elsewhere (log files, batches) a line appears now and then. Tests and knitr documents
#' show nothing, nor do functions called with `quiet = TRUE`.
#'
#' Long work can be interrupted, and the session goes on. [upgrade_model()], [compare_models()] and
#' [run_study()] then go on from their `checkpoint` or folder.
#'
#' @section Options:
#'   * `amiss.progress`: `"bar"`, `"lines"` or `"none"` for progress as at a terminal, as in a log,
#'     or none, wherever the session runs.
#'   * `amiss.progress_interval`: least number of seconds between two such lines (30).
#'   * `amiss.allow_large`: `TRUE` lets work begin that is estimated to need more than a day or 4
#'     GB.
#'   * `amiss.font`: font of the figures.
#'
#' @section Conditions: Errors have the class `amiss_error` and one of these:
#'   * `amiss_error_input`: what was asked cannot be done as it was given. Special cases are
#'     `amiss_error_trust` (a study whose trust was not given), `amiss_error_edit` (a mechanism that
#'     cannot be applied) and `amiss_error_fmu` (an FMU that cannot be used).
#'   * `amiss_error_numerical`: the computation failed.
#'
#'   Warnings have the class `amiss_warning` and one of these:
#'   * `amiss_warning_input`.
#'   * `amiss_warning_result`. A special case is `amiss_warning_missing` (a file of a study's
#'     results that could not be made).
#'
#'   Messages have one of the classes `amiss_message_gap`, `amiss_message_time`,
#'   `amiss_message_kept`, `amiss_message_noise`, `amiss_message_base_case`, `amiss_message_file`,
#'   `amiss_message_lead` and `amiss_message_render`.
#'
#'   Numbers that cannot be trusted are not signalled as a condition: see `trust` and `check` of a
#'   calibration.
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
  on.exit(restore_generator(old))
  set.seed(as.integer(seed), kind = "Mersenne-Twister", normal.kind = "Inversion",
           sample.kind = "Rejection")
  expression
}

restore_generator <- function(seed) {
  if (!is.null(seed)) assign(".Random.seed", seed, envir = globalenv())
  else suppressWarnings(rm(list = ".Random.seed", envir = globalenv()))
}

# A process that can be stopped with all that it starts. processx takes the name of that tree from
# R's random numbers and the second. Processes of two sessions with one seed, or of one session that
# restores its generator, could have one name and be stopped together. So it gets its own numbers.
start_process <- function(...) {
  old <- globalenv()$.Random.seed
  on.exit(restore_generator(old))
  restore_generator(NULL)  # R then begins from the time and the number of the process
  processx::process$new(...)
}

# Stops what a process has started and left behind. processx knows it by its environment, and what
# is starting another program just now has none for a moment: two looks in succession must find
# nothing.
stop_tree <- function(process) {
  empty <- 0
  for (look in 1:100) {
    empty <- if (length(process$kill_tree())) 0 else empty + 1
    if (empty == 2) break
    Sys.sleep(0.005)
  }
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
