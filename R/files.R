# Files of anybody's: which can be read at all, and what is in them.

# Whether a path leads, over any number of links, to a file with an end: no folder, pipe or device.
is_regular_file <- function(path) {
  vapply(path, function(one) {
    real <- tryCatch(fs::path_real(one), error = function(e) NA_character_)
    !is.na(real) && unname(fs::is_file(real, follow = FALSE))
  }, NA, USE.NAMES = FALSE)
}

# All bytes of a regular file.
file_bytes <- function(path) readBin(path, "raw", file.size(path))

# Whether a name stays in the folder that it is used in, on every system: `a.txt` and `b/a.txt`, not
# `../a.txt` or `/a`.
stays_inside <- function(name) {
  parts <- strsplit(name, "[/\\\\]")
  within <- vapply(parts, function(part) length(part) > 0 && !any(part %in% c("", ".", "..")), NA)
  within & !grepl("[/\\\\]$|^[A-Za-z]:|^~|[[:cntrl:]]", name) & nchar(name, "bytes") <= 255
}

# Names of files that stay in the run's directory. Each has the name of the argument that it is
# from.
check_inside <- function(names, call = rlang::caller_env()) {
  out <- names[!stays_inside(names)]
  if (length(out)) {
    abort_input(
      c("{.arg {names(out)[1]}} names {.file {out[1]}}, which is no file in the run's directory.",
        i = "Give a name as {.code model.txt} or {.code inputs/model.txt}."), call = call)
  }
}

lines_of <- function(bytes) {
  connection <- rawConnection(bytes)
  on.exit(close(connection))
  readLines(connection, warn = FALSE)
}

# Begin and end of a file, `most` bytes in all, and what was left out between them.
file_ends <- function(path, most) {
  size <- file.size(path)
  part <- function(from) {
    connection <- file(path, "rb")
    on.exit(close(connection))
    seek(connection, from)
    readBin(connection, "raw", most / 2)
  }
  gap <- charToRaw(sprintf("\n[... %.0f bytes were left out here ...]\n", size - most))
  c(part(0), gap, part(size - most / 2))
}
