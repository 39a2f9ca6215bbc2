# Text from files.

# The text of a regular file, marked as UTF-8, without a byte-order mark.
read_utf8 <- function(path, field, call = rlang::caller_env()) {
  bytes <- checked_bytes(path, field, call)
  invalid <- function(line) {
    abort_input(c("The {.field {field}} file {.file {path}} is not UTF-8 text: line {line}.",
                  i = "Save it with the encoding UTF-8."), call = call)
  }
  if (any(bytes == as.raw(0)))
    invalid(1 + sum(bytes[seq_len(which(bytes == as.raw(0))[1])] == as.raw(10)))
  text <- rawToChar(bytes)
  if (!validUTF8(text))
    invalid(which(!validUTF8(strsplit(text, "\n", fixed = TRUE, useBytes = TRUE)[[1]]))[1])
  Encoding(text) <- "UTF-8"
  text
}

# The same of a table, which spreadsheets and loggers also write in UTF-16, and in Windows-1252,
# which holds Latin-1.
read_any_text <- function(path, field, call = rlang::caller_env()) {
  bytes <- checked_bytes(path, field, call)
  from <- if (identical(utils::head(bytes, 2), as.raw(c(0xff, 0xfe)))) "UTF-16LE"
          else if (identical(utils::head(bytes, 2), as.raw(c(0xfe, 0xff)))) "UTF-16BE"
          else if (!any(bytes == as.raw(0)) && !validUTF8(rawToChar(bytes))) "windows-1252"
  if (is.null(from)) return(read_utf8(path, field, call))
  text <- iconv(list(if (from == "windows-1252") bytes else bytes[-(1:2)]), from, "UTF-8")
  if (is.na(text)) return(read_utf8(path, field, call))
  cli::cli_inform(c("The {.field {field}} file {.file {path}} is read as {from}: it is no UTF-8."),
                  class = "amiss_message_file")
  text
}

# The bytes of a file, of one that gzip has compressed those it holds; without a byte-order mark of
# UTF-8.
checked_bytes <- function(path, field, call) {
  if (!is_regular_file(path)) {
    abort_input(c("The {.field {field}} file {.file {path}} is not a regular file.",
                  i = "Name a file that can be read from its start to its end."),
                call = call)
  }
  bytes <- tryCatch(unpacked_bytes(path), error = function(e) {
    abort_input(c("The {.field {field}} file {.file {path}} cannot be read.",
                  x = "{conditionMessage(e)}"), call = call)
  })
  mark <- as.raw(c(0xef, 0xbb, 0xbf))
  if (identical(utils::head(bytes, 3), mark)) bytes[-(1:3)] else bytes
}

# A file of gzip ends with the size of what it holds (modulo 2^32), by which one that is cut off is
# known: gzfile() reads it as if it were whole.
unpacked_bytes <- function(path) {
  bytes <- suppressWarnings(readBin(path, "raw", file.size(path)))
  if (!identical(utils::head(bytes, 2), as.raw(c(0x1f, 0x8b)))) return(bytes)
  size <- sum(as.integer(utils::tail(c(raw(4), bytes), 4)) * 256^(0:3))
  file <- gzfile(path, "rb")
  on.exit(close(file))
  blocks <- list(raw())
  while (length(block <- suppressWarnings(readBin(file, "raw", 2^22))))
    blocks <- c(blocks, list(block))
  unpacked <- do.call(c, blocks)
  if (length(unpacked) %% 2^32 != size)
    stop("It is compressed and damaged, cut off, or made of several files: unpack it with gunzip.")
  unpacked
}

# trimws() in a time that grows as the text does, also if it holds a hundred thousand blanks.
without_blanks <- function(x) {
  long <- nchar(x, "bytes") > 1000
  x[!long] <- trimws(x[!long])
  x[long] <- vapply(x[long], function(text) {
    code <- utf8ToInt(text)
    there <- which(!code %in% utf8ToInt(" \t\r\n"))
    if (length(there)) intToUtf8(code[min(there):max(there)]) else ""
  }, "")
  x
}
