# Classed conditions. A message says what was wrong, where, the value seen and what to do; cli
# markup is interpolated in the caller's frame.

abort_input <- function(message, call = rlang::caller_env(), class = character(),
                        .envir = parent.frame()) {
  cli::cli_abort(message, class = c(class, "amiss_error_input", "amiss_error"),
                 call = short_call(call), .envir = .envir)
}

abort_numerical <- function(message, call = rlang::caller_env(), .envir = parent.frame()) {
  cli::cli_abort(message, class = c("amiss_error_numerical", "amiss_error"),
                 call = short_call(call), .envir = .envir)
}

# The call as name(): without its arguments, which do.call() would print fully. A method has the
# name of its generic, which is what was called.
short_call <- function(call) {
  generic <- if (is.environment(call)) call[[".Generic"]]
  if (is.environment(call)) call <- rlang::frame_call(call)
  name <- generic %||% if (is.call(call)) rlang::call_name(call)
  if (is.null(name)) NULL else rlang::call2(name)
}

warn_input <- function(message, .envir = parent.frame()) {
  cli::cli_warn(message, class = c("amiss_warning_input", "amiss_warning"), .envir = .envir)
}

warn_result <- function(message, class = character(), .envir = parent.frame()) {
  cli::cli_warn(message, class = c(class, "amiss_warning_result", "amiss_warning"), .envir = .envir)
}

# " = value", or nothing for what a few words cannot say.
value_words <- function(x) {
  if (is.null(x) || is.atomic(x) && !is.object(x) && is.null(dim(x)) && length(x) <= 5)
    paste0(" = ", seen(x))
  else ""
}

# A value in a few words, whatever it is.
seen <- function(x) {
  if (is.null(x) || is.atomic(x) && !is.object(x) && length(x) <= 5) {
    return(substr(deparse1(as.vector(unname(x)), control = "keepNA"), 1, 60))
  }
  if (is.factor(x) && length(x) == 1) return(paste("the factor", dQuote(x, FALSE)))
  paste0("<", class(x)[1], if (is.vector(x)) paste(" of length", length(x)), ">")
}
