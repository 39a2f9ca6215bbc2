# Tables in text files, as loggers, spreadsheets and programs write them: the header is the line
# that holds the names that are looked for, and its fields say what separates them.

separators <- c(comma = ",", semicolon = ";", tab = "\t", bar = "|", space = "")

# `names`: columns that should be there, the first of them time and target. `separator`, `decimal`:
# as a study says them, or NULL.
read_table_file <- function(path, names, separator = NULL, decimal = NULL,
                            call = rlang::caller_env()) {
  check_table_options(separator, decimal, call)
  text <- read_any_text(path, "data", call)
  lines <- strsplit(gsub("\r\n?", "\n", text), "\n", fixed = TRUE)[[1]]
  refuse <- function(...) {
    why <- paste0(...)
    abort_input(c("The data file {.file {path}} cannot be read.", x = "{why}"), call = call)
  }
  if (!any(nzchar(without_blanks(lines)))) refuse("It holds no lines.")
  header <- find_header(lines, names,
                        if (is.null(separator)) separators else known_separator(separator))
  body <- body_lines(lines, header$line)
  columns <- body_fields(body, header, refuse)
  columns <- without_units(columns, names, path)
  values <- column_values(columns, names[1], header$separator, decimal, refuse)
  for (name in setdiff(names(values), names)) tell_broken(name, values[[name]])
  plain_table(values, length(values[[1]]))
}

check_table_options <- function(separator, decimal, call) {
  check_input(checkmate::check_string(separator, min.chars = 1, null.ok = TRUE), "separator",
              "Give the sign between two fields, or one of {.val {names(separators)}}.",
              call = call)
  if (!is.null(separator) && !can_separate(known_separator(separator))) {
    abort_input(c("{.arg separator} = {.val {separator}} is no sign that can stand between fields.",
                  i = "Give one sign, or one of {.val {names(separators)}}."), call = call)
  }
  check_input(checkmate::check_choice(decimal, c(".", ","), null.ok = TRUE), "decimal",
              "It is {.val .} or {.val ,}, in quotes.", call = call)
}

# One sign that no field begins or ends with; "" stands for spaces.
can_separate <- function(sign)
  !nzchar(sign) ||
    grepl("^([[:punct:]]|\t)$", sign) && !grepl("[\"'#]", sign) && nchar(sign, "bytes") == 1

known_separator <- function(separator) {
  if (separator %in% names(separators)) return(separators[[separator]])
  if (grepl("^ +$", separator)) "" else separator
}

# list(line, fields, separator): the first line with most of the names. A header may stand in a
# comment.
find_header <- function(lines, names, separators) {
  first <- utils::head(which(nzchar(without_blanks(lines))), 200)
  best <- list(found = -1)
  for (line in first)
    for (bare in unique(c(lines[line], sub("^\\s*[#%!]+\\s*", "", lines[line])))) {
      for (separator in separators) {
        fields <- split_line(bare, separator)
        found <- sum(names %in% fields)
        if (found > best$found)
          best <- list(found = found, line = line, fields = fields, separator = separator)
      }
      if (best$found == length(names)) return(best)
    }
  if (best$found > 0) return(best)
  # None of the names is there: the first line that is no comment, as it says most.
  line <- c(first[!is_comment(lines[first])], first)[1]
  split <- lapply(separators, function(separator) split_line(lines[line], separator))
  most <- which.max(lengths(split))
  list(line = line, fields = split[[most]], separator = separators[[most]])
}

is_comment <- function(lines) grepl("^\\s*#", lines)

split_line <- function(line, separator) {
  fields <- suppressWarnings(scan(text = line, what = "", sep = separator, quote = "\"",
                                  quiet = TRUE, na.strings = character(), comment.char = "",
                                  encoding = "UTF-8"))
  without_blanks(fields)
}

# The lines below the header that hold something, with their numbers in the file.
body_lines <- function(lines, header) {
  number <- seq_along(lines)
  kept <- number > header & nzchar(without_blanks(lines)) & !is_comment(lines)
  list(text = lines[kept], number = number[kept])
}

# What is longer is no value, and patterns take minutes to tell.
longest_field <- 1000L

check_field_lengths <- function(columns, names, line, refuse) {
  for (k in seq_along(columns)) {
    long <- which(nchar(columns[[k]], "bytes") > longest_field)[1]
    if (is.na(long)) next
    refuse("Line ", line[long], " has ", nchar(columns[[k]][long]), " characters in field ", k,
           if (k <= length(names)) paste0(" (", substr(names[k], 1, 40), ")"), ". At most ",
           longest_field, " are read.")
  }
}

