# Processes in which FMUs run, one for each FMU and session, kept from run to run. A process gets
# the path of a file with a request as a line, writes the answer beside it, and says that it has; it
# ends when its standard input does, or its parent.

fmu_workers <- new.env(parent = emptyenv())

most_fmu_workers <- 4         # of different FMUs; the oldest ends if there is another one
most_runs_of_worker <- 10000  # FMUs that leak memory get a new process from time to time
fmu_start_limit <- 120        # seconds for a process to start, on a busy machine
fmu_answer_line <- "answered"

# A forked session leaves the processes of the one that it came from alone.
fmu_worker_key <- function(fmu) paste(Sys.getpid(), fmu$hash)

# list(value) of a run; list(why, said) if it failed.
worker_run <- function(fmu, platform, simulator, request) {
  worker <- tryCatch(fmu_worker(fmu, platform),
                     amiss_error_worker = function(e) conditionMessage(e))
  if (is.character(worker)) return(list(why = worker))
  spent <- TRUE
  on.exit(if (spent) stop_fmu_worker(fmu))  # also if the run is interrupted
  request_file <- file.path(worker$folder, "request.rds")
  origin <- c(worker$origin, list(logging = simulator$logging))
  saveRDS(list(origin = origin, request = request), request_file, compress = FALSE)
  why <- ask_worker(worker, request_file, simulator)
  answer <- if (is.null(why)) readRDS(paste0(request_file, ".answer")) else list(why = why)
  worker$runs <- worker$runs + 1
  spent <- !is.null(why) || isTRUE(answer$fatal) || worker$runs >= most_runs_of_worker || fmu$once
  if (is.null(answer$value)) {
    said <- fmu_last_words(answer$said, file.path(worker$folder, "stderr.txt"))
    list(why = one_line(answer$why), said = c("Its last words" = said))
  } else if (all(is.finite(answer$value))) {
    list(value = answer$value)
  } else {
    list(why = "its output is not finite")
  }
}

# What an FMU said by the log of the standard, or else printed last.
fmu_last_words <- function(said, stderr) {
  if (!length(said) && is_regular_file(stderr) && isTRUE(file.size(stderr) > 0)) {
    said <- utils::tail(lines_of(tail_bytes(stderr, 5000)), 5)
  }
  if (length(said)) substr(one_line(paste(said, collapse = " ")), 1, 500)
}

tail_bytes <- function(path, most) {
  connection <- file(path, "rb")
  on.exit(close(connection))
  seek(connection, max(0, file.size(path) - most))
  readBin(connection, "raw", most)
}

# Why there is no answer, or NULL when it is there.
ask_worker <- function(worker, request_file, simulator) {
  ends <- elapsed() + simulator$time_limit
  sent <- tryCatch(!length(worker$process$write_input(paste0(request_file, "\n"))),
                   error = function(e) FALSE)
  if (!sent) return(ended_words(worker))
  repeat {
    worker$process$poll_io(as.integer(1000 * max(0, min(1, ends - elapsed()))))
    lines <- tryCatch(worker$process$read_output_lines(), error = function(e) character())
    if (fmu_answer_line %in% lines) return(NULL)
    if (!worker$process$is_alive()) return(ended_words(worker))
    if (elapsed() >= ends) return(paste("it did not end within", simulator$time_limit, "s"))
    if (folder_size(worker$folder) > 1e6 * simulator$size_limit) {
      return(paste("it wrote more than", simulator$size_limit, "MB"))
    }
  }
}

ended_words <- function(worker) {
  worker$process$wait(1000)
  status <- worker$process$get_exit_status()
  if (is.null(status)) "its process does not read any more"
  else if (status < 0) paste("its process was ended by signal", -status)
  else paste("its process ended with exit status", status)
}

# The process of an FMU, a new one if there is none that lives.
fmu_worker <- function(fmu, platform) {
  worker <- fmu_workers[[fmu_worker_key(fmu)]]
  if (!is.null(worker) && worker$process$is_alive()) return(worker)
  stop_fmu_worker(fmu)
  own <- mget(grep(paste0("^", Sys.getpid(), " "), ls(fmu_workers), value = TRUE), fmu_workers)
  if (length(own) >= most_fmu_workers) {
    oldest <- own[[which.min(vapply(own, `[[`, 0, "began"))]]
    end_worker(oldest)
    rm(list = oldest$key, envir = fmu_workers)
  }
  start_fmu_worker(fmu, platform)
}

