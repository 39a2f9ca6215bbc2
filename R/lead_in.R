# The drivers of a segment, and those ahead of it for a simulator that asks for a lead-in.

# What a simulator that needs these columns is given for rows of the raw record: list(drivers, time,
# hold, lead), the first `lead` rows ahead of them.
segment_drivers <- function(simulator, raw, rows, needed) {
  hold <- ifelse(raw$use[rows] == "warmup", raw$y[rows], NA_real_)
  given <- list(drivers = raw$drivers[rows, needed, drop = FALSE], time = raw$time[rows],
                hold = hold, lead = 0)
  while (inherits(simulator, "amiss_renamed")) simulator <- simulator$simulator
  if (!is.list(simulator) || !isTRUE(simulator[["lead_in"]] > 0)) return(given)
  with_lead(given, simulator[["lead_in"]], simulator[["before"]], raw, rows, needed)
}

# How the time ahead of a segment is filled: as the record has it and else by the first day
# repeated, by that alone, or only as far as the record has it.
lead_ways <- c("record", "first_day", "record_only")

# `lead_in` hours ahead of the first measured value of a segment: rows without a target that the
# segment has there count.
with_lead <- function(given, lead_in, before, raw, rows, needed) {
  step <- raw$step_h
  measured <- which(is.finite(raw$y[rows]))
  lead <- ceiling(lead_in / step - 1e-6) - if (length(measured)) measured[1] - 1 else 0
  if (lead < 1) return(given)
  hours <- raw$hours[rows[1]] - step * rev(seq_len(lead))
  source <- if (before == "first_day") rep(NA, lead) else record_rows_at(hours, raw, rows, needed)
  if (before == "record_only") {
    kept <- seq_len(lead) > max(which(is.na(source)), 0)
    hours <- hours[kept]
    source <- source[kept]
    lead <- length(source)
    if (!lead) return(given)
  }
  tell_repeated(source, step, raw$segment[rows[1]], raw$time[rows[1]])
  day <- max(1, min(round(24 / step), length(rows)))
  repeated <- rows[1 + (-rev(seq_len(length(source)))) %% day]
  source[is.na(source)] <- repeated[is.na(source)]
  time <- if (is.numeric(raw$time)) hours else given$time[1] - 3600 * step * rev(seq_len(lead))
  list(drivers = rbind(raw$drivers[source, needed, drop = FALSE], given$drivers),
       time = c(time, given$time), hold = c(rep(NA_real_, lead), given$hold), lead = lead)
}

# The rows of the record at these hours, of earlier segments and complete; NA if there is none.
record_rows_at <- function(hours, raw, rows, needed) {
  earlier <- which(raw$hours < raw$hours[rows[1]] &
                   rowSums(!is.finite(raw$drivers[, needed, drop = FALSE])) == 0)
  if (!length(earlier)) return(rep(NA_integer_, length(hours)))
  nearest <- earlier[pmax(1, findInterval(hours + 0.5 * raw$step_h, raw$hours[earlier]))]
  ifelse(abs(raw$hours[nearest] - hours) <= rules$stray_limit * raw$step_h, nearest, NA_integer_)
}

tell_repeated <- function(source, step, segment, begins) {
  made_up <- sum(is.na(source))
  if (!made_up) return(invisible())
  cli::cli_inform(
    c(paste("The record has no drivers for {signif(made_up * step, 3)} of the",
            "{signif(length(source) * step, 3)} h ahead of its segment {segment}",
            "({format(begins)}): its first day is repeated there."),
      i = paste("Weather that was measured is better: put rows with the target NA ahead of the",
                "record.")), class = "amiss_message_lead", .frequency = "once",
    .frequency_id = paste("amiss lead", segment, format(begins), length(source), made_up))
}
