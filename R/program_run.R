# One run of a program: the folder that it has, its processes, and how finished runs are kept.

# What the runs of one call share, ready to be made: list(steps, files, inputs, expected, id, jobs,
# ...), a job for each row of `values`. All that can be wrong with numbers and files is refused
# here, before anything is executed.
plan_runs <- function(simulator, values, drivers, step_h, time, call = rlang::caller_env()) {
  check_files_same(simulator$files, call)
  inputs <- drivers_bytes(simulator$drivers, drivers_table(drivers, step_h, time), step_h, call)
  expected <- list(time = time, step_h = step_h, rows = nrow(drivers),
                   offset = drivers_offset(simulator$drivers))
  steps <- lapply(as_steps(simulator$command, call), find_program, simulator = simulator,
                  call = call)
  shared <- rlang::hash(list(inputs, unname(tools::md5sum(command_files(steps))), simulator$version,
                             plain(simulator$output), simulator$files[c("name", "md5")],
                             lapply(steps, what_counts)))
  texts <- compiled_texts(simulator, steps)
  id <- simulator_id(simulator)
  jobs <- lapply(seq_len(nrow(values)), function(m) {
    point <- stats::setNames(values[m, ], colnames(values))[names(simulator$parameters)]
    filled <- Map(function(text, place) fill_text(text, point, simulator$width, place, call), texts,
                  names(texts))
    job_of(filled, simulator, steps, paste0(id, "-", rlang::hash(list(shared, unname(filled)))))
  })
  list(steps = steps, files = simulator$files, inputs = inputs, expected = expected, id = id,
       jobs = jobs,
       simulator = simulator[c("cache", "output", "time_limit", "size_limit", "retries", "keep")])
}

# Where a program is found and how long it may take do not change what it writes.
what_counts <- function(step) unclass(step)[setdiff(names(step), c("program", "time_limit"))]

# A step with `program`, the path of its program, or with `within`, its name in the run's folder.
find_program <- function(step, simulator, call) {
  word <- sub("^[.]/", "", step$command[1])
  if (word %in% c(simulator$files$name, names(simulator$templates))) {
    step$within <- word
    return(step)
  }
  step$program <- unname(Sys.which(step$command[1]))
  if (!nzchar(step$program)) {
    abort_input(c("The program {.file {step$command[1]}} of {.val {simulator$name}} is not there.",
                  i = "Install it, or give its path in {.arg command}."), call = call)
  }
  step
}

command_files <- function(steps) {
  unlist(lapply(steps, function(step) c(step$program, step$command[is_regular_file(step$command)])))
}

# All texts in which a placeholder may stand, ready to be filled in, by what they are called in
# messages.
compiled_texts <- function(simulator, steps) {
  compile_texts(places_of(simulator$templates, steps), names(simulator$parameters))
}

places_of <- function(templates, steps) {
  numbered <- function(what)
    if (length(steps) > 1) paste(what, "of step", seq_along(steps)) else what
  commands <- lapply(steps, function(step) step$command[-1])
  inputs <- lapply(steps, function(step) if (is.list(step$input)) character() else step$input)
  c(templates, stats::setNames(commands, numbered("the command")),
    stats::setNames(inputs, numbered("the input")))
}

# What one run differs by from the others: the texts filled in, in the order of places_of().
job_of <- function(filled, simulator, steps, key) {
  templates <- filled[seq_along(simulator$templates)]
  of_steps <- unname(filled[length(templates) + seq_len(2 * length(steps))])
  commands <- of_steps[seq_along(steps)]
  list(key = key, templates = templates,
       commands = Map(function(step, words) c(step$command[1], words), steps, commands),
       inputs = of_steps[length(steps) + seq_along(steps)])
}

# Distinguishes the runs of a simulator from those of others in the same cache.
simulator_id <- function(simulator) {
  of <- simulator[c("templates", "files", "drivers", "version", "boundary", "lead_in", "before")]
  steps <- lapply(as_steps(simulator$command), what_counts)
  substr(content_hash(plain(c(of, list(steps, names(simulator$parameters), simulator$output)))),
         1, 8)
}

# list(value, seconds, found) of one run, found or made; list(why, directory, said) if it failed.
program_run <- function(plan, job) {
  simulator <- plan$simulator
  file <- file.path(simulator$cache, paste0(job$key, ".rds"))
  kept <- read_kept(file, job$key, function(run) is_run(run, plan$expected$rows))
  if (!is.null(kept)) {
    return(list(value = as.numeric(kept$value), seconds = attr(kept$value, "seconds"),
                found = TRUE))
  }
  run <- with_run_folder(simulator$cache, job$key, function(folder) try_to_run(plan, job, folder))
  if (!is.null(run$value))
    run$kept <- store_value(structure(run$value, seconds = run$seconds), file, job$key)
  run
}

