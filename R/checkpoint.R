# Finished work kept in files, so that an interrupted run goes on where it stopped.

# A function that returns a value kept under a key, or evaluates and keeps it, with the runs that it
# took. What is kept belongs to one set of arguments only: its hash is the file's name. What cannot
# be kept or read again costs time, never the run.
checkpoint_keeper <- function(folder, arguments, call = rlang::caller_env()) {
  if (is.null(folder)) return(function(name, value) value)
  check_checkpoint(folder, call)
  key <- list(plain(arguments), as.character(utils::packageVersion("amiss")))
  function(name, value) {
    id <- content_hash(list(key, name))
    file <- file.path(folder, paste0("amiss-", id, ".rds"))
    kept <- read_kept(file, id)
    if (!is.null(kept)) {
      count_runs(kept$value$runs)
      return(kept$value$value)
    }
    before <- runs_so_far()
    force(value)
    keep_value(list(value = value, runs = runs_so_far() - before), file, id)
    # As it will be read again: which environments are one and which are copies is part of later
    # keys.
    unserialize(serialize(value, NULL))
  }
}

# The seed of work that is kept in a folder. One that was drawn is kept as well: with another,
# nothing would be found.
kept_seed <- function(seed, folder, call = rlang::caller_env()) {
  if (!is.null(seed) || is.null(folder)) return(pick_seed(seed, call))
  check_checkpoint(folder, call)
  file <- file.path(folder, "amiss-seed.rds")
  kept <- read_kept(file, "seed")$value
  if (is.null(kept)) {
    kept <- pick_seed(NULL)
    keep_value(kept, file, "seed")
  }
  kept
}

check_checkpoint <- function(folder, call) {
  check_input(checkmate::check_string(folder, min.chars = 1), "checkpoint", call = call)
  check_folder_possible(folder, "checkpoint", call)
}

# Whether a folder is there, or can be made, and written.
check_folder_possible <- function(folder, name, call = rlang::caller_env()) {
  bytes <- nchar(folder, "bytes")
  if (bytes > longest_path) {
    abort_input(paste("{.arg {name}} cannot be used: a path may have {longest_path} bytes, this",
                      "one has {bytes}. Give a shorter one."), call = call)
  }
  there <- folder
  while (!file.exists(there) && there != dirname(there)) there <- dirname(there)
  if (dir.exists(there) && file.access(there, 2) == 0) return(invisible(TRUE))
  abort_input(paste("{.arg {name}} = {.file {folder}} cannot be used: {.file {there}} is",
                    "{if (dir.exists(there)) 'not yours to write' else 'a file, not a folder'}."),
              call = call)
}

# NULL if there is none, or none that is whole, of this key and valid.
read_kept <- function(file, id, valid = function(value) TRUE) {
  if (!file.exists(file)) return(NULL)
  kept <- tryCatch(suppressWarnings(if (is_regular_file(file)) unpack(readRDS(file), id)),
                   error = function(e) NULL)
  if (!is.null(kept) && !valid(kept$value)) kept <- NULL
  if (is.null(kept))
    cli::cli_inform(c("!" = paste("The kept file {.file {file}} is damaged or not from this",
                                  "package; its work is done again.")),
                    class = "amiss_message_kept")
  kept
}

# The value as bytes beside their hash: a change of any of them is seen.
pack <- function(value, id) {
  bytes <- serialize(value, NULL)
  list(amiss = "kept", id = id, hash = rlang::hash(bytes), bytes = bytes)
}

unpack <- function(packed, id) {
  whole <- is.list(packed) && identical(packed$amiss, "kept") && identical(packed$id, id) &&
    identical(packed$hash, rlang::hash(packed$bytes))
  if (whole) list(value = unserialize(packed$bytes))
}

keep_value <- function(value, file, id, write = saveRDS) {
  if (!store_value(value, file, id, write)) tell_unkept(dirname(file))
}

tell_unkept <- function(folder) {
  cli::cli_inform(c("!" = paste("What is finished could not be kept in {.file {folder}}; the work",
                                "goes on without it."), i = "Is the disk full?"),
                  class = "amiss_message_kept")
}

