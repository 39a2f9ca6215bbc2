# What stands in double braces in templates, arguments and inputs: a parameter, or arithmetic of
# parameters, and how its number is written: {{k}}, {{k:%.4f}}, {{2 * k + C / 1000:%10.3e}},
# {{k:12}} (in at most 12 characters).

placeholder <- "\\{\\{\\s*([^{}]*?)\\s*\\}\\}"

# What may be called, with the least and the largest number of arguments. Nothing else is evaluated.
arithmetic <- list("+" = c(1, 2), "-" = c(1, 2), "*" = c(2, 2), "/" = c(2, 2), "^" = c(2, 2),
                   "(" = c(1, 1), sqrt = c(1, 1), exp = c(1, 1), log = c(1, 1), log10 = c(1, 1),
                   abs = c(1, 1), round = c(1, 2), min = c(1, Inf), max = c(1, Inf))

# The placeholders of a text, each once, as they stand there. Byte by byte: templates may be in any
# encoding.
placeholder_texts <- function(text) {
  if (is.raw(text)) return(character())
  text <- text[grepl("{{", text, fixed = TRUE, useBytes = TRUE)]
  found <- as.character(
    unlist(regmatches(text, gregexpr(placeholder, text, perl = TRUE, useBytes = TRUE))))
  Encoding(found) <- "UTF-8"
  unique(found)
}

# list(text, call, format): the placeholder as it stands, a name or a call, and how its number is
# written: NULL, a format of sprintf() or a number of characters. An error says what is wrong with
# it.
read_placeholder <- function(text, known) {
  inside <- sub(placeholder, "\\1", text, perl = TRUE)
  if (inside %in% known) return(list(text = text, call = as.name(inside)))
  parts <- regmatches(inside, regexec("^(.*?)\\s*:\\s*(%[^:]*|[0-9]+)$", inside, perl = TRUE))[[1]]
  expression <- if (length(parts)) parts[2] else inside
  list(text = text, call = read_arithmetic(expression, known),
       format = if (length(parts)) read_number_format(parts[3]))
}

read_arithmetic <- function(expression, known) {
  if (expression %in% known) return(as.name(expression))
  call <- if (nchar(expression) <= 1000) tryCatch(str2lang(expression), error = function(e) NULL)
  if (is.null(call)) stop("which is no parameter and no arithmetic of parameters")
  check_arithmetic(call, known)
  call
}

# Numbers, parameters and calls of `arithmetic` alone.
check_arithmetic <- function(call, known) {
  if (is.numeric(call)) return(invisible())
  if (is.name(call)) {
    if (as.character(call) %in% known) return(invisible())
    stop("which is no parameter: ", as.character(call), " is none")
  }
  name <- if (is.call(call) && is.name(call[[1]])) as.character(call[[1]]) else ""
  count <- arithmetic[[name, exact = TRUE]]
  if (is.null(count)) {
    stop("which is no arithmetic of parameters: ", one_line(deparse1(call)),
         " is not evaluated; known are + - * / ^ ", "( ) sqrt exp log log10 abs round min max")
  }
  arguments <- as.list(call)[-1]
  missed <- any(vapply(arguments, rlang::is_missing, NA))
  if (missed || length(arguments) < count[1] || length(arguments) > count[2] ||
      !is.null(names(arguments))) {
    stop("which is no arithmetic of parameters: ", one_line(deparse1(call)),
         " has not the arguments of ", name)
  }
  for (argument in arguments) check_arithmetic(argument, known)
}

# The value of what check_arithmetic() has let through.
evaluate_arithmetic <- function(call, values) {
  if (is.name(call)) return(values[[as.character(call)]])
  if (!is.call(call)) return(call)
  f <- get(as.character(call[[1]]), envir = baseenv(), mode = "function")
  suppressWarnings(do.call(f, lapply(as.list(call)[-1], evaluate_arithmetic, values = values)))
}

read_number_format <- function(text) {
  if (!startsWith(text, "%")) {
    if (as.numeric(text) >= 1 && as.numeric(text) <= 100) return(as.integer(text))
  } else if (grepl("^%[-+ 0#]*[0-9]{0,2}([.][0-9]{1,2})?[eEfgGdi]$", text)) {
    return(text)
  }
  stop("whose format ", text,
       " is not known: write one of sprintf() for a number, such as %.4f, %10.3e or %d, or the ",
       "most characters that it may have, such as 12")
}

# ---- numbers as text

# As short as carries 15 significant digits; exponents without zeros in front.
shortest_number <- function(x, digits = 15)
  sub("e([+-])0+", "e\\1", sub("e[+]0*", "e", sprintf("%.*g", digits, x)))