is_run <- function(run, rows) is.numeric(run) && length(run) == rows && all(is.finite(run))

try_to_run <- function(plan, job, folder) {
  for (attempt in 0:plan$simulator$retries) {
    unlink(folder, recursive = TRUE)
    began <- elapsed()
    value <- tryCatch({
      make_folder(plan, job, folder)
      run_program(plan, job, folder)
    }, error = identity)
    if (!inherits(value, "error")) {
      keep_good(plan, job, folder)
      return(list(value = value, seconds = elapsed() - began))
    }
  }
  said <- last_words(plan$steps, value$step %||% length(plan$steps), folder)
  why <- cli::ansi_strip(conditionMessage(value))
  c(list(why = why),
    keep_failed(folder, file.path(plan$simulator$cache, paste0("failed-", job$key))),
    said = list(said))
}

# All that a run reads, in a new folder.
make_folder <- function(plan, job, folder) {
  dir.create(folder, recursive = TRUE, showWarnings = FALSE)
  copy_files(plan$files, folder)
  has_text <- vapply(plan$steps, function(step) !is.null(step$input) && !is.list(step$input), NA)
  stdin <- stats::setNames(job$inputs, stdin_names(length(plan$steps)))[has_text]
  write_inputs(folder, c(job$templates, plan$inputs, stdin))
  for (within in unlist(lapply(plan$steps, `[[`, "folder"))) {
    dir.create(file.path(folder, within), recursive = TRUE, showWarnings = FALSE)
  }
}

stdin_names <- function(steps) paste0("stdin", if (steps > 1) paste0("-", seq_len(steps)), ".txt")

# Evaluates `work` of a folder that is removed then. Its lock is the operating system's: what nobody
# holds was left by a session that was killed.
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

# The output of one run of the program; an error says why there is none, one of a step has its
# number.
run_program <- function(plan, job, folder) {
  simulator <- plan$simulator
  ends <- elapsed() + simulator$time_limit
  for (k in seq_along(plan$steps)) run_step(plan, job, k, folder, ends)
  out <- until(ends, simulator$time_limit, {
    if (is.function(simulator$output)) {
      remove_endless(folder)
      simulator$output(folder)
    } else {
      read_run_output(simulator$output, folder, plan$expected)
    }
  })
  rows <- plan$expected$rows
  if (!is.numeric(out)) stop("its output is of class ", class(out)[1], ", not numeric")
  if (length(out) != rows)
    stop("its output has ", length(out), " rows, where ", rows, " were expected")
  if (!all(is.finite(out))) stop("its output is not finite in row ", which(!is.finite(out))[1])
  as.numeric(out)
}

run_step <- function(plan, job, k, folder, ends) {
  step <- plan$steps[[k]]
  of <- if (length(plan$steps) > 1)
    paste0("step ", k, " of ", length(plan$steps), " (", basename(step$command[1]), "): ")
  tryCatch({
    status <- step_status(plan, job, k, folder, ends)
    why <- step_failure(step, status, folder)
    if (!is.null(why)) stop(why)
  }, error = function(e) {
    stop(structure(list(message = paste0(of, conditionMessage(e)), call = NULL, step = k),
                   class = c("amiss_step_failed", "error", "condition")))
  })
}

# Starts a step and waits for its end: the exit status.
step_status <- function(plan, job, k, folder, ends) {
  step <- plan$steps[[k]]
  limit <- min(step$time_limit, plan$simulator$time_limit)
  if (!is.null(step$time_limit)) ends <- min(ends, elapsed() + step$time_limit)
  stdin <- if (is.list(step$input)) step$input$file
           else if (!is.null(step$input)) stdin_names(length(plan$steps))[k]
  program <- if (is.null(step$within)) job$commands[[k]][1] else file.path(folder, step$within)
  if (!is.null(stdin) && !is_regular_file(file.path(folder, stdin)))
    stop("there is no file ", stdin, " for its input")
  process <- start_process(program, job$commands[[k]][-1],
                           wd = file.path(folder, step$folder %||% "."),
                           stdin = if (!is.null(stdin)) file.path(folder, stdin),
                           stdout = file.path(folder, step$stdout),
                           stderr = file.path(folder, step$stderr), cleanup_tree = TRUE)
  wait_for(process, ends, limit, plan$simulator$size_limit, folder)
  process$get_exit_status()
}

