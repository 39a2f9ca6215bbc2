# One run of an FMU: what the engine is asked, and how its answer is kept.

# All of a run but the values of its free parameters, for fmu_run_().
fmu_request <- function(simulator, fmu, drivers, step_h, time, call = rlang::caller_env()) {
  of_engine <- function(names) {
    rows <- fmu$variables[match(names, fmu$variables$name), ]
    list(reference = as.numeric(rows$reference), type = as.integer(rows$code))
  }
  fixed <- simulator$fixed
  text <- vapply(fixed, function(value) if (is.character(value)) enc2utf8(value) else "", "")
  number <- vapply(fixed, function(value) if (is.character(value)) 0 else as.numeric(value), 0)
  list(free = of_engine(names(simulator$parameters)),
       fixed = c(of_engine(as.character(names(fixed))),
                 list(number = as.numeric(number), text = as.character(text))),
       inputs = of_engine(simulator$inputs), drivers = unname(input_columns(drivers, simulator)),
       output = of_engine(simulator$output),
       start_s = segment_start(simulator$start, time[1], step_h, call), row_s = 3600 * step_h,
       steps = as.integer(simulator$steps_per_row), averaged = simulator$averaged,
       tolerance = simulator$tolerance %||% 0)
}

# A column for each input; a matrix without columns has no names to ask for.
input_columns <- function(drivers, simulator) {
  if (length(simulator$inputs)) drivers[, names(simulator$inputs), drop = FALSE]
  else matrix(0, nrow(drivers), 0)
}

# Rows are stamped at their end.
segment_start <- function(start, time, step_h, call) {
  if (!is.function(start)) return(as.numeric(start))
  seconds <- start(if (is.numeric(time)) time - step_h else time - 3600 * step_h)
  if (checkmate::test_number(seconds, finite = TRUE)) return(as.numeric(seconds))
  abort_input(paste("The function {.arg start} returned {seen(seconds)}; a number of seconds was",
                    "expected."), call = call)
}

# list(value, kept) of one run, kept or made; list(why, said) if it failed.
fmu_run <- function(simulator, fmu, platform, request, values) {
  point <- as.numeric(values[names(simulator$parameters)])
  settings <- list(reference = c(request$free$reference, request$fixed$reference),
                   type = c(request$free$type, request$fixed$type),
                   number = c(point, request$fixed$number),
                   text = c(rep("", length(point)), request$fixed$text))
  request <- c(list(settings = settings), request[setdiff(names(request), c("free", "fixed"))])
  if (is.null(simulator$cache)) return(made_fmu_run(simulator, fmu, platform, request))
  key <- rlang::hash(list(fmu$hash, request))
  file <- file.path(simulator$cache, paste0(key, ".rds"))
  rows <- nrow(request$drivers)
  kept <- read_kept(file, key,
                    function(run) is.numeric(run) && length(run) == rows && all(is.finite(run)))
  if (!is.null(kept)) return(list(value = kept$value))
  run <- made_fmu_run(simulator, fmu, platform, request)
  if (!is.null(run$value)) run$kept <- store_value(run$value, file, key)
  run
}

made_fmu_run <- function(simulator, fmu, platform, request) {
  for (attempt in 0:simulator$retries) {
    run <- worker_run(fmu, platform, simulator, request)
    if (!is.null(run$value)) return(run)
    if (attempt < simulator$retries) stop_fmu_worker(fmu)
  }
  run
}
