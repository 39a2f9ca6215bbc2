# Tables as programs write them: comments, names, rows of units, fields between signs or spaces.

# list(value, stamp, line) of the rows of a table, without those that are to be dropped.
read_output_table <- function(output, folder, rows) {
  lines <- output_lines(file.path(folder, output$file), output$file, max(rows, least_rows))
  table <- split_table(lines, output)
  stamp <- if (!is.null(output$time)) paste_columns(table, output$time, output)
  words <- lapply(output$column, function(column) table$words[, column_at(column, table, output)])
  # Variables that EnergyPlus reports less often leave their fields empty.
  kept <- if (is.null(stamp)) rep(TRUE, nrow(table$words))
          else Reduce(`|`, lapply(words, nzchar)) & nzchar(stamp)
  within <- seq_len(nrow(table$words))[kept]
  within <- without_ends(within, output$drop_first, output$drop_last)
  values <- Map(function(word, column) table_numbers(word[within], table$line[within], column,
                                                     output), words, output$column)
  value <- Reduce(`+`, values)
  if (identical(output$combine, "mean")) value <- value / length(values)
  list(value = value, stamp = stamp[within], line = table$line[within])
}

without_ends <- function(x, first, last = 0)
  x[seq_along(x) > first & seq_along(x) <= length(x) - last]

least_rows <- 2000  # that a table may have, however few the record has: warm-up, a whole year

table_numbers <- function(words, line, column, output) {
  value <- output_numbers(if (output$decimal == ",") sub(",", ".", words, fixed = TRUE) else words)
  bad <- which(is.na(value) & !is.nan(value))
  if (length(bad)) {
    stop("line ", line[bad[1]], " of ", output$file, " holds ", shown(words[bad[1]]),
         " in the column ", column, ", which is no number", table_hint(bad, words, output))
  }
  value
}

table_hint <- function(bad, words, output) {
  if (grepl("^[+-]?[0-9]+,[0-9]+$", words[bad[1]]) && output$decimal == ".") "; say decimal = \",\""
  else if (identical(bad, 1L)) "; say by units_rows how many rows of units there are"
  else number_hint(bad, words)
}

# list(words, line, names): the fields of the rows below the names, a matrix, and the numbers of
# their lines.
split_table <- function(lines, output) {
  lines <- lines[as.integer(names(lines)) > output$skip]
  remark <- if (nzchar(output$comment)) startsWith(without_blanks(lines), output$comment)
            else rep(FALSE, length(lines))
  named <- is.character(output$column)
  header <- if (named) table_header(lines, remark, output)
            else list(at = 0, separator = table_separator(output, ""))
  body <- lines[!remark & seq_along(lines) > header$at]
  body <- without_ends(body, output$units_rows)
  if (!length(body)) stop("it wrote no rows of numbers into ", output$file)
  if (!identical(header$separator, "\t")) body <- without_blanks(body)
  list(words = field_matrix(body, header, output$file), line = names(body), names = header$fields)
}

# A body line per row; those that end with a separator have an empty field more than there are
# names.
field_matrix <- function(body, header, file) {
  connection <- textConnection(body, encoding = "UTF-8")
  on.exit(close(connection))
  counts <- utils::count.fields(connection, sep = header$separator, quote = "\"", comment.char = "")
  needed <- if (is.null(header$fields)) counts[1] else length(header$fields)
  uneven <- which(is.na(counts) | counts != needed & counts != needed + 1 | counts != counts[1])
  if (length(uneven)) {
    k <- uneven[1]
    stop("line ", names(body)[k], " of ", file, " has ",
         if (is.na(counts[k])) "a quote that does not end"
         else paste(counts[k], "field(s), not", needed), ": ", shown(body[k]))
  }
  words <- scan(text = body, what = "", sep = header$separator, quote = "\"", strip.white = TRUE,
                quiet = TRUE, na.strings = character(), encoding = "UTF-8")
  matrix(words, ncol = counts[1], byrow = TRUE)
}

# `detected` unless the output says another one.
table_separator <- function(output, detected) {
  if (is.null(output$separator)) detected else known_separator(output$separator)
}

# list(at, fields, separator): the first line that names all that is looked for, in a comment or
# not.
table_header <- function(lines, remark, output) {
  wanted <- c(output$column, output$time)
  tried <- if (is.null(output$separator)) separators else known_separator(output$separator)
  best <- list(found = -1)
  for (at in utils::head(seq_along(lines), 200)) {
    bare <- lines[at]
    if (remark[at])
      bare <- without_blanks(substring(without_blanks(bare), nchar(output$comment) + 1))
    if (!possible_header(bare, wanted)) next
    for (separator in tried) {
      fields <- split_line(bare, separator)
      found <- sum(!is.na(match_columns(wanted, fields)))
      if (found > best$found)
        best <- list(found = found, at = at, fields = fields, separator = separator)
      if (found == length(wanted)) return(best)
    }
  }
  there <- if (best$found > 0) best$fields else if (any(!remark)) lines[!remark][1] else lines[1]
  missed <- if (best$found > 0) wanted[is.na(match_columns(wanted, best$fields))] else wanted
  stop("there is no column ", missed[1], " in ", output$file, "; there: ",
       shown(paste(there, collapse = ", ")))
}

# Whether one of the names stands in a line at all: splitting each line in five ways takes its time.
possible_header <- function(line, wanted) any(vapply(wanted, grepl, NA, line, fixed = TRUE))

# Positions of names; the units behind EnergyPlus' names may be missing. NA for none or several.
match_columns <- function(wanted, fields) {
  bare <- sub("\\s*\\[[^]]*\\]\\s*(\\([^)]*\\))?\\s*$", "", fields)
  vapply(wanted, function(name) {
    at <- which(fields == name)
    if (!length(at)) at <- which(bare == name)
    if (length(at) == 1) at else NA_integer_
  }, 0L)
}

column_at <- function(column, table, output) {
  at <- if (is.numeric(column)) column else match_columns(column, table$names)
  if (at > ncol(table$words))
    stop("there is no column ", column, " in ", output$file, ", which has ", ncol(table$words))
  at
}

paste_columns <- function(table, columns, output) {
  do.call(paste, lapply(columns, function(column) table$words[, column_at(column, table, output)]))
}
