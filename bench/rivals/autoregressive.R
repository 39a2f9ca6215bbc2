# Least squares with AR(1) errors: what a careful engineer does today. The errors e of a simulation
# have the density of a stationary process e_t = phi e_(t-1) + w_t, w_t normal with variance s^2:
#   -2 log L = n log(SS / n) + constant, at the best s^2,
#   SS = (1 - phi^2)^(-1/n) ((1 - phi^2) e_1^2 + sum (e_t - phi e_(t-1))^2),
# so that least squares over the parameters and phi is maximum likelihood. phi lies in [0, 0.98].

most_phi <- 0.98

whitened <- function(errors, phi) {
  n <- nrow(errors)
  scale <- (1 - phi^2)^(-1 / (2 * n))
  first <- sqrt(1 - phi^2) * errors[1, ]
  rest <- errors[-1, , drop = FALSE] - rep(phi, each = n - 1) * errors[-n, , drop = FALSE]
  rep(scale, each = n) * rbind(first, rest, deparse.level = 0)
}

#' Whitened errors over the unit cube of parameters and phi (the last column), and a count of runs.
whitened_errors <- function(simulator, m) {
  parameters <- amiss::free_parameters(simulator)
  y <- m$y[m$use == "calibrate" & !is.na(m$y)]
  runs <- 0
  at <- function(unit) {
    p <- length(parameters)
    places <- unit[, seq_len(p), drop = FALSE]
    new <- !duplicated(places)  # a step of phi alone takes no run
    runs <<- runs + sum(new)
    values <- amiss:::unit_to_values(places[new, , drop = FALSE], parameters)
    output <- amiss:::simulate_measured(simulator, values, m, "calibrate", 1L)
    keys <- apply(places, 1, function(row) paste(format(row, digits = 17), collapse = " "))
    errors <- (output - y)[, match(keys, keys[new]), drop = FALSE]
    whitened(errors, most_phi * unit[, p + 1])
  }
  list(at = at, parameters = parameters, n = length(y), runs = function() runs)
}

fit_autoregressive <- function(simulator, from, m, seed) {
  errors <- whitened_errors(simulator, m)
  phi <- if (is.null(from)) 0.5 else from$phi_unit
  starts <- lapply(starts_from(errors$parameters, from, seed), c, phi)
  found <- least_squares_in_cube(errors$at, starts)
  p <- length(errors$parameters)
  unit <- stats::setNames(found$unit[seq_len(p)], names(errors$parameters))
  deviance <- errors$n * log(found$rms^2)
  list(unit = unit, phi_unit = found$unit[p + 1],
       values = amiss:::unit_to_values(t(unname(unit)), errors$parameters)[1, ],
       deviance = deviance, bic = deviance + (p + 2) * log(errors$n), runs = errors$runs())
}

# The mechanism with the least BIC, if that is lower than the present model's by `margin`.
least_bic <- function(margin) function(fits, present) {
  bic <- vapply(fits, `[[`, 0, "bic")
  if (min(bic) < present$bic - margin) which.min(bic)
}
