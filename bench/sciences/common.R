# What the records of other sciences share.

autoregressive <- function(n, memory, sd)
  as.numeric(stats::arima.sim(list(ar = memory), n, sd = sd))

# Autoregressive, of the standard deviation stated.
stationary <- function(n, memory, sd) autoregressive(n, memory, sd * sqrt(1 - memory^2))

# Noise of the standard deviation stated, of whose variance a part is autocorrelated.
noise_of <- function(n, sd, memory = 0.6, part = 0.5) {
  stationary(n, memory, sd * sqrt(part)) + stats::rnorm(n, sd = sd * sqrt(1 - part))
}

# What a mechanism adds to or multiplies into a term that the base model reads from `info`.
added <- function(info, term, x) {
  info[[term]] <- (if (is.null(info[[term]])) 0 else info[[term]]) + x
  info
}

scaled <- function(info, term, x) {
  info[[term]] <- (if (is.null(info[[term]])) 1 else info[[term]]) * x
  info
}

term <- function(info, name, absent, n)
  rep_len(if (is.null(info[[name]])) absent else info[[name]], n)

# The first value measured while the model warms up, where one is held.
start_of <- function(info, absent) if (is.na(info$hold[1])) absent else info$hold[1]

hour_of_day <- function(info) as.numeric(info$time) %% 24

# A mechanism of one new parameter.
new_mechanism <- function(name, boundary, sentence, parameter, f) {
  mechanism(name, boundary = boundary, sentence = sentence, edit = function(model) {
    with_parameters(model, parameter, boundary = boundary, f = f)
  })
}

# The drift's unit counts in so many hours.
drifting_sensor <- function(sd, unit, hours = 24) {
  new_mechanism("sensor drift", character(), "The sensor drifts.",
                free("drift", normal(0, sd), unit),
                function(values, drivers, info, base) {
    base(values, drivers, info) + values[["drift"]] * info$step_h * seq_len(nrow(drivers)) / hours
  })
}
