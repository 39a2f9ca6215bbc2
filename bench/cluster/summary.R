#!/usr/bin/env Rscript
# What bench/slurm found: Rscript bench/cluster/summary.R --plain FOLDER --cluster FOLDER --times
# FOLDER --chunk C --job-s S --ask-s S --out FILE. The first two folders hold rows, one world a
# file; --times holds who noted what and when: plain/, first/ and second/ (the calls on the cluster)
# and scheduler/ (empty jobs). --job-s and --ask-s: see session.R.

here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "..", "options.R"))
chunk <- as.integer(option("chunk"))

# Rows: bit for bit, but for the time they took.
read_rows <- function(folder) {
  files <- list.files(folder, "rds$", full.names = TRUE)
  lapply(stats::setNames(files, basename(files)), readRDS)
}
plain <- read_rows(option("plain"))
cluster <- read_rows(option("cluster"))
untimed <- function(row) row[names(row) != "wall_s"]
same <- vapply(names(plain),
               function(name) identical(untimed(plain[[name]]), untimed(cluster[[name]])), NA)
identical_rows <- all(same) && length(cluster) == length(plain)

# Notes of all jobs of a call: one row a note.
read_notes <- function(call) {
  files <- list.files(file.path(option("times"), call), full.names = TRUE)
  notes <- lapply(files, function(f)
    cbind(job = basename(f), utils::read.table(f, col.names = c("what", "world", "at"))))
  do.call(rbind, notes)
}
world_seconds <- function(notes) {
  both <- merge(notes[notes$what == "begun", ], notes[notes$what == "done", ],
                by = c("job", "world"))
  both$at.y - both$at.x
}
first <- read_notes("first")
second <- read_notes("second")
done_first <- first$world[first$what == "done"]
begun_second <- second$world[second$what == "begun"]

# Seconds that a whole job costs beside its worlds; `between` is from a node's end of one job to the
# next submission.
job_seconds <- function(notes) {
  at <- function(what, which)
    tapply(notes$at[notes$what == what], notes$job[notes$what == what], which)
  jobs <- names(at("ended", max))
  jobs <- jobs[order(at("submitted", min)[jobs])]
  part <- function(from, to) unname(to[jobs] - from[jobs])
  node <- sub("-.*", "", jobs)
  between <- unlist(lapply(split(jobs, node),
                           function(j)
                             at("submitted", min)[j[-1]] - at("ended", max)[j[-length(j)]]))
  lapply(list(wait_to_start = part(at("submitted", min), at("started", min)),
              start_r = part(at("started", min), at("begun", min)),
              finish = part(at("done", max), at("ended", max)), between_jobs = between),
         stats::median)
}
both <- rbind(first, second)
world_s <- mean(world_seconds(both))
job <- job_seconds(first)
overhead_s <- sum(unlist(job), na.rm = TRUE)  # `between` is unknown where no node had two jobs
scheduler <- read_notes("scheduler")
scheduler_rate <- sum(scheduler$what == "started") / diff(range(scheduler$at))
job_s <- as.numeric(option("job-s"))
ask_s <- as.numeric(option("ask-s"))

# Worlds an hour: what the cores do, each job paying its overhead, unless jobs cannot be started
# that fast. Before it starts the next job, a session asks one running job after the other whether
# it has ended: half of them on average. More workers than a session can serve are not used.
formula <- paste(
  "max over workers <= cores of 3600 * chunk * min(workers / (chunk * world_s + overhead_s),",
  "scheduler_jobs_per_s, sessions / (job_s + ask_s * workers / sessions / 2))")
per_hour <- function(cores, chunk, sessions) {
  workers <- seq_len(cores)
  max(3600 * chunk * pmin(workers / (chunk * world_s + overhead_s), scheduler_rate,
                          sessions / (job_s + ask_s * workers / sessions / 2)))
}
cores <- c(1, 2, 10, 100, 1000, 10000)
long_chunk <- max(1, floor((3600 - overhead_s) / world_s))
planning <- data.frame(cores = cores, short_jobs_one_session = vapply(cores, per_hour, 0, chunk, 1),
                       long_jobs_one_session = vapply(cores, per_hour, 0, long_chunk, 1),
                       long_jobs_session_per_100_cores = mapply(per_hour, cores, long_chunk,
                                                                ceiling(cores / 100)))

command <- function(...) system2(..., stdout = TRUE)
version_of <- function(name) as.character(utils::packageVersion(name))
packages <- c("amiss", "future", "future.apply", "future.batchtools", "batchtools")
elapsed <- function(notes) diff(range(notes$at))
result <- list(
  versions = c(list(R = paste(R.version$major, R.version$minor, sep = "."),
                    slurm = command("sinfo", "--version"),
                    debian = readLines("/etc/debian_version")),
               lapply(stats::setNames(packages, packages), version_of)),
  worlds = length(plain), seed = plain[[1]]$seed, chunk = chunk, workers = 2,
  identical = identical_rows, differing = I(names(plain)[!same]),
  kill = list(finished_in_first_call = length(done_first),
              interrupted = I(setdiff(first$world[first$what == "begun"], done_first)),
              computed_in_second_call = I(begun_second),
              computed_again = I(intersect(done_first, begun_second))),
  seconds = list(world = world_s, world_plain = mean(world_seconds(read_notes("plain"))),
                 plain = elapsed(read_notes("plain")), first_call = elapsed(first),
                 second_call = elapsed(second), job = job, job_overhead = overhead_s),
  planning = list(formula = formula, measured_up_to_cores = 2, world_s = world_s,
                  overhead_s = overhead_s, scheduler_jobs_per_s = scheduler_rate, job_s = job_s,
                  ask_s = ask_s,
                  chunk_short = chunk, chunk_long = long_chunk, worlds_per_hour = planning))
write_rows(result, option("out"))

say <- function(what, ...) cat(sprintf("%-30s ", what), sprintf(...), "\n", sep = "")
say("rows identical", "%s, %d worlds", if (identical_rows) "yes, bit for bit" else "NO",
    length(plain))
say("finished by the first call", "%d; computed again %d", length(done_first),
    length(result$kill$computed_again))
say("interrupted by the kill", "%d; computed by the second call %d",
    length(result$kill$interrupted), length(begun_second))
say("seconds a world", "%.1f (plain session %.1f)", world_s, result$seconds$world_plain)
say("seconds a job, beside worlds", "%s",
    paste(sprintf("%s %.1f", gsub("_", " ", names(job)), unlist(job)), collapse = ", "))
say("jobs a second", "Slurm starts %.0f; one R session serves %.1f", scheduler_rate, 1 / job_s)
say("seconds to ask about a job", "%.3f", ask_s)
cat("planned worlds an hour, with jobs of", chunk, "worlds; of", long_chunk,
    "(an hour); these, with a session for each 100 cores\n")
cat(sprintf("%6d cores %10.0f %10.0f %10.0f\n", cores, planning[[2]], planning[[3]], planning[[4]]),
    sep = "")
if (!identical_rows) stop("rows differ: ", toString(names(plain)[!same]), call. = FALSE)
if (length(result$kill$computed_again)) stop("finished worlds were computed again", call. = FALSE)