# Why a step that ended has failed, or NULL.
step_failure <- function(step, status, folder) {
  if (status < 0) return(paste("it was ended by signal", -status))
  said <- log_failure(step,
                      stats::setNames(file.path(folder, c(step$stdout, step$stderr, step$log)),
                                      c("standard output", "standard error", step$log)))
  ended <- if (!is.null(step$status) && !status %in% step$status)
    paste("it ended with exit status", status)
  if (length(c(ended, said))) return(paste(c(ended, said), collapse = "; "))
  paths <- file.path(folder, step$makes)
  empty <- step$makes[!(is_regular_file(paths) & file.size(paths) %in% 0 == FALSE)]
  if (length(empty))
    paste0("it ended with exit status ", status, " and wrote nothing into ", empty[1])
}

# Waits for the process alone: what it started, and leaves behind, ends with it.
wait_for <- function(process, ends, time_limit, size_limit, folder) {
  stop_with_session(process$get_pid())
  on.exit({
    stop_tree(process)
    stop_with_session(NULL)
  })
  pause <- 0.05
  repeat {
    process$wait(1000 * max(min(pause, ends - elapsed()), 0))
    if (!process$is_alive()) return(invisible())
    if (elapsed() >= ends) stop_late(time_limit)
    if (folder_size(folder) > 1e6 * size_limit) stop("it wrote more than ", size_limit, " MB")
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

# The folder of a failed run under another name, with what is long in it shortened.
keep_failed <- function(folder, failed) {
  unlink(failed, recursive = TRUE)
  if (!dir.exists(folder) || !file.rename(folder, failed)) return(list())
  there <- folder_contents(failed)
  for (path in there$path[there$type == "file" & there$size > kept_bytes]) {
    writeBin(file_ends(path, kept_bytes), path)
  }
  list(directory = failed)
}

kept_bytes <- 1e6  # of each file of a failed run

# The ends of what a step wrote, and of what the one before it did: the cause often stands there.
last_words <- function(steps, k, folder) {
  words <- lapply(c(k, if (k > 1) k - 1), function(j) {
    step <- steps[[j]]
    of <- if (length(steps) > 1) paste0(" of step ", j, " (", basename(step$command[1]), ")")
    files <- c("standard output" = step$stdout, "standard error" = step$stderr,
               stats::setNames(nm = step$log))
    said <- vapply(file.path(folder, files), end_of_file, "")
    stats::setNames(said, paste0("End of ", names(files), of))
  })
  words <- unlist(words)
  words[nzchar(words)]
}

# The last lines of a file in one, or nothing.
end_of_file <- function(path) {
  if (!is_regular_file(path) || file.size(path) %in% 0) return("")
  bytes <- if (file.size(path) > 1e5) file_ends(path, 1e5) else file_bytes(path)
  substr(paste(one_line(utils::tail(lines_of(bytes[bytes != as.raw(0)]), 5)), collapse = " "),
         1, 500)
}

# The folder of a run that succeeded under another name, up to the number that is to be kept.
keep_good <- function(plan, job, folder) {
  if (plan$simulator$keep < 1 ||
      length(kept_folders(plan$simulator$cache, plan$id)) >= plan$simulator$keep)
    return()
  to <- file.path(plan$simulator$cache, paste0("kept-", job$key))
  unlink(to, recursive = TRUE)
  file.rename(folder, to)
}

kept_folders <- function(cache, id) {
  found <- dir(cache, paste0("^kept-", id, "-"), full.names = TRUE)
  found[dir.exists(found)]
}

# What is kept of the runs of a simulator: list(runs, seconds, folders), the seconds of a typical
# run, or NULL.
kept_runs <- function(simulator) {
  id <- simulator_id(simulator)
  files <- dir(simulator$cache, paste0("^", id, "-.*[.]rds$"), full.names = TRUE)
  looked <- utils::head(files[order(file.mtime(files), decreasing = TRUE)], 10)
  seconds <- unlist(lapply(looked, function(file) {
    kept <- tryCatch(unpack(readRDS(file), sub("[.]rds$", "", basename(file))),
                     error = function(e) NULL)
    attr(kept$value, "seconds")
  }))
  list(runs = length(files), seconds = if (length(seconds)) stats::median(seconds),
       folders = kept_folders(simulator$cache, id))
}

guard <- new.env(parent = emptyenv())

# Names the program that is to be stopped if this session is killed, by its number, or none. A shell
# beside the session reads what it writes; when that ends, it stops the process group that was named
# last. On Windows processx does it.
stop_with_session <- function(pid) {
  if (.Platform$OS.type != "unix") return(invisible())
  if (!identical(guard$session, Sys.getpid()) || !guard$shell$is_alive()) {
    if (is.null(pid)) return(invisible())
    script <-
      "while read line; do group=$line; done; [ \"$group\" = none ] || kill -s KILL -- \"-$group\""
    guard$shell <- start_process("sh", c("-c", script), stdin = "|")
    guard$session <- Sys.getpid()
  }
  guard$shell$write_input(paste0(if (is.null(pid)) "none" else pid, "\n"))
  invisible()
}
