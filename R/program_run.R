# One run of a program: the folder that it has, its processes, and how finished runs are kept.

# list(value, kept) of one run, kept or made; list(why, directory, stderr) if it failed.
program_run <- function(simulator, values, csv, shared, rows) {
  templates <- lapply(simulator$templates, render, values)
  command <- c(simulator$command[1], render(simulator$command[-1], values))
  key <- rlang::hash(list(shared, templates, command))
  file <- file.path(simulator$cache, paste0(key, ".rds"))
  kept <- read_kept(file, key, function(run) is.numeric(run) && length(run) == rows && all(is.finite(run)))
  if (!is.null(kept)) return(list(value = kept$value))
  inputs <- c(templates, stats::setNames(list(csv), simulator$drivers))
  run <- with_run_folder(simulator$cache, key, function(folder) {
    for (attempt in 0:simulator$retries) {
      unlink(folder, recursive = TRUE)
      value <- tryCatch({
        write_inputs(folder, inputs)
        run_program(simulator, command, folder, rows)
      }, error = function(e) cli::ansi_strip(conditionMessage(e)))
      if (is.numeric(value)) return(list(value = value))
    }
    c(list(why = value), keep_failed(folder, file.path(simulator$cache, paste0("failed-", key))))
  })
  if (!is.null(run$value)) run$kept <- store_value(run$value, file, key)
  run
}

# Evaluates `work` of a folder that is removed then. Its lock is the operating system's: what nobody holds was left by a
# session that was killed.
with_run_folder <- function(cache, key, work) {
  folder <- tempfile(paste0("running-", substr(key, 1, 8), "-"), cache)
  file <- paste0(folder, ".lock")
  lock <- tryCatch(filelock::lock(file, timeout = 0), error = function(e) NULL)
  if (is.null(lock)) return(list(why = paste("no file can be made in", cache)))
  on.exit({
    unlink(c(folder, file), recursive = TRUE)
    filelock::unlock(lock)
  })
  work(folder)
}

remove_abandoned <- function(cache) {
  for (file in dir(cache, "^running-.*[.]lock$", full.names = TRUE)) {
    lock <- tryCatch(filelock::lock(file, timeout = 0), error = function(e) NULL)
    if (is.null(lock)) next
    unlink(c(sub("[.]lock$", "", file), file), recursive = TRUE)
    filelock::unlock(lock)
  }
}

# Files of bytes, or of lines, in a new folder, each whole.
write_inputs <- function(folder, inputs) {
  for (name in names(inputs)) {
    path <- file.path(folder, name)
    dir.create(dirname(path), recursive = TRUE, showWarnings = FALSE)
    bytes <- inputs[[name]]
    if (!is.raw(bytes)) bytes <- charToRaw(paste0(bytes, "\n", collapse = ""))
    whole <- tryCatch(suppressWarnings({
      writeBin(bytes, path)
      file.size(path) == length(bytes)
    }), error = function(e) FALSE)
    if (!isTRUE(whole)) stop("its file ", name, " could not be written: is the disk full?")
  }
}

# The output of one run of the program; an error says why there is none.
run_program <- function(simulator, command, folder, rows) {
  ends <- elapsed() + simulator$time_limit
  process <- processx::process$new(command[1], command[-1], wd = folder, stdout = file.path(folder, "stdout.txt"),
                                   stderr = file.path(folder, "stderr.txt"), cleanup_tree = TRUE)
  wait_for(process, ends, simulator, folder)
  status <- process$get_exit_status()
  if (status < 0) stop("it was ended by signal ", -status)
  if (status > 0) stop("it ended with exit status ", status)
  out <- until(ends, simulator$time_limit, {
    if (is.function(simulator$output)) {
      remove_endless(folder)
      simulator$output(folder)
    } else {
      read_output(simulator$output, folder, rows)
    }
  })
  if (!is.numeric(out)) stop("its output is of class ", class(out)[1], ", not numeric")
  if (length(out) != rows) stop("its output has ", length(out), " rows, where ", rows, " were expected")
  if (!all(is.finite(out))) stop("its output is not finite in row ", which(!is.finite(out))[1])
  as.numeric(out)
}

