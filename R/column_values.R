# Columns of text as the numbers that stand in them, by the mark before their decimals.

missing_words <- c("", "NA", "N/A", "n/a", "#N/A", "NaN", "NAN", "nan", "null", "NULL", "None", "-",
                   "--", "---")

exponent <- "(?:[eEdD][+-]?\\d+|[+-]\\d{3})?$"
# Numbers with a point before the decimals and commas between thousands, and the other way round.
number_forms <- list(
  "." = paste0("^[+-]?(?:\\d+\\.?\\d*|\\.\\d+|\\d{1,3}(?:,\\d{3})+(?:\\.\\d*)?)", exponent),
  "," = paste0("^[+-]?(?:\\d+,?\\d*|,\\d+|\\d{1,3}(?:\\.\\d{3})+(?:,\\d*)?)", exponent))

# The columns of a table with numbers where all fields are numbers or missing, TRUE and FALSE where
# all are these, else text. Digits with a zero in front stay text in the column of time.
column_values <- function(columns, time, separator, decimal, refuse) {
  plain <- lapply(columns, plain_column)
  marks <- lapply(columns[vapply(plain, is.null, NA)], column_marks)
  decimal <- decimal %||% file_decimal(columns, marks, separator, refuse)
  Map(function(text, numbers, name) {
    if (name == time && any(grepl("^0[0-9]{5,}$", text))) return(text)
    if (decimal == "." && !is.null(numbers)) return(numbers)
    marked_column(text, decimal)
  }, columns, plain, names(columns))
}

# Numbers as R reads them; NULL if a field is none.
plain_column <- function(text) {
  text[text %in% missing_words] <- NA
  numbers <- suppressWarnings(as.numeric(text))
  if (identical(is.na(numbers), is.na(text))) numbers
}

# The decimal marks by which all numbers of a column can be read.
column_marks <- function(text) {
  text <- joined_thousands(text[grepl("^[-+.,0-9]*[0-9]", text) & grepl("[.,]", text)])
  fits <- function(form) length(text) > 0 && all(grepl(form, text, perl = TRUE))
  names(number_forms)[vapply(number_forms, fits, NA)]
}

# The mark of the whole file. Between commas only fields in quotes hold a comma: one that could
# separate thousands does.
file_decimal <- function(columns, marks, separator, refuse) {
  comma <- names(Filter(function(m) identical(m, ","), marks))
  open <- names(Filter(function(m) length(m) == 2, marks))
  if (!length(comma))
    return(if (length(open) && separator != "," && !any_points(columns)) "," else ".")
  for (name in setdiff(names(columns), comma)) {
    row <- grep("^[+-]?\\d+\\.\\d+$", columns[[name]])[1]
    if (is.na(row)) next
    other <- grep(",", columns[[comma[1]]], fixed = TRUE)[1]
    refuse("Row ", other, " of the column ", comma[1], " holds ", columns[[comma[1]]][other],
           ", with a comma before ", "decimals, and row ", row, " of ", name, " holds ",
           columns[[name]][row], ", with a point. Say `decimal` ",
           "in the study: \",\" makes points separate thousands, \".\" commas.")
  }
  ","
}

any_points <- function(columns)
  any(vapply(columns, function(x) any(grepl("^[+-]?\\d+\\.\\d+$", x)), NA))

# Spaces and apostrophes between thousands.
joined_thousands <- function(text) {
  grouped <- grepl("^[+-]?\\d{1,3}(?:[ '\u00a0\u2009\u202f\u2019]\\d{3})+(?:[.,]\\d*)?$", text,
                   perl = TRUE)
  text[grouped] <- gsub("[ '\u00a0\u2009\u202f\u2019]", "", text[grouped])
  text
}

# Numbers, logical values, or the text with such numbers as it has written as R writes them.
marked_column <- function(text, decimal) {
  missing <- text %in% missing_words
  if (all(missing)) return(rep(NA_real_, length(text)))
  joined <- joined_thousands(text)
  number <- grepl(number_forms[[decimal]], joined, perl = TRUE) & !missing
  other <- if (decimal == ".") "," else "."
  plain <- sub(decimal, ".", gsub(other, "", joined, fixed = TRUE), fixed = TRUE)
  plain <- sub("([0-9.])([+-]\\d{3})$", "\\1e\\2", chartr("dD", "ee", plain))
  if (all(number | missing)) return(as.numeric(ifelse(missing, NA, plain)))
  known <- !missing & !number
  if (all(text[!missing] %in% c("TRUE", "FALSE", "true", "false", "True", "False", "T", "F"))) {
    return(as.logical(ifelse(missing, NA, text)))
  }
  if (sum(known) < sum(number)) text[number] <- plain[number]
  text[text == "NA"] <- NA
  text
}

# A column of numbers that one field keeps from being one is lost for the simulator.
tell_broken <- function(name, values) {
  if (!is.character(values)) return(invisible())
  given <- !is.na(values) & !values %in% missing_words
  number <- given & !is.na(suppressWarnings(as.numeric(values)))
  row <- which(given & !number)[1]
  if (sum(number) <= 0.5 * sum(given) || is.na(row)) return(invisible())
  warn_input(c(paste("Column {.val {name}} is read as text: row {row} holds {.val {values[row]}},",
                     "while {sum(number)} row{?s} hold{?s/} numbers."),
               i = "Write it as a number, or NA for a value that is missing."))
}
