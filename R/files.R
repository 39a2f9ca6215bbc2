# Files of anybody's: which can be read at all.

# Whether a path leads, over any number of links, to a file with an end: no folder, pipe or device.
is_regular_file <- function(path) {
  vapply(path, function(one) {
    real <- tryCatch(fs::path_real(one), error = function(e) NA_character_)
    !is.na(real) && unname(fs::is_file(real, follow = FALSE))
  }, NA, USE.NAMES = FALSE)
}

# All bytes of a regular file.
file_bytes <- function(path) readBin(path, "raw", file.size(path))

# Whether a name stays in the folder that it is used in, on every system: `a.txt` and `b/a.txt`, not `../a.txt` or `/a`.
stays_inside <- function(name) {
  parts <- strsplit(name, "[/\\\\]")
  within <- vapply(parts, function(part) length(part) > 0 && !any(part %in% c("", ".", "..")), NA)
  within & !grepl("[/\\\\]$|^[A-Za-z]:|^~|[[:cntrl:]]", name) & nchar(name, "bytes") <= 255
}