# The fields of the body as columns of text: each row has a field for each name of the header.
body_fields <- function(body, header, refuse) {
  names <- header$fields
  named <- max(which(nzchar(names)), 0)
  if (!named) refuse("Line ", header$line, " holds no names of columns.")
  if (!length(body$text))
    refuse("It has no rows below the names of its columns, in line ", header$line, ".")
  ends <- fields_of_lines(body$text, header$separator)
  line <- body$number[!is.na(ends)]
  counts <- ends[!is.na(ends)]
  far <- which(counts > most_fields(names))[1]
  if (!is.na(far))
    refuse("Line ", line[far], " has ", counts[far], " fields, its header ", length(names), ".")
  width <- max(counts, length(names))
  open <- function(w) refuse("A quotation mark is opened and not closed, perhaps in line ",
                             body$number[c(which(is.na(ends)), 1)[1]], ".")
  columns <- tryCatch(scan_fields(body$text, width, header$separator), warning = open)
  check_field_lengths(columns, names, line, refuse)
  over <- Reduce(`|`, lapply(columns[-seq_len(length(names))], nzchar), rep(FALSE, length(counts)))
  # Nothing may stand after a last separator, unless what stands first could be a number for each
  # row.
  counted <- identical(columns[[1]],
                       format(seq_along(counts) - (columns[[1]][1] == "0"), trim = TRUE))
  bad <- which(over | counts < named | counted & counts > length(names))
  if (length(bad)) refuse_fields(bad[1], line, counts, columns, header, refuse)
  columns <- stats::setNames(columns[seq_along(names)], filled_names(names))
  columns <- columns[nzchar(names) | vapply(columns, function(x) any(nzchar(x)), NA)]
  # Spreadsheets leave rows without values at the end.
  last <- max(which(Reduce(`|`, lapply(columns, nzchar))), 0)
  lapply(columns, utils::head, last)
}

scan_fields <- function(text, width, separator) {
  fields <- scan(text = text, what = rep(list(""), width), sep = separator, quote = "\"",
                 quiet = TRUE, fill = TRUE, multi.line = FALSE, na.strings = character(),
                 comment.char = "", encoding = "UTF-8")
  lapply(fields, without_blanks)
}

# Nothing but separators may stand behind the last name. Of very many of them a table would be made
# first.
most_fields <- function(names) 2 * length(names) + 1000

# NA for a line that ends inside of a quotation.
fields_of_lines <- function(lines, separator) {
  connection <- textConnection(lines)
  on.exit(close(connection))
  utils::count.fields(connection, separator, quote = "\"", comment.char = "")
}

refuse_fields <- function(row, line, counts, columns, header, refuse) {
  values <- paste(vapply(utils::head(columns, counts[row]), `[`, "", row), collapse = " | ")
  if (nchar(values) > 100) values <- paste0(substr(values, 1, 100), " ...")
  what <- if (counts[row] < length(header$fields)) {
    "a row is cut off, or what separates its fields is another sign"
  } else {
    paste("a first column without a name needs one in the header, a comma that is no separator (a",
          "decimal comma) needs quotes around its field")
  }
  refuse("Row ", row, " (line ", line[row], ") has ", counts[row], " fields, its header ",
         length(header$fields), ": ", values, ". Each row needs a field for each name: ", what,
         ", or say `separator` in the study.")
}

# Rows of units and the like stand between the names and the first time: at most three.
without_units <- function(columns, names, path) {
  time <- columns[[names[1]]]
  if (is.null(time)) return(columns)
  target <- columns[[names[2]]] %||% rep("", length(time))
  first <- seq_len(min(3, length(time)))
  number <- function(x) grepl("^[-+.,0-9]*[0-9][-+.,0-9eE]*$", x[first])
  unit <- !grepl("[0-9]", time[first]) & !number(target) &
    (nzchar(time[first]) | !Reduce(`|`, lapply(columns, number)))
  types <- Reduce(`&`, lapply(columns, function(x) grepl("^[0-9]*[sdn]?$", x[first])))
  unit <- unit | types & grepl("[sdn]$", time[first])
  above <- sum(cumprod(unit))
  if (!above) return(columns)
  cli::cli_inform(paste("The data file {.file {path}}: {above} row{?s} of units below the header",
                        "{?is/are} left out."), class = "amiss_message_file")
  lapply(columns, function(x) x[-seq_len(above)])
}
