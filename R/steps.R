# What a simulator's own steps err by: its output at the posterior's centre where every row of the
# drivers is given as several shorter ones, against that of the rows as they are.

# What steps a quarter as long change in calibration: list(error, moved), the RMS in the target's
# unit of what the parameters cannot take up, and by how many of its standard deviations each would
# move. NULL where that is not known: of runs that are given, of a simulator whose steps are not
# those of its rows, or one whose output does not settle as they get shorter. `open` instead if the
# budget leaves no runs to know it: `left` says how many there are.
step_effect <- function(fit, threads, left = function() Inf) {
  if (!follows_step(fit$emulator$simulator)) return(NULL)
  if (left() < 3) return(list(open = TRUE))
  change <- tryCatch(suppress_run_warnings(suppressWarnings(step_change(fit, threads, left))),
                     error = function(e) NULL)
  if (is.list(change)) change else if (!is.null(change)) taken_up(fit, change)
}

is_open_effect <- function(effect) isTRUE(effect$open)

# What steps a quarter as long change in the output at the posterior's centre, NULL, or `open`.
step_change <- function(fit, threads, left) {
  simulator <- fit$emulator$simulator
  m <- fit$measurements
  values <- unit_to_values(stats::pnorm(matrix(posterior_centre(fit), 1)), fit$emulator$parameters)
  coarse <- simulate_measured(simulator, values, m, "calibrate", threads)[, 1]
  # A simulator's value may be the mean of a row or that at its end: what agrees better.
  change <- function(times, amounts) {
    read <- simulate_in_steps(simulator, values, m, times, amounts, threads) - coarse
    size <- apply(read, 2, rms)
    if (any(is.finite(size))) read[, which.min(size)] else rep(Inf, length(coarse))
  }
  settled <- function(amounts) {
    half <- change(2, amounts)
    quarter <- change(4, amounts)
    settles <- rms(quarter - half) <= rules$settling_change * rms(half)
    if (isTRUE(settles || rms(quarter) < rules$negligible_step * m$noise_sd)) quarter
  }
  at_once <- settled(character())
  if (!is.null(at_once)) return(at_once)
  amounts <- likely_amounts(driver_names(simulator), function(amounts) rms(change(2, amounts)),
                            function() left() - 2)
  if (is.null(amounts)) list(open = TRUE) else settled(amounts)
}

# Which drivers are amounts of a row, to be shared among shorter ones, and not what holds over it:
# those with which the output changes least (`off`) of none, each and all, and of what then differs
# by one where that lowers it clearly. NULL if there are no runs `left` to know it.
likely_amounts <- function(drivers, off, left = function() Inf) {
  tried <- c(list(character(), drivers), as.list(drivers))
  amounts <- NULL
  least <- Inf
  repeat {
    if (left() < length(tried)) return(NULL)
    each <- vapply(tried, off, 0)
    if (!is.null(amounts) && min(each) >= rules$amounts_fall * least) return(amounts)
    least <- min(each)
    amounts <- tried[[which.min(each)]]
    tried <- lapply(drivers, function(name) if (name %in% amounts) setdiff(amounts, name)
                                            else c(amounts, name))
  }
}

# Slopes of the emulated output at the posterior's centre, in the target's unit for a standard
# deviation of each prior.
emulated_slopes <- function(fit) {
  centre <- posterior_centre(fit)
  p <- length(centre)
  by <- rules$emulated_difference
  coefficients <- function(x) predict_emulator_(fit$emulator$processes, x)$mean
  around <- matrix(centre, p, p, byrow = TRUE)
  fit$emulator$basis$vectors %*% t(
    coefficients(around + diag(by, p)) - coefficients(around - diag(by, p))) / (2 * by)
}

# A change of the output, seen by least squares under the priors, white noise and the emulator's
# slopes.
taken_up <- function(fit, change) {
  slopes <- emulated_slopes(fit)
  weight <- 1 / fit$measurements$noise_sd^2
  move <- solve(weight * crossprod(slopes) + diag(ncol(slopes)),
                weight * crossprod(slopes, change))[, 1]
  sd <- sqrt(
    colSums(fit$weights * sweep(to_normal(posterior_unit(fit)), 2, posterior_centre(fit))^2))
  list(error = rms(change - slopes %*% move),
       moved = stats::setNames(move / sd, names(fit$emulator$parameters)))
}

