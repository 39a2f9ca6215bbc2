# Long work shows itself: at a terminal in a line that changes (package cli), elsewhere, as in log
# files, in a line now and then; in tests and in documents that knitr makes, not at all. Help page
# of the package: options.

progress_way <- function() {
  asked <- getOption("amiss.progress")
  if (!is.null(asked)) {
    check_input(checkmate::check_choice(asked, c("bar", "lines", "none")),
                "options(amiss.progress)")
    return(asked)
  }
  unwatched <- identical(Sys.getenv("TESTTHAT"), "true") || isTRUE(getOption("knitr.in.progress"))
  if (unwatched) "none" else if (cli::is_dynamic_tty()) "bar" else "lines"
}

# Nothing is shown until `frame` ends, if it is to be quiet.
hush <- function(quiet, frame = rlang::caller_env()) {
  check_input(checkmate::check_flag(quiet), "quiet", call = frame)
  if (quiet) rlang::local_options(amiss.progress = "none", .frame = frame)
}

# A function that says what was found, with cli's markup, until `frame` ends.
progress <- function(quiet, frame = rlang::caller_env()) {
  hush(quiet, frame)
  function(text, .envir = parent.frame()) {
    if (progress_way() != "none") tell_line(text, .envir)
  }
}

# When the last line was written.
told <- new.env(parent = emptyenv())

elapsed <- function() proc.time()[["elapsed"]]

tell_line <- function(text, .envir = parent.frame()) {
  cli::cli_alert_info(text, .envir = .envir)
  told$at <- elapsed()
}

# Lines in a log are apart by a number of seconds and, of one piece of work, by a fifth of the time
# that it has taken.
tell_seldom <- function(text, began = elapsed()) {
  apart <- max(getOption("amiss.progress_interval", 30), (elapsed() - began) / 5)
  if (elapsed() - told$at >= apart) tell_line("{text}")
}

# Evaluates `code` as a part, `text`, of the work that goes on. Parts may hold parts.
staged <- function(text, code) {
  way <- progress_way()
  if (way == "none") return(code)
  where <- begin_stage(text)
  if (way == "bar") cli::cli_progress_message("{where}") else tell_seldom(where)
  code
}

# The stage and those that hold it, in words; it ends with `frame`.
begin_stage <- function(text, frame = rlang::caller_env()) {
  around <- getOption("amiss.stages")
  if (is.null(around)) told$at <- elapsed()
  rlang::local_options(amiss.stages = c(around, text), .frame = frame)
  paste(c(around, text), collapse = ": ")
}

# Evaluates `code`, which calls piece_done() of this class for each of `n` pieces.
counted <- function(text, n, code, class = "amiss_piece_done") {
  way <- progress_way()
  if (way == "none") return(code)
  where <- begin_stage(text)
  began <- elapsed()
  done <- 0
  if (way == "bar") {
    bar <- cli::cli_progress_bar(total = n, auto_terminate = FALSE, format = paste(
      "{where} {cli::pb_bar} {cli::pb_current} of {cli::pb_total} {cli::pb_eta_str}"))
    show <- function() cli::cli_progress_update(set = done, id = bar)
  } else {
    show <- function() {
      tell_seldom(paste0(where, ", ", done, " of ", n, time_left(began, done, n)), began)
    }
  }
  process <- Sys.getpid()  # a forked worker has these handlers too
  withCallingHandlers(code, immediateCondition = function(piece) {
    if (Sys.getpid() != process || !inherits(piece, class)) return()
    done <<- piece$done %||% (done + 1)
    show()
  })
}

# Another piece is done, or `done` of them in all. Workers of package future pass the condition on
# at once. Made by hand: rlang::signal() takes a fifth of a millisecond, as long as many a run.
piece_done <- function(done = NULL, class = "amiss_piece_done") {
  signalCondition(structure(class = c(class, "immediateCondition", "condition"),
                            list(message = "", call = NULL, done = done)))
}

# A function that names the turns of a loop: "model 2 of 5 (sun), about 3 min left".
turns <- function(what, n) {
  began <- elapsed()
  done <- -1
  function(name) {
    done <<- done + 1
    paste0(what, " ", done + 1, " of ", n, " (", name, ")", time_left(began, done, n))
  }
}

# As if the rest went on as what is done did; nothing before there is something to judge by.
time_left <- function(began, done, n) {
  if (done < 1) return("")
  paste0(", about ", time_words((elapsed() - began) / done * (n - done)), " left")
}

time_words <- function(seconds) {
  if (seconds < 90) paste(ceiling(seconds), "s")
  else if (seconds < 5400) paste(round(seconds / 60), "min")
  else paste(signif(seconds / 3600, 2), "h")
}