# Written under a name of its own, read back, then renamed: under its name a file is whole. Whether
# this was done.
store_value <- function(value, file, id, write = saveRDS) {
  folder <- dirname(file)
  dir.create(folder, recursive = TRUE, showWarnings = FALSE)
  part <- tempfile("amiss-part-", folder)
  on.exit(unlink(part))
  packed <- pack(value, id)
  tryCatch(suppressWarnings({
    write(packed, part)
    identical(readRDS(part), packed) && file.rename(part, file)
  }), error = function(e) FALSE)
}

# Removes what a keeper made in a folder, and the folder if nothing else is in it.
remove_kept <- function(folder) {
  unlink(dir(folder, "^amiss-(([0-9a-f]{32}|seed)[.]rds|part-[0-9a-f]+)$", full.names = TRUE))
  remove_empty(folder)
}

# The same in the folders of a study, which are named by a hash.
remove_stages <- function(stages) {
  for (folder in dir(stages, "^[0-9a-f]{32}$", full.names = TRUE)) remove_kept(folder)
  remove_empty(stages)
}

remove_empty <- function(folder) {
  if (dir.exists(folder) && !length(dir(folder, all.files = TRUE, no.. = TRUE)))
    unlink(folder, recursive = TRUE)
}

# The same for equal contents in every session: version 2 knows no compact forms of vectors.
content_hash <- function(x) rlang::hash(serialize(x, NULL, version = 2))

# A value as plain lists that are equal where it would work alike: functions as their text and all
# that they capture, by value, environments as their contents. Packages are their version, and of
# the global environment only what a function names.
plain <- function(x, seen = new.env()) {
  if (is.environment(x)) return(plain_environment(x, seen))
  if (typeof(x) == "externalptr") seen[["pointer"]] <- TRUE
  if (is.primitive(x)) return(deparse(x))
  if (is.function(x)) return(list(code(x), plain(environment(x), seen), named_globals(x, seen)))
  if (is.symbol(x)) return(as.character(x))
  attributes <- attributes(x)
  attributes <- attributes[setdiff(names(attributes),
                                   c("names", "srcref", "srcfile", "wholeSrcref"))]
  values <- if (is.language(x)) code(x) else if (is.list(x)) lapply(unclass(x), plain, seen) else x
  if ((is.language(x) || is.list(x)) && length(attributes))
    list(values, lapply(attributes, plain, seen))
  else values
}

code <- function(x) deparse(x, control = c("keepNA", "keepInteger", "niceNames", "digits17"))

plain_environment <- function(x, seen) {
  if (isNamespace(x))
    return(c("package", getNamespaceName(x), as.character(getNamespaceVersion(x))))
  name <- environmentName(x)
  if (name %in% c("R_GlobalEnv", "R_EmptyEnv", "base") || startsWith(name, "package:")) return(name)
  address <- rlang::obj_address(x)
  if (!is.null(seen[[address]])) return(list("seen", seen[[address]]))
  seen[[address]] <- length(seen) + 1
  list(bindings(x, ls(x, all.names = TRUE, sorted = FALSE), seen), plain(parent.env(x), seen))
}

# What a function takes from the global environment, each once.
named_globals <- function(f, seen) {
  if (isNamespace(environment(f))) return(list())
  names <- intersect(unlist(lapply(as.list(f), all.names)), ls(globalenv(), all.names = TRUE))
  keys <- paste("global", names, recycle0 = TRUE)
  names <- names[!vapply(keys, exists, NA, envir = seen, inherits = FALSE)]
  for (name in names) seen[[paste("global", name)]] <- length(seen) + 1
  bindings(globalenv(), names, seen)
}

bindings <- function(x, names, seen) {
  names <- sort(names, method = "radix")
  value <- function(name) {
    if (rlang::env_binding_are_active(x, name)) return("active")
    tryCatch(plain(if (name == "...") eval(quote(list(...)), x) else get(name, x, inherits = FALSE),
                   seen),
             error = function(e) "none")
  }
  stats::setNames(lapply(names, value), names)
}