rms <- function(x) sqrt(mean(x^2))

# Whether the steps of a simulator get shorter with the rows of its drivers: those of a function do
# that reads their length, itself or by a function that it calls. A zone() has steps of its own.
follows_step <- function(simulator) {
  if (!inherits(simulator, "amiss_function_simulator")) return(FALSE)
  while (!is.null(simulator$base)) simulator <- simulator$base
  reads_step(simulator$f)
}

# Functions of other packages are not looked into.
reads_step <- function(f, known = list()) {
  names <- all.names(body(f))
  if ("step_h" %in% names) return(TRUE)
  called <- lapply(unique(names), get0, envir = environment(f), mode = "function")
  own <- Filter(function(g) {
    is.function(g) && !is.primitive(g) &&
      (!isNamespace(environment(g)) || identical(environment(g), topenv(environment(f))))
  }, called)
  known <- c(known, f)
  for (g in own) if (!any(vapply(known, identical, NA, g)) && reads_step(g, known)) return(TRUE)
  FALSE
}

# One run at the rows used in calibration with every row of the drivers given as several shorter
# ones: two columns, the means of those and the last of them, each averaged like the measurements.
simulate_in_steps <- function(simulator, values, measurements, times, amounts, threads) {
  rows <- which(measurements$use == "calibrate" & !is.na(measurements$y))
  out <- matrix(NaN, length(measurements$y), 2)
  count_runs(1)
  for (within in simulated_rows(measurements, rows)) {
    raw <- shorter_rows(measurements$raw, within, times, amounts)
    run <- matrix(
      simulate_rows(simulator, values, raw, seq_along(raw$y), threads, rlang::caller_env()), times)
    averaged <- block_means(cbind(colMeans(run), run[times, ]), measurements$block[within],
                            measurements$per_step)
    out[as.integer(rownames(averaged)), ] <- averaged
  }
  out[rows, , drop = FALSE]
}

# These rows of a raw record, each as several that share its length and the `amounts` among its
# drivers, about its time.
shorter_rows <- function(raw, rows, times, amounts) {
  each <- rep(rows, each = times)
  offset <- (rep_len(seq_len(times), length(each)) - (times + 1) / 2) / times * raw$step_h
  drivers <- raw$drivers[each, , drop = FALSE]
  drivers[, amounts] <- drivers[, amounts] / times
  list(drivers = drivers, use = raw$use[each], y = raw$y[each], segment = raw$segment[each],
       step_h = raw$step_h / times,
       time = raw$time[each] + offset * if (inherits(raw$time, "POSIXct")) 3600 else 1)
}

# ---- what it says

# In words, where the steps may be the cause instead of the parameters `new` that a model has beside
# its parent: what it mends is not clearly more than what the parent's own steps err by, or shorter
# ones would move it by a good part of its distance from no effect. Evidence of ln B is that of z^2
# / 2 = ln B at z standard deviations.
step_doubt <- function(parent, model, new, log10_bf, measurements) {
  known <- !is.na(step_error(parent))
  squares <- function(model) {
    vapply(each_view(model, measurements), function(view) {
      (view$model$scores$calibrate[["rmse"]] / view$measurements$noise_sd)^2
    }, 0)
  }
  error <- sqrt(sum(step_error(parent)^2, na.rm = TRUE))
  mended <- sqrt(max(0, sum((squares(parent) - squares(model))[known])))
  if (any(known) && error >= rules$largest_step_share * mended)
    return(sprintf("shorter steps of the simulator change %s of the noise where it mends %s",
                   short(error), short(mended)))
  moved <- step_moves(model)
  move <- max(0, abs(moved[names(moved) %in% new]))
  away <- sqrt(2 * log(10) * max(0, log10_bf))
  if (move > 0 && move >= rules$largest_step_share * away)
    sprintf(paste("shorter steps of the simulator move its values by %s standard deviations, where",
                  "%s make its evidence"), short(move), short(away))
}

step_moves <- function(model)
  do.call(c, c(list(numeric()), lapply(unname(model$steps), `[[`, "moved")))

# Of each record what shorter steps change, over the noise; NA where that is not known.
step_error <- function(model) {
  fits <- record_fits(model$fit)
  unlist(Map(function(effect, fit) (effect$error %||% NA_real_) / fit$measurements$noise_sd,
             model$steps %||% vector("list", length(fits)), fits))
}
