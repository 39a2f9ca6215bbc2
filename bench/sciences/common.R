# What the records of other sciences share.

autoregressive <- function(n, memory, sd) as.numeric(stats::arima.sim(list(ar = memory), n, sd = sd))

# What a mechanism adds to or multiplies into a term that the base model reads from `info`.
added <- function(info, term, x) {
  info[[term]] <- (if (is.null(info[[term]])) 0 else info[[term]]) + x
  info
}

scaled <- function(info, term, x) {
  info[[term]] <- (if (is.null(info[[term]])) 1 else info[[term]]) * x
  info
}

term <- function(info, name, absent, n) rep_len(if (is.null(info[[name]])) absent else info[[name]], n)

# A mechanism of one new parameter.
new_mechanism <- function(name, boundary, sentence, parameter, f) {
  mechanism(name, boundary = boundary, sentence = sentence, edit = function(model) {
    with_parameters(model, parameter, boundary = boundary, f = f)
  })
}

drifting_sensor <- function(sd, unit) {
  new_mechanism("sensor drift", character(), "The sensor drifts.", free("drift", normal(0, sd), unit),
                function(values, drivers, info, base) {
    base(values, drivers, info) + values[["drift"]] * info$step_h * seq_len(nrow(drivers)) / 24
  })
}
