# Conditions of a study file, such as `phase == "rolbs" & hour <= 180`: a small language over the
# columns of the data. R's parser reads it; what is not in this table is refused, and nothing is
# ever evaluated as R code.

row_operators <- list(
  "==" = 2, "!=" = 2, "<" = 2, "<=" = 2, ">" = 2, ">=" = 2, "&" = 2, "|" = 2, "!" = 1, "(" = 1,
  "+" = 2, "-" = 1:2, "*" = 2, "/" = 2, "%in%" = 2)

# The rows that a condition chooses: one TRUE or FALSE for each.
row_condition <- function(text, data, what, clock = NULL, call = rlang::caller_env()) {
  if (is.null(text)) return(NULL)
  hint <- "Write one condition in the columns, for example {.code phase == \"rolbs\"}."
  check_input(checkmate::check_string(text, min.chars = 1), what, hint, call = call)
  # Longer ones could nest deeper than R's stack allows.
  check_input(if (nchar(text) <= 2000) TRUE else "It is longer than 2000 characters", what, hint,
              call = call)
  parsed <- tryCatch(parse(text = text, keep.source = FALSE, encoding = "UTF-8"),
                     error = function(e) {
                       abort_input(c("{.arg {what}} = {.val {text}} cannot be read.",
                                     x = "{conditionMessage(e)}", i = hint), call = call)
                     })
  if (length(parsed) != 1)
    abort_input(c("{.arg {what}} = {.val {text}} is not one condition.", i = hint), call = call)
  refuse <- function(part, why) {
    part <- paste(deparse(part), collapse = " ")
    abort_input(c("{.arg {what}} = {.val {text}} cannot be used: {.code {part}} {why}.",
                  i = paste("A condition may hold columns, numbers, texts in quotes, {.code c()}",
                            "after {.code %in%} and {.code {names(row_operators)}}.")),
                call = call)
  }
  rows <- tryCatch(suppressWarnings(row_value(parsed[[1]], data, refuse, comparisons(clock))),
                   error = function(e) {
                     if (inherits(e, "amiss_error")) stop(e)
                     abort_input(c(paste("{.arg {what}} = {.val {text}} has no value:",
                                         "{conditionMessage(e)}."), i = hint), call = call)
                   })
  check_input(checkmate::check_logical(rows, len = nrow(data)), what,
              "One TRUE or FALSE for every row of the data.", call = call)
  rows
}

row_value <- function(part, data, refuse, operators) {
  if (is.symbol(part)) {
    # The parser keeps the bytes of a name, and in other locales than UTF-8 forgets what they are.
    name <- as.character(part)
    if (validUTF8(name)) Encoding(name) <- "UTF-8"
    column <- match(name, names(data))
    if (is.na(column)) refuse(part, "is not a column of the data")
    return(data[[column]])
  }
  if (is.numeric(part) || is.character(part)) return(part)
  if (!is.call(part)) refuse(part, "is not allowed")
  name <- if (is.symbol(part[[1]])) as.character(part[[1]]) else ""
  if (!(length(part) - 1) %in% row_operators[[name]] || !is.null(names(part)))
    refuse(part, "is not allowed")
  values <- if (name == "%in%") {
    list(row_value(part[[2]], data, refuse, operators), row_set(part[[3]], refuse))
  } else {
    lapply(as.list(part)[-1], row_value, data, refuse, operators)
  }
  do.call(operators[[name]] %||% get(name, baseenv()), values)
}

# The right side of %in%: c() of numbers or texts.
row_set <- function(part, refuse) {
  listed <- is.call(part) && identical(part[[1]], quote(c)) && is.null(names(part)) &&
    length(part) > 1
  if (!listed || length(all.vars(part))) refuse(part, "is not c() of numbers or texts")
  unlist(lapply(as.list(part)[-1], row_value, data = list(), refuse, list()))
}
