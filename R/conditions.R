# Classed conditions. A message says what was wrong, where, the value seen and what to do; cli markup is
# interpolated in the caller's frame.

abort_input <- function(message, call = rlang::caller_env(), .envir = parent.frame()) {
  cli::cli_abort(message, class = c("amiss_error_input", "amiss_error"), call = short_call(call), .envir = .envir)
}

abort_numerical <- function(message, call = rlang::caller_env(), .envir = parent.frame()) {
  cli::cli_abort(message, class = c("amiss_error_numerical", "amiss_error"), call = short_call(call), .envir = .envir)
}

# The call as name(): without its arguments, which do.call() would print in full.
short_call <- function(call) {
  if (is.environment(call)) call <- rlang::frame_call(call)
  name <- if (is.call(call)) rlang::call_name(call)
  if (is.null(name)) NULL else rlang::call2(name)
}

warn_input <- function(message, .envir = parent.frame()) {
  cli::cli_warn(message, class = c("amiss_warning_input", "amiss_warning"), .envir = .envir)
}

warn_result <- function(message, .envir = parent.frame()) {
  cli::cli_warn(message, class = c("amiss_warning_result", "amiss_warning"), .envir = .envir)
}

# checkmate's verdict (TRUE or a sentence) turned into the package's own condition.
check_input <- function(verdict, name, hint = NULL, call = rlang::caller_env()) {
  if (isTRUE(verdict)) return(invisible(TRUE))
  abort_input(c("{.arg {name}} cannot be used: {verdict}", if (!is.null(hint)) c(i = hint)), call = call)
}

# Options travel as one list: defaults overwritten by what the user names; an unknown name is an error.
merge_control <- function(defaults, control, what = "control", known = names(defaults), call = rlang::caller_env()) {
  if (is.null(control)) control <- list()
  check_input(checkmate::check_list(control), what, call = call)
  unknown <- setdiff(names(control), known)
  if (length(control) > 0 && (is.null(names(control)) || any(names(control) == "") || length(unknown) > 0)) {
    abort_input(c("{.arg {what}} has {cli::qty(unknown)} unknown option{?s}: {.val {unknown}}.",
                  i = "Known options: {.val {known}}."), call = call)
  }
  defaults[names(control)] <- control
  defaults
}
