# Text that a program wrote, and the plain CSV of names and numbers: read right, or refused with
# line, value and what to write.

read_output <- function(output, folder, rows) {
  file <- output[["file"]]
  lines <- output_lines(file.path(folder, file), file, rows)
  column <- column_words(lines, output[["column"]], file)
  value <- output_numbers(column$words)
  bad <- which(is.na(value) & !is.nan(value))
  if (length(bad)) {
    stop("line ", column$line[bad[1]], " of ", file, " holds ", shown(column$words[bad[1]]),
         " in the column ", output[["column"]], ", which is no number",
         number_hint(bad, column$words))
  }
  value
}

longest_line <- 1e6  # bytes

# The lines that are not empty, under their numbers. A file that rows of numbers cannot fill is not
# read.
output_lines <- function(path, file, rows) {
  if (!file.exists(path) || isTRUE(file.size(path) == 0)) stop("it wrote nothing into ", file)
  if (!is_regular_file(path)) stop(file, " is no regular file")
  most <- longest_line + 1e5 * rows
  if (file.size(path) > most) {
    stop(file, " has ", round(file.size(path) / 1e6), " MB, more than the ", round(most / 1e6),
         " MB for ",
         rows, " rows")
  }
  bytes <- file_bytes(path)
  ends <- c(0, which(bytes == as.raw(10)), length(bytes))
  zero <- which(bytes == as.raw(0))
  if (length(zero)) stop(file, " is no text: line ", sum(ends < zero[1]), " holds a zero byte")
  if (max(diff(ends)) > longest_line)
    stop("line ", which.max(diff(ends)), " of ", file, " is longer than 1 MB")
  lines <- strsplit(rawToChar(bytes), "\r?\n", perl = TRUE, useBytes = TRUE)[[1]]
  Encoding(lines) <- if (all(validUTF8(lines))) "UTF-8" else "latin1"
  lines <- sub("^\ufeff", "", enc2utf8(lines))
  names(lines) <- seq_along(lines)
  lines[grepl("[^[:space:]]", lines)]
}

# list(words, line): what stands in a column, and in which line.
column_words <- function(lines, column, file) {
  connection <- textConnection(lines, encoding = "UTF-8")
  on.exit(close(connection))
  fields <- utils::count.fields(connection, sep = ",", quote = "\"", comment.char = "")
  uneven <- which(is.na(fields) | fields != fields[1])
  if (length(uneven)) stop_uneven(lines[uneven[1]], fields[c(uneven[1], 1)], file)
  words <- scan(text = lines, what = "", sep = ",", quote = "\"", strip.white = TRUE, quiet = TRUE,
                na.strings = character(), encoding = "UTF-8")
  words <- matrix(words, ncol = fields[1], byrow = TRUE)
  at <- which(words[1, ] == column)
  if (length(at) != 1) {
    stop("there ", if (length(at)) "are several columns " else "is no column ", column, " in ",
         file, "; there: ", shown(paste(words[1, ], collapse = ", ")),
         if (grepl("[;\t]", lines[1])) "; write commas between columns")
  }
  list(words = words[-1, at], line = names(lines)[-1])
}

stop_uneven <- function(line, fields, file) {
  stop("line ", names(line), " of ", file, " has ",
       if (is.na(fields[1])) "a quote that does not end"
       else sprintf("%d field(s) where the first line has %d name(s)", fields[1], fields[2]),
       ": ", shown(line),
       "; write one field for each name, a comma between fields and a point before decimals")
}

# Decimal numbers, also with Fortran's exponents; NaN for words that say so; NA for anything else.
output_numbers <- function(words) {
  number <- "^[+-]?([0-9]+[.]?[0-9]*|[.][0-9]+)([eEdDqQ][+-]?[0-9]+|[+-][0-9]{2,4})?$"
  value <- rep(NA_real_, length(words))
  value[grepl("^[+-]?(nan|inf|infinity|na)$", words, ignore.case = TRUE)] <- NaN
  plain <- grepl(number, words)
  value[plain] <- as.numeric(sub("([0-9.])([+-])", "\\1e\\2", chartr("dDqQ", "eeee", words[plain])))
  value
}

number_hint <- function(bad, words) {
  word <- words[bad[1]]
  if (grepl("^[*]+$", word))
    ": Fortran writes it if a number is wider than its format; widen the format"
  else if (!nzchar(word)) "; write a number in every row"
  else if (grepl("^[+-]?[0-9]+,[0-9]", word)) "; write a point before decimals"
  else if (identical(bad, 1L)) "; write one line of names, and no units below it"
  else "; write numbers only"
}

shown <- function(text) {
  text <- one_line(text)
  dQuote(if (nchar(text) > 60) paste0(substr(text, 1, 60), "...") else text, FALSE)
}
