# Builds the FMU of the house from its sources, with the compiler that R uses: build_house("house.fmu").
#
# A tool that exports FMUs does all this by itself; here it makes examples and tests that need no such tool.

# `edit`: a function of the lines of the description. `resources`: files of the folder of that name, as text.
build_house <- function(file, version = 2, edit = identity, resources = list(start.txt = "20"),
                        sources = system.file("examples", "fmu", package = "amiss")) {
  description <- readLines(file.path(sources, paste0("house", version, ".xml")))
  library <- compiled(file.path(sources, paste0("house", version, ".c")), file.path(sources, "house.h"))
  write_zip(file, fmu_parts("house", library, version, edit(description), resources))
}

# The files of an FMU in memory, by their names in it.
fmu_parts <- function(name, library, version, description, resources = list()) {
  entries <- list("modelDescription.xml" = as_bytes(description))
  entries[[paste0("binaries/", this_platform(version), "/", name, .Platform$dynlib.ext)]] <-
    readBin(library, "raw", file.size(library))
  for (file in names(resources)) entries[[paste0("resources/", file)]] <- as_bytes(resources[[file]])
  entries
}

as_bytes <- function(lines) charToRaw(paste0(lines, "\n", collapse = ""))

# The library of one C file, compiled once in a session.
compiled <- function(source, ..., flags = "") {
  name <- sub("[.]c$", "", basename(source))
  folder <- file.path(tempdir(), paste0("fmu-", name))
  library <- file.path(folder, paste0(name, .Platform$dynlib.ext))
  if (file.exists(library)) return(library)
  dir.create(folder, showWarnings = FALSE)
  file.copy(c(source, ...), folder)
  writeLines(paste("PKG_CPPFLAGS =", flags), file.path(folder, "Makevars"))
  before <- setwd(folder)
  on.exit(setwd(before))
  said <- system2(file.path(R.home("bin"), "R"), c("CMD", "SHLIB", "-o", basename(library), basename(source)),
                  stdout = TRUE, stderr = TRUE)
  if (!file.exists(library)) stop(name, " cannot be compiled:\n", paste(said, collapse = "\n"))
  library
}

# The name that the standard has for this platform: FMI 3.0, section 2.5.1.4; FMI 2.0, section 2.3.
this_platform <- function(version) {
  system <- switch(Sys.info()[["sysname"]], Darwin = "darwin", Windows = "windows", "linux")
  if (version == 3) paste0(sub("arm64", "aarch64", sub("x86-64", "x86_64", R.version$arch)), "-", system)
  else paste0(c(darwin = "darwin", windows = "win", linux = "linux")[[system]], 8 * .Machine$sizeof.pointer)
}

# ---- an archive of files in memory

# `entries`: a named list of raw vectors. `modes`: of those that are more than files, as Unix has them. `sizes`: what is
# said of the size of those where it is not true.
write_zip <- function(file, entries, modes = list(), sizes = list()) {
  out <- file(file, "wb")
  on.exit(close(out))
  directory <- raw()
  at <- 0
  for (i in seq_along(entries)) {
    name <- names(entries)[i]
    packed <- deflated(entries[[i]])
    size <- if (is.null(sizes[[name]])) length(entries[[i]]) else sizes[[name]]
    common <- c(little(c(20, 0x0800, 8, 0, 33), 2), packed$crc, little(c(length(packed$bytes), size), 4),
                little(c(nchar(name, "bytes"), 0), 2))
    head <- c(charToRaw("PK"), as.raw(3:4), common, charToRaw(name))
    mode <- if (is.null(modes[[name]])) 33188 else modes[[name]]  # 0100644
    directory <- c(directory, charToRaw("PK"), as.raw(1:2), little(20 + 3 * 256, 2), common, little(c(0, 0, 0), 2),
                   little(c(0, mode), 2), little(at, 4), charToRaw(name))
    writeBin(c(head, packed$bytes), out)
    at <- at + length(head) + length(packed$bytes)
  }
  n <- length(entries)
  writeBin(c(directory, charToRaw("PK"), as.raw(5:6), little(c(0, 0, n, n), 2), little(c(length(directory), at), 4),
             little(0, 2)), out)
  invisible(file)
}

little <- function(x, bytes) as.raw(unlist(lapply(x, function(one) one %/% 256^seq(0, bytes - 1) %% 256)))

# list(bytes, crc), as gzip has them between a header of ten bytes and a trailer of eight.
deflated <- function(bytes) {
  file <- tempfile()
  on.exit(unlink(file))
  connection <- gzfile(file, "wb")
  writeBin(bytes, connection)
  close(connection)
  packed <- readBin(file, "raw", file.size(file))
  n <- length(packed)
  list(bytes = packed[seq(11, n - 8)], crc = packed[n - 7:4])
}
