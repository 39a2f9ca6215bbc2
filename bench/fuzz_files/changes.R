# Random changes of the bytes and of the structure of a text file.

# Words that mean something to a reader of tables, of YAML, or of numbers.
telling <- c("NA", "NaN", "Inf", "-9999", "1e400", "1e-400", "017", "0x1F", "1e-3", "1:30", "1_000",
             "1,234.5", "1.234,5", "12-101", "1d3", "\"", "'", "\"\"", ",", ";", "\t", "|", " ",
             "\n", "\r\n", "\r", "\n\n\n", "#", "%", "!", "!!int ", "!!binary ", "!ruby ", "&a ",
             "*a", "<<: *a", "- ", "? ", ": ", "{", "}", "[", "]", "{}", "[]", "null", "~", "true",
             "yes", "no", "off", ".inf", ".nan", "---\n", "...\n", "%YAML 1.1\n", "|\n  ", ">\n  ",
             "2024-02-30", "2024-03-31 02:30", "25:00", "\u00a0", "\u2019", "\u20ac", "\ufeff",
             "{x}", "{stop(1)}", "%s", "../x", "~/x", "/dev/zero", "system('false')",
             "99999999999999999999", "-0", "+5", ".5", "5.", "1e", "--1")

at_random <- function(bytes) sample.int(length(bytes) + 1, 1) - 1

insert <- function(bytes, what, at = at_random(bytes)) append(bytes, what, at)

slice <- function(bytes, longest = 200) {
  from <- sample.int(length(bytes), 1)
  from:min(length(bytes), from + sample.int(longest, 1) - 1)
}

lines_of <- function(bytes) split(bytes, cumsum(c(0, utils::head(bytes == as.raw(10), -1))))

joined <- function(lines) unlist(lines, use.names = FALSE)

byte_changes <- list(
  flip = function(bytes, others) {
    i <- sample.int(length(bytes), 1)
    replace(bytes, i, xor(bytes[i], as.raw(2^sample(0:7, 1))))
  },
  random = function(bytes, others)
    replace(bytes, sample.int(length(bytes), 1), as.raw(sample(0:255, 1))),
  insert = function(bytes, others)
    insert(bytes, as.raw(sample(0:255, sample.int(4, 1), replace = TRUE))),
  remove = function(bytes, others) bytes[-slice(bytes)],
  repeated = function(bytes, others) insert(bytes, rep(bytes[slice(bytes, 20)], sample.int(50, 1))),
  cut = function(bytes, others) bytes[seq_len(at_random(bytes))],
  word = function(bytes, others) insert(bytes, charToRaw(sample(telling, 1))),
  word_for_slice = function(bytes, others) {
    gone <- slice(bytes, 12)
    insert(bytes[-gone], charToRaw(sample(telling, 1)), gone[1] - 1)
  },
  long = function(bytes, others) insert(bytes, rep(sample(bytes, 1), 10^sample(2:5, 1))))

structure_changes <- list(
  lines_swapped = function(lines, others) lines[sample.int(length(lines))],
  line_twice = function(lines, others)
    append(lines, lines[sample.int(length(lines), 1)], sample.int(length(lines), 1)),
  line_gone = function(lines, others) lines[-sample.int(length(lines), 1)],
  foreign_line = function(lines, others) {
    append(lines, sample(lines_of(sample(others, 1)[[1]]), 1), sample.int(length(lines), 1))
  },
  field_changed = function(lines, others) {
    i <- sample.int(length(lines), 1)
    ends <- which(lines[[i]] %in% charToRaw(",;\t:"))
    at <- if (length(ends)) ends[sample.int(length(ends), 1)] else 0
    lines[[i]] <- append(lines[[i]], charToRaw(sample(telling, 1)), at)
    lines
  },
  indented = function(lines, others) {
    i <- sample.int(length(lines), 1)
    lines[[i]] <- c(rep(charToRaw(sample(c(" ", "\t"), 1)), sample.int(8, 1)), lines[[i]])
    lines
  },
  separator_changed = function(lines, others) {
    lines[] <- lapply(
      lines,
      function(x) replace(x, x == charToRaw(","), charToRaw(sample(c(";", "\t", "|", " "), 1))))
    lines
  })

# One to three changes; seldom the whole in another encoding.
changed_bytes <- function(bytes, others) {
  for (k in seq_len(sample.int(3, 1, prob = c(6, 3, 1)))) {
    if (!length(bytes)) break
    bytes <- if (stats::runif(1) < 0.6) sample(byte_changes, 1)[[1]](bytes, others)
             else joined(sample(structure_changes, 1)[[1]](lines_of(bytes), others))
  }
  if (stats::runif(1) < 0.02 && !any(bytes == as.raw(0)) && validUTF8(rawToChar(bytes))) {
    bytes <- c(as.raw(c(0xff, 0xfe)),
               iconv(rawToChar(bytes), "UTF-8", "UTF-16LE", toRaw = TRUE)[[1]])
  }
  as.raw(bytes)
}
