# What a record does at each row beyond what the fitted model expects of it, given all rows before.
# If the model is right, these innovations at a draw of its posterior are independent and N(0, 1).


# A draw of the posterior is distributed as the true parameters are (Johnson 2007, Bayesian model
# assessment using pivotal quantities), so that no degree of freedom is lost to what was fitted.
innovations <- function(fit, draw = systematic_draws(fit$weights, 1),
                        most = rules$longest_filtered) {
  parts <- covariance_parts(fit, draw)
  m <- fit$measurements
  steps <- c(Inf, diff(m$hours[fit$rows]))
  steps[segment_starts(m, fit$rows)] <- Inf
  kept <- exp(-outer(steps, 1 / fit$control$error_times))
  shown <- seq_len(min(length(fit$rows), most))
  found <- filter_rows(parts$left[shown], parts$columns[shown, , drop = FALSE], parts$spread,
                       kept[shown, , drop = FALSE], parts$slow, parts$white)
  data.frame(row = fit$rows[shown], time = m$time[fit$rows][shown],
             innovation = found$error / found$sd, sd = found$sd)
}

# list(left, columns, spread, slow, white): what a draw leaves of the record is columns %*% b, each
# b normal with the variance `spread`, plus autocorrelated errors of the variances `slow` and a
# white one. The columns are the responses to conditions within the draw's reach and, for what the
# emulator does not know of the run at this draw, its basis.
covariance_parts <- function(fit, draw) {
  moves <- simulator_moves(fit$emulator)
  basis <- fit$emulator$basis$vectors
  emulated <- emulated_coefficients(fit$emulator, posterior_unit(fit)[draw, , drop = FALSE])
  error <- draw_errors(fit, draw)
  responses <- standardised_responses(fit)
  columns <- cbind(responses - moves %*% withheld_by(responses, moves, error$limit), basis)
  spread <- c(error$spread, emulated$variance)
  list(left = fit$measurements$y[fit$rows] - as.numeric(basis %*% emulated$mean[1, ]),
       columns = columns[, spread > 0, drop = FALSE], spread = spread[spread > 0],
       slow = error$slow, white = error$white)
}

# Of a draw the variances of the coefficients of all responses and of the errors, and `limit`: the
# discrepancy keeps out of the directions in which the simulator moves by more than its square root,
# a sum over the record.
draw_errors <- function(fit, draw) {
  of_condition <- rep(fit$measurements$condition, each = length(fit$control$time_constants))
  amount <- fit$posterior$t[draw, ] / tabulate(of_condition, ncol(fit$posterior$t))
  variance <- fit$posterior$variance[draw]
  settings <- length(fit$control$error_ratios)^length(fit$control$error_times)
  reach <- fit$control$reach[fit$posterior$setting[draw] %/% settings + 1]
  list(spread = amount[of_condition], slow = variance * error_ratios_of(fit, draw)[1, ],
       white = variance, limit = reach * fit$measurements$noise_sd^2)
}

# The responses to conditions, as the posterior takes them, at rows of its record or of another.
standardised_responses <- function(fit, record = fit$measurements, rows = fit$rows) {
  responses <- filter_responses(record, fit$control$time_constants)
  sweep(sweep(responses[rows, , drop = FALSE], 2, fit$centre), 2, fit$scale, "/")
}

# X with which (I + (E E' / limit)^2)^-1 of the responses is the responses less E X, E the moves.
withheld_by <- function(responses, moves, limit) {
  if (is.infinite(limit)) return(matrix(0, ncol(moves), ncol(responses)))
  along <- svd(moves)
  along$v %*% (crossprod(along$u, responses) / (along$d + limit^2 / along$d^3))
}

# Kalman filter (Durbin and Koopman 2012, chapter 4): list(error, sd) of each row, predicted from
# those before it. The states are the coefficients of the columns, which stay, and the
# autocorrelated errors; `kept` is what each of these keeps of the row before. A row that was not
# measured teaches nothing. `look(i, state, covariance)` sees what is known after row i, 0 at first;
# what it says is returned as `seen`.
filter_rows <- function(left, columns, spread, kept, slow, white, look = function(...) NULL) {
  steady <- seq_along(spread)
  moving <- length(spread) + seq_along(slow)
  state <- numeric(length(spread) + length(slow))
  covariance <- diag(c(spread, slow), length(state))
  error <- sd <- numeric(length(left))
  seen <- list(look(0, state, covariance))
  for (i in seq_along(left)) {
    keeps <- c(rep(1, length(steady)), kept[i, ])
    state <- keeps * state
    covariance <- covariance * tcrossprod(keeps)
    at <- cbind(moving, moving)
    covariance[at] <- covariance[at] + slow * (1 - kept[i, ]^2)
    h <- c(columns[i, ], rep(1, length(moving)))
    shared <- as.numeric(covariance %*% h)
    variance <- sum(h * shared) + white
    error[i] <- left[i] - sum(h * state)
    sd[i] <- sqrt(variance)
    if (!is.na(left[i])) {
      state <- state + shared * (error[i] / variance)
      covariance <- covariance - tcrossprod(shared) / variance
    }
    seen[i + 1] <- list(look(i, state, covariance))
  }
  list(error = error, sd = sd, seen = seen)
}