# Waits for the process alone: what it started, and leaves behind, ends with it.
wait_for <- function(process, ends, simulator, folder) {
  stop_with_session(process$get_pid())
  on.exit({
    process$kill_tree()
    stop_with_session(NULL)
  })
  pause <- 0.05
  repeat {
    process$wait(1000 * max(min(pause, ends - elapsed()), 0))
    if (!process$is_alive()) return(invisible())
    if (elapsed() >= ends) stop_late(simulator$time_limit)
    if (folder_size(folder) > 1e6 * simulator$size_limit) stop("it wrote more than ", simulator$size_limit, " MB")
    pause <- min(2 * pause, 1)
  }
}

stop_late <- function(time_limit) {
  stop("it did not end within ", time_limit, " s, or its output could not be read in time")
}

# Evaluates R code that may not go on after a time.
until <- function(ends, time_limit, code) {
  setTimeLimit(elapsed = max(ends - elapsed(), 1e-3), transient = TRUE)
  on.exit(setTimeLimit())
  tryCatch(code, error = function(e) if (elapsed() >= ends) stop_late(time_limit) else stop(e))
}

# What lies in a folder itself, not behind its links.
folder_contents <- function(folder) fs::dir_info(folder, all = TRUE, recurse = TRUE, fail = FALSE)

folder_size <- function(folder) sum(as.numeric(folder_contents(folder)$size), na.rm = TRUE)

# Pipes and links to devices: reading them would never end.
remove_endless <- function(folder) {
  there <- folder_contents(folder)
  special <- there$path[!there$type %in% c("file", "directory")]
  unlink(special[!is_regular_file(special) & !dir.exists(special)])
}

# The folder of a failed run under another name, with what is long in it shortened, and the last lines of its stderr.
keep_failed <- function(folder, failed) {
  unlink(failed, recursive = TRUE)
  if (!dir.exists(folder) || !file.rename(folder, failed)) return(list())
  there <- folder_contents(failed)
  for (path in there$path[there$type == "file" & there$size > kept_bytes]) shorten_file(path)
  stderr <- file.path(failed, "stderr.txt")
  lines <- if (is_regular_file(stderr)) utils::tail(lines_of(file_bytes(stderr)), 5)
  list(directory = failed, stderr = substr(one_line(lines), 1, 500))
}

kept_bytes <- 1e6  # of each file of a failed run

# Begin and end of a file.
shorten_file <- function(path) {
  size <- file.size(path)
  part <- function(from) {
    connection <- file(path, "rb")
    on.exit(close(connection))
    seek(connection, from)
    readBin(connection, "raw", kept_bytes / 2)
  }
  gap <- charToRaw(sprintf("\n[... %.0f bytes were left out here ...]\n", size - kept_bytes))
  writeBin(c(part(0), gap, part(size - kept_bytes / 2)), path)
}

guard <- new.env(parent = emptyenv())

# Names the program that is to be stopped if this session is killed, by its number, or none. A shell beside the session
# reads what it writes; when that ends, it stops the process group that was named last. On Windows processx does it.
stop_with_session <- function(pid) {
  if (.Platform$OS.type != "unix") return(invisible())
  if (!identical(guard$session, Sys.getpid()) || !guard$shell$is_alive()) {
    if (is.null(pid)) return(invisible())
    script <- "while read line; do group=$line; done; [ \"$group\" = none ] || kill -s KILL -- \"-$group\""
    guard$shell <- processx::process$new("sh", c("-c", script), stdin = "|")
    guard$session <- Sys.getpid()
  }
  guard$shell$write_input(paste0(if (is.null(pid)) "none" else pid, "\n"))
  invisible()
}

# ---- templates

# Byte by byte, as templates may be in any encoding.
render <- function(text, values) {
  if (is.raw(text)) return(text)
  for (name in names(values)) {
    quoted <- paste0("\\Q", gsub("\\E", "\\E\\\\E\\Q", enc2utf8(name), fixed = TRUE), "\\E")
    text <- gsub(paste0("\\{\\{\\s*", quoted, "\\s*\\}\\}"), sprintf("%.15g", values[[name]]), text, perl = TRUE,
                 useBytes = TRUE)
  }
  Encoding(text[Encoding(text) == "bytes"]) <- "unknown"
  text
}

lines_of <- function(bytes) {
  connection <- rawConnection(bytes)
  on.exit(close(connection))
  readLines(connection, warn = FALSE)
}
