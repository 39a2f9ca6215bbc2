# What a user gave, held against what is asked for.

# The verdict of a checkmate::check_...() (TRUE or a sentence) turned into the package's own
# condition. The value that it checks, its first argument, is reported.
check_input <- function(verdict, name, hint = NULL, call = rlang::caller_env()) {
  force(call)
  check <- substitute(verdict)
  checks <- is.call(check) && is.call(check[[1]]) && identical(check[[1]][[2]], quote(checkmate))
  frame <- parent.frame()
  value <- if (checks) present(eval(check[[2]], frame), call, name, argument_code(name, call))
  if (checks && is.character(value)) check_readable(value, name, call)
  kind <- if (checks) as.character(check[[1]][[3]]) else ""
  if (isTRUE(verdict) && kind %in% number_checks)
    verdict <- plain_number(value, kind != "check_numeric")
  if (isTRUE(verdict)) return(invisible(TRUE))
  told <- if (checks) verdict_words(verdict, value, kind) else paste(" cannot be used:", verdict)
  if (is.null(hint) && is.function(value) && kind %in% text_checks)
    hint <- string_hint(argument_code(name, call))
  abort_input(c("{.arg {name}}{told}", if (!is.null(hint)) c(i = hint)), call = call)
}

# Text whose bytes are characters in its encoding.
check_readable <- function(text, name, call) {
  bad <- which(Encoding(text) == "bytes" | !validEnc(text))
  if (length(bad)) {
    abort_input(c(paste("{.arg {name}} cannot be used: {.val {one_line(text[bad[1]])}} holds bytes",
                        "that are no characters."),
                  i = "Say its encoding, as {.code iconv(x, \"latin1\", \"UTF-8\")} does."),
                call = call)
  }
}

# What the objects of the package are made of; another number, as an object read from a file may
# have, is refused.
format_version <- 3L

check_object <- function(x, classes, name, hint = NULL, call = rlang::caller_env()) {
  force(call)
  check_input(checkmate::check_multi_class(x, classes), name, hint, call)
  check_whole(x, name, hint, call)
}

# What reads an object of the package begins with this: its format is this version's, and none of
# its parts is missing or damaged.
check_whole <- function(x, name, hint = NULL, call = rlang::caller_env()) {
  version <- if (is.list(x)) unclass(x)[["format_version"]]
  if (!is.null(version) && !identical(version, format_version)) {
    told <- if (is.numeric(version) && length(version) == 1) format(version) else seen(version)
    abort_input(c("{.arg {name}} was made by another version of the package.",
                  x = "Its format is {told}; this version reads {.val {format_version}}.",
                  i = "Make it again with this version."),
                class = "amiss_error_version", call = call)
  }
  fault <- object_fault(x)
  if (is.null(fault)) return(invisible(TRUE))
  wrong <- if (!is.null(fault$absent)) "it has no {.field {fault$absent}}."
           else paste("its part {.field {fault$part}} is {seen(fault$value)}, and not",
                      "{kind_words(fault$expected)} of the size that goes with the other parts.")
  abort_input(c(paste("{.arg {name}} has the class {.cls {class(x)}}, but is not whole:", wrong),
                i = hint %||% "Make it with the package's own function."), call = call)
}

# Each run checks its simulator, and a search makes hundreds of runs of one: the object that passed
# last passes again, as long as it is the same.
checked <- new.env(parent = emptyenv())

was_checked <- function(x, check) !is.null(x) && identical(x, checked[[check]])

note_checked <- function(x, check) assign(check, x, checked)

# For checkmate dates, times, numbers with a unit or in other bits (integer64) and empty texts are
# numbers, too.
number_checks <- paste0("check_", c("number", "count", "int", "numeric"))

text_checks <- paste0("check_", c("string", "character", "choice"))

plain_number <- function(x, single) {
  if (single && !is.null(dim(x))) return("Must be a plain number, not an array")
  if (!is.character(x) && !is.object(x)) return(TRUE)
  sprintf("Must be a plain number, not of class '%s'", class(x)[1])
}

# Options travel as one list: defaults overwritten by what the user names; an unknown name is an
# error.
merge_control <- function(defaults, control, what = "control", known = names(defaults),
                          call = rlang::caller_env()) {
  check_input(checkmate::check_list(control, null.ok = TRUE), what, "Give a list of named options.",
              call = call)
  check_option_names(control, known, what, call)
  defaults[names(control)] <- control
  defaults
}

check_option_names <- function(control, known, what, call) {
  names <- rlang::names2(control)
  if (any(names == "")) {
    abort_input(c(paste("Every option in {.arg {what}} needs its name; number",
                        "{which(names == '')[1]} has none."), i = "Known options: {.val {known}}."),
                call = call)
  }
  unknown <- setdiff(names, known)
  if (length(unknown)) {
    abort_input(c("{.arg {what}} has {cli::qty(unknown)} unknown option{?s}: {.val {unknown}}.",
                  i = "Known options: {.val {known}}."), call = call)
  }
  twice <- names[duplicated(names)]
  if (length(twice))
    abort_input("{.arg {what}} has the option {.val {twice[1]}} twice.", call = call)
}