start_fmu_worker <- function(fmu, platform) {
  worker <- new.env(parent = emptyenv())
  worker$key <- fmu_worker_key(fmu)
  worker$began <- elapsed()
  worker$runs <- 0
  worker$folder <- tempfile("fmu-worker-")
  dir.create(file.path(worker$folder, "work"), recursive = TRUE)
  worker$origin <- fmu_origin(fmu, platform)
  code <- sprintf("loadNamespace('amiss', lib.loc = %s); amiss:::serve_fmu(%d)",
                  encodeString(dirname(getNamespaceInfo("amiss", "path")), quote = "'"),
                  Sys.getpid())
  worker$process <- start_process(
    file.path(R.home("bin"), "Rscript"), c("--vanilla", "-e", code), stdin = "|", stdout = "|",
    stderr = file.path(worker$folder, "stderr.txt"), wd = file.path(worker$folder, "work"),
    cleanup_tree = TRUE,
    env = c("current", R_LIBS = paste(.libPaths(), collapse = .Platform$path.sep), R_TESTS = ""))
  fmu_workers[[worker$key]] <- worker
  ready <- FALSE
  on.exit(if (!ready) stop_fmu_worker(fmu))
  ends <- elapsed() + fmu_start_limit
  while (!ready && worker$process$is_alive() && elapsed() < ends) {
    worker$process$poll_io(1000L)
    ready <- fmu_answer_line %in% worker$process$read_output_lines()
  }
  if (ready) return(worker)
  how <- if (worker$process$is_alive()) paste("it did not answer within", fmu_start_limit, "s")
         else ended_words(worker)
  said <- fmu_last_words(NULL, file.path(worker$folder, "stderr.txt"))
  why <- paste(c(paste("the process of the FMU could not be started:", how), said),
               collapse = ". ")
  abort_input("{why}", class = "amiss_error_worker", call = NULL)
}

unpacked_fmus <- new.env(parent = emptyenv())

# What an instance is made from (fmu_run_()). The FMU is unpacked once in a session.
fmu_origin <- function(fmu, platform) {
  folder <- unpacked_fmus[[fmu$hash]]
  name <- paste0(fmu$identifier, library_extension(platform))
  binary <- function(folder) file.path(folder, "binaries", platform, name)
  if (is.null(folder) || !file.exists(binary(folder))) {
    folder <- unpack_fmu(fmu$file, platform)
    unpacked_fmus[[fmu$hash]] <- folder
  }
  list(library = binary(folder), resources = file.path(folder, "resources"), version = fmu$version,
       token = fmu$token, name = fmu$identifier)
}

library_extension <- function(platform) {
  if (grepl("darwin", platform)) ".dylib" else if (grepl("win", platform)) ".dll" else ".so"
}

stop_fmu_worker <- function(fmu) {
  key <- fmu_worker_key(fmu)
  worker <- fmu_workers[[key]]
  if (is.null(worker)) return(invisible())
  rm(list = key, envir = fmu_workers)
  end_worker(worker)
}

end_worker <- function(worker) {
  try(stop_tree(worker$process), silent = TRUE)
  try(worker$process$kill(), silent = TRUE)
  unlink(worker$folder, recursive = TRUE)
}

# The loop of such a process: `parent` is the number of the session that it serves.
serve_fmu <- function(parent) {
  descriptor <- fmu_serve_(parent)
  requests <- file("stdin", "r")
  fmu_say_(descriptor, fmu_answer_line)
  while (length(path <- readLines(requests, 1))) {
    fmu_forget_errors_()
    answer <- tryCatch({
      asked <- readRDS(path)
      fmu_run_(asked$origin, asked$request)
    }, error = function(e) list(why = conditionMessage(e), fatal = TRUE))
    saveRDS(answer, paste0(path, ".answer"), compress = FALSE)
    fmu_say_(descriptor, fmu_answer_line)
  }
}
