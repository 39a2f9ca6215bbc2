# The arguments of the function that the user called: which is missing, and which names an object
# that is not there, as a string without its quotes does.

# Begins an exported function: all that was given is evaluated, in the order of the arguments.
# An argument may have the name of a function of R, as `missing` has.
check_arguments <- function(call = rlang::caller_env()) {
  force(call)
  arguments <- formals(rlang::frame_fn(call))
  for (name in names(arguments)) {
    if (name == "...") check_dots(call)
    else if (!eval(rlang::call2(missing, as.name(name)), call))
      present(get(name, call), call, name, argument_code(name, call))
    else if (rlang::is_missing(arguments[[name]])) abort_missing(name, call)
  }
}

check_dots <- function(call) {
  code <- as.list(eval(quote(substitute(list(...))), call))[-1]
  names <- rlang::names2(code)
  for (k in seq_along(code)) {
    present(eval(rlang::call2("...elt", k), call), call, if (nzchar(names[k])) names[k] else "...",
            code[[k]])
  }
}

# The argument of a function's frame as it was written.
argument_code <- function(name, frame) {
  if (is.environment(frame) && name %in% names(formals(rlang::frame_fn(frame))))
    eval(rlang::call2(substitute, as.name(name)), frame)
}

# The value of the argument `name`, which was written as `code`.
present <- function(value, call = rlang::caller_env(), name = NULL, code = NULL) {
  force(call)
  withCallingHandlers(value, error = function(e) {
    absent <- absent_of(e, "argument \"%s\" is missing, with no default")
    if (!is.null(absent)) abort_missing(absent, call)
    absent <- absent_of(e, "object '%s' not found")
    if (!is.null(absent) && !is.null(name)) abort_not_found(absent, name, code, call)
  })
}

abort_missing <- function(name, call)
  abort_input("{.arg {name}} is missing: it has no default.", call = call)

abort_not_found <- function(absent, name, code, call) {
  written <- absent %in% all.names(code)
  by <- if (!is.null(code) && !written) paste0(", which `", seen_code(code), "` needs")
  abort_input(c("{.arg {name}}: there is no object {.code {absent}}{by}.",
                i = if (written) string_hint(if (compares(code)) code else as.name(absent)),
                i = if (written) "If not, make the object first."),
              call = call)
}

# For `code` that stands where a string should.
string_hint <- function(code)
  if (is.symbol(code) || compares(code))
    paste0("Did you mean the string \"", gsub("([{}])", "\\1\\1", seen_code(code)), "\"?")

# Rows are chosen by comparisons, which may be given as one string.
compares <- function(code)
  rlang::is_call(code, c("<", "<=", ">", ">=", "==", "!=", "&", "|", "!", "%in%"))

seen_code <- function(code) substr(paste(deparse(code, backtick = FALSE), collapse = " "), 1, 60)

# What R's own error says is not there. These errors have no class, at least before version 4.3, and
# are in the session's language; NULL of any other.
absent_of <- function(e, message) {
  words <- strsplit(gettext(message, domain = "R"), "%s", fixed = TRUE)[[1]]
  said <- conditionMessage(e)
  if (startsWith(said, words[1]) && endsWith(said, words[2]))
    substr(said, nchar(words[1]) + 1, nchar(said) - nchar(words[2]))
}
