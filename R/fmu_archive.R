# The archive that an FMU is: what is in it, checked before anything is read; its parts in memory or
# in a folder.

fmu_most_files <- 20000
fmu_most_bytes <- 4e9       # of the archive, and of what is in it
fmu_most_text <- 1e8        # bytes of the description
fmu_most_packed <- 200      # times its own size, of an archive from which more than 100 MB come

fmu_description_name <- "modelDescription.xml"

# Data frame of the files in the archive: name, size. An archive is refused that could write outside
# of a folder, fill the disk or plant links.
fmu_entries <- function(file, call = rlang::caller_env()) {
  refuse <- function(...) {
    why <- paste(...)
    refuse_fmu(file, "{why}", call)
  }
  if (!is_regular_file(file)) refuse("It is no file.")
  if (file.size(file) > fmu_most_bytes) refuse("It is larger than", fmu_most_bytes / 1e9, "GB.")
  entries <- tryCatch(suppressWarnings(utils::unzip(file, list = TRUE)), error = function(e) NULL)
  flags <- archive_flags(file)
  if (is.null(entries) || is.null(flags) || !nrow(entries))
    refuse("It is no zip archive, or is cut off.")
  entries <- data.frame(name = entries$Name, size = entries$Length)
  if (nrow(entries) > fmu_most_files) refuse("It holds more than", fmu_most_files, "files.")
  if (nrow(entries) != nrow(flags)) refuse("Its list of files is not whole.")
  check_entry_names(entries$name, refuse)
  if (any(flags$link)) refuse("It holds the symbolic link", shown_name(entries$name[flags$link][1]))
  if (any(flags$secret)) refuse("It is encrypted.")
  total <- sum(entries$size)
  if (total > fmu_most_bytes || total > max(1e8, fmu_most_packed * file.size(file))) {
    refuse("It would unpack", signif(total / 1e6, 3), "MB from", signif(file.size(file) / 1e6, 3),
           "MB.")
  }
  entries[!grepl("/$", entries$name), ]
}

check_entry_names <- function(names, refuse) {
  bare <- sub("/$", "", names)  # a folder
  out <- !validEnc(names) | !stays_inside(bare)
  if (any(out))
    refuse("Its file", shown_name(names[out][1]), "would be written outside of its folder.")
  twice <- anyDuplicated(tolower(bare))
  if (twice) refuse("It holds the file", shown_name(names[twice]), "twice.")
}

# Names of strangers in messages.
shown_name <- function(name) substr(one_line(name), 1, 100)

# `why`: a sentence with cli's markup.
refuse_fmu <- function(file, why, call, hint = NULL, .envir = parent.frame()) {
  abort_input(c("The FMU {.file {file}} cannot be used.", x = why, i = hint),
              class = "amiss_error_fmu", call = call, .envir = rlang::env(.envir, file = file))
}

# What the list of unzip() does not say: data frame of link and secret (encrypted), a row for each
# entry of the central directory (PKWARE's APPNOTE 6.3, 4.3.12 and 4.3.16); NULL if there is none,
# or a list of 64 bits.
archive_flags <- function(file) {
  bytes <- archive_directory(file)
  if (is.null(bytes)) return(NULL)
  at <- 1
  link <- secret <- logical()
  while (at + 45 <= length(bytes) && identical(bytes[at + 0:3], as.raw(c(0x50, 0x4b, 1, 2)))) {
    mode <- little_endian(bytes[at + 40:41])
    link <- c(link, mode %/% 4096 == 10)  # S_IFLNK, 0120000
    secret <- c(secret, little_endian(bytes[at + 8:9]) %% 2 == 1)
    at <- at + 46 +
      sum(vapply(c(28, 30, 32), function(field) little_endian(bytes[at + field + 0:1]), 0))
    if (length(link) > fmu_most_files) return(data.frame(link, secret))
  }
  data.frame(link, secret)
}

archive_directory <- function(file) {
  size <- file.size(file)
  connection <- file(file, "rb")
  on.exit(close(connection))
  read <- function(from, n) {
    seek(connection, from)
    readBin(connection, "raw", n)
  }
  tail <- read(max(0, size - 65557), 65557)
  ends <- grepRaw(as.raw(c(0x50, 0x4b, 5, 6)), tail, fixed = TRUE, all = TRUE)
  if (!length(ends) || max(ends) + 21 > length(tail)) return(NULL)
  end <- max(ends)
  length <- little_endian(tail[end + 12:15])
  from <- little_endian(tail[end + 16:19])
  if (from + length > size) NULL else read(from, length)
}

little_endian <- function(bytes) sum(as.integer(bytes) * 256^(seq_along(bytes) - 1))

# The bytes of one file of the archive, in memory.
fmu_part <- function(file, name, most, entries, call) {
  size <- entries$size[entries$name == name]
  if (!length(size)) refuse_fmu(file, "It holds no {.file {name}}: it is no FMU.", call)
  if (size > most)
    refuse_fmu(file, paste0("Its {.file {name}} is larger than ", most / 1e6, " MB."), call)
  connection <- unz(file, name, "rb")
  on.exit(close(connection))
  bytes <- tryCatch(suppressWarnings(readBin(connection, "raw", size + 1)),
                    error = function(e) raw())
  if (length(bytes) != size) refuse_fmu(file, "Its {.file {name}} is damaged.", call)
  bytes
}

# A new folder, with the platform's binaries and the resources of an FMU.
unpack_fmu <- function(file, platform, call = rlang::caller_env()) {
  entries <- fmu_entries(file, call)
  used <- startsWith(entries$name, paste0("binaries/", platform, "/")) |
    startsWith(entries$name, "resources/")
  entries <- entries[used, ]
  folder <- tempfile("fmu-")
  dir.create(file.path(folder, "resources"), recursive = TRUE)  # there even if it is empty
  whole <- tryCatch({
    utils::unzip(file, files = entries$name, exdir = folder)
    paths <- file.path(folder, entries$name)
    all(is_regular_file(paths)) && !any(fs::is_link(paths)) && all(file.size(paths) == entries$size)
  }, warning = function(w) FALSE, error = function(e) FALSE)
  if (!whole) {
    unlink(folder, recursive = TRUE)
    refuse_fmu(file, "It cannot be unpacked whole: it is damaged, or the disk is full.", call)
  }
  normalizePath(folder)
}