# A number in a format, or in at most `width` characters. An error says why that cannot be.
number_text <- function(x, format = NULL, width = NULL) {
  if (is.numeric(format)) return(fitted_number(x, format))
  if (is.null(format)) return(if (is.null(width)) shortest_number(x) else fitted_number(x, width))
  if (grepl("[di]$", format)) {
    if (x != round(x) || abs(x) > 2^31 - 1)
      stop("it is no whole number, as ", format, " needs one; use round()")
    text <- sprintf(format, as.integer(x))
  } else {
    text <- sprintf(format, x)
  }
  most <- min(width, number_width(format))
  if (nchar(text) > most)
    stop("written by ", format, " it is ", text, ", longer than ", most, " characters")
  back <- suppressWarnings(as.numeric(text))
  if (is.na(back) || abs(back - x) > format_error(x, format)) {
    stop("written by ", format, " it is ", text, ", which does not read back")
  }
  text
}

least_digits <- 6  # of a number that is shortened to a width

fitted_number <- function(x, width) {
  for (digits in 15:1) {
    text <- shortest_number(x, digits)
    if (nchar(text) > width) next
    if (digits >= least_digits || as.numeric(text) == x) return(text)
  }
  stop(least_digits, " digits of it do not fit in ", width, " characters")
}

# The width that a format states: a number that needs more would run into its neighbour.
number_width <- function(format) {
  width <- sub("^%[-+ 0#]*([0-9]*).*$", "\\1", format)
  if (nzchar(width)) as.integer(width) else Inf
}

# Half a unit of the last digit that a format writes.
format_error <- function(x, format) {
  kind <- sub("^.*(.)$", "\\1", format)
  if (kind %in% c("d", "i")) return(0)
  digits <- if (grepl(".", format, fixed = TRUE)) as.integer(sub("^.*[.]([0-9]+).$", "\\1", format))
            else 6L
  if (kind == "f") return(0.5 * 10^-digits + 1e-15 * abs(x))
  if (kind %in% c("g", "G")) digits <- max(digits, 1) - 1
  0.5 * 10^(floor(log10(max(abs(x), .Machine$double.xmin))) - digits + 1e-6) + 1e-15 * abs(x)
}

# ---- templates filled in

# The placeholders of several texts, read once for many runs: list(text, slots) each.
compile_texts <- function(texts, known) {
  lapply(texts, function(text) list(
    text = text, slots = lapply(placeholder_texts(text), read_placeholder, known)))
}

# The text with its numbers, byte by byte. What cannot be written is refused before a run begins.
fill_text <- function(compiled, values, width, place, call = rlang::caller_env()) {
  text <- compiled$text
  for (slot in compiled$slots) {
    with <- slot_text(slot, values, width, place, call)
    text <- gsub(enc2utf8(slot$text), with, text, fixed = TRUE, useBytes = TRUE)
  }
  if (is.character(text)) Encoding(text[Encoding(text) == "bytes"]) <- "unknown"
  text
}

slot_text <- function(slot, values, width, place, call) {
  value <- evaluate_arithmetic(slot$call, values)
  text <- if (is.finite(value)) tryCatch(number_text(value, slot$format, width), error = identity)
  if (is.character(text)) return(text)
  why <- if (is.null(text)) paste0("it is ", value) else conditionMessage(text)
  abort_input(c("{.val {slot$text}} in {place} cannot be written at {point_words(values)}.",
                x = "Its value is {signif(value, 8)}; {why}.",
                i = paste("Widen its format, as in {.val {{{{k:%12.5e}}}}}, or narrow the priors",
                          "of its parameters.")), call = call)
}

# Each placeholder of `places` is arithmetic of parameters that can be written, and each parameter
# stands in one.
check_placeholders <- function(places, parameters, width = NULL, call = rlang::caller_env()) {
  known <- names(parameters)
  used <- character()
  for (place in names(places)) for (text in placeholder_texts(places[[place]])) {
    slot <- tryCatch(read_placeholder(text, known), error = function(e) {
      inside <- sub(placeholder, "\\1", text, perl = TRUE)
      abort_input(
        c("Template {.val {place}} holds the placeholder {.val {inside}}, {conditionMessage(e)}.",
          i = "Parameters: {.val {known}}; declare it with {.fun free} or correct the template."),
        call = call)
    })
    used <- c(used, all.vars(slot$call))
    check_written(slot, parameters, width, paste("template", place), call)
  }
  idle <- setdiff(known, used)
  if (!length(idle)) return(invisible())
  abort_input(
    c("Parameter {.val {idle[1]}} stands in no template and in no argument of the command.",
      i = paste("Write {.code {paste0('{{', idle[1], '}}')}} where its value belongs. Templates:",
                "{.val {names(places)}}.")), call = call)
}

# Tried at the middle of the priors, and where it is a number at their ends.
check_written <- function(slot, parameters, width, place, call) {
  at <- function(u) vapply(parameters, function(parameter) prior_quantile(parameter$prior, u), 0)
  slot_text(slot, at(0.5), width, place, call)
  for (u in c(0.001, 0.999)) {
    if (is.finite(evaluate_arithmetic(slot$call, at(u)))) slot_text(slot, at(u), width, place, call)
  }
}
