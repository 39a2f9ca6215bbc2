# Small cases of every stage: each a function that returns a list of numbers in groups by how far
# they may differ on another machine or after a change that means to change nothing.
#
# exact closed computations: nothing but rounding, 1e-8 of their size searched ends of a numerical
#   search (an emulator's hyper-parameters) and what depends on them: the search stops where the
#   density gains less than 1e-6 of itself, which moves predictions by some 1e-4 of their spread
#   sampled by random chains, which part at the first rounding that differs: four standard errors,
#   given beside them

parity_record <- function(n = 168) {
  hour <- seq_len(n)
  outdoor <- 8 + 5 * sin(2 * pi * (hour - 9) / 24) + 2 * sin(2 * pi * hour / 71)
  sun <- pmax(0, sin(2 * pi * (hour - 6) / 24)) * (300 + 150 * sin(2 * pi * hour / 53))
  data.frame(hour, Te = outdoor, Gv = sun,
             Ti = parity_run(c(a = 0.6, b = 0.8), cbind(Te = outdoor, Gv = sun)) +
               0.05 * sqrt(2) * sin(12.9898 * hour^2))
}

slow <- function(x, hours) {
  as.numeric(stats::filter(x * (1 - exp(-1 / hours)), exp(-1 / hours), method = "recursive",
                           init = x[1]))
}

parity_run <- function(values, drivers) {
  20 + exp(2 * values[["a"]]) * 0.05 * slow(drivers[, "Te"], 4 + values[["a"]]) +
    values[["b"]] * drivers[, "Gv"] / 300
}

parity_model <- function() {
  function_simulator(parity_run, free("a", uniform(0, 1)), free("b", uniform(0, 2)),
                     boundary = c("Te", "Gv"), name = "bent")
}

blind_model <- function() {
  function_simulator(function(values, drivers) parity_run(c(values, b = 0), cbind(drivers, Gv = 0)),
                     free("a", uniform(0, 1)), boundary = "Te", name = "blind")
}

parity_measurements <- function(...) {
  measurements(parity_record(), time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.05,
               unit = "K", ...)
}

quick <- list(ais = list(pilot_chains = 64, groups = 8, chains = 32))

sampled <- function(value, error) list(value = value, error = error)

# Medians of a fit's parameters, with the error of a median of so many effective draws.
medians <- function(fit) {
  effective <- 1 / sum(fit$weights^2)
  sampled(coef(fit), 1.25 * sqrt(diag(vcov(fit))) / sqrt(effective))
}

evidence <- function(fit) sampled(c(log_evidence = fit$log_evidence), fit$standard_error)

parity_cases <- list(
  record = function() {
    set <- parity_measurements(average = 2, warmup = 10)
    list(exact = c(rows = length(set$y), sum = sum(set$y), boundary = colSums(set$boundary)))
  },
  zone = function() {
    weather <- synthetic_weather(days = 3, seed = 4)
    weather$RHP <- 50
    values <- t(c(outer_k = 1.05, outer_c = 3361, insulation_k = 0.048, insulation_c = 160,
                  heater_radiant = 0.79))
    air <- simulate_zone(paper_box("M2"), values, as.matrix(weather[-1]), step_s = 900)[, 1]
    list(exact = c(air = air[c(1, 100, 288)],
                   loss = heat_loss_coefficient(paper_box("M2"), values)))
  },
  basis = function() {
    emulator <- train_emulator(simulate_design(parity_model(), parity_measurements(), 30, seed = 1),
                               parity_measurements())
    list(exact = c(vectors = ncol(emulator$basis$vectors),
                   singular = emulator$basis$singular_values[1:3]))
  },
  emulator = function() {
    set <- parity_measurements()
    emulator <- train_emulator(simulate_design(parity_model(), set, 30, seed = 1), set)
    seen <- predict(emulator, cbind(a = c(0.2, 0.8), b = c(0.5, 1.5)))
    list(searched = c(mean = seen$mean[c(5, 100), ], loo = emulator$diagnostics$series_rmse))
  },
  calibration = function() {
    set <- parity_measurements()
    fit <- calibrate(train_emulator(simulate_design(parity_model(), set, 30, seed = 1), set), set,
                     quick, seed = 2)
    list(sampled = list(evidence(fit), medians(fit)))
  },
  given_runs = function() {
    set <- parity_measurements()
    made <- simulate_design(parity_model(), set, 40, seed = 3)
    fit <- calibrate(train_emulator(ensemble(made$values, made$outputs, made$parameters), set), set,
                     quick, seed = 2)
    list(sampled = list(evidence(fit), medians(fit)))
  },
  refined = function() {
    set <- parity_measurements()
    fit <- calibrate_refined(simulate_design(parity_model(), set, 10, seed = 1), set,
                             control = list(calibration = quick),
                             seed = 2)
    list(sampled = list(evidence(fit), medians(fit)))
  },
  attribution = function() {
    set <- parity_measurements()
    fit <- calibrate(train_emulator(simulate_design(blind_model(), set, 20, seed = 1), set), set,
                     quick, seed = 2)
    found <- tidy(attribute_discrepancy(fit, list(surrogates = 19), seed = 2))
    list(sampled = list(evidence(fit)), exact = c(sun_first = which.max(found$log10_bf_dropped)))
  },
  paper = function() {
    set <- parity_measurements(average = 4)
    fit <- calibrate_paper(train_emulator(simulate_design(parity_model(), set, 30, seed = 1), set),
                           set, list(ais = quick$ais), seed = 2)
    list(sampled = list(evidence(fit)))
  },
  sampler = function() {
    far <- ais(function(z) stats::dnorm(z[, "x"], 3, 0.1, log = TRUE), list(x = normal(0, 1)),
               seed = 1)
    list(sampled = list(sampled(c(log_evidence = far$log_evidence), far$standard_error)))
  },
  loop = function() {
    set <- parity_measurements(calibrate = seq_len(168) <= 120, validate = seq_len(168) > 120)
    sun <- mechanism("sun", boundary = "Gv", sentence = "The sun shines in.",
                     edit = function(model) parity_model())
    better <- upgrade_model(blind_model(), set, catalogue(sun), runs = 30, seed = 1, quiet = TRUE,
                            control = list(max_steps = 1, calibration = quick,
                                           attribution = list(surrogates = 19)))
    list(exact = c(adopted = length(better$models) - 1,
                   named = as.numeric(better$models[[2]]$verdict == "named")),
         sampled = list(evidence(better$models[[2]]$fit), medians(better$models[[2]]$fit)))
  })

# One row a number: case, kind, quantity, value, error (of what is sampled).
parity_rows <- function(cases = parity_cases) {
  row <- function(case, kind, value, error = 0) {
    data.frame(case, kind, quantity = names(value), value = unname(value), error = error)
  }
  one_case <- function(case) {
    groups <- cases[[case]]()
    closed <- lapply(setdiff(names(groups), "sampled"),
                     function(kind) row(case, kind, unlist(groups[[kind]])))
    by_chains <- lapply(groups$sampled, function(part) row(case, "sampled", part$value, part$error))
    do.call(rbind, c(closed, by_chains))
  }
  do.call(rbind, lapply(names(cases), one_case))
}

# The rows that differ by more than their kind allows; `unchanged`: by more than their digits.
parity_differences <- function(rows, reference, unchanged = FALSE) {
  both <- merge(rows, reference, by = c("case", "kind", "quantity"), all = TRUE,
                suffixes = c("", "_before"), sort = FALSE)
  allowed <- ifelse(both$kind == "sampled", 4 * sqrt(both$error^2 + both$error_before^2),
                    c(exact = 1e-8, searched = 1e-3)[both$kind] * pmax(1, abs(both$value_before)))
  if (unchanged) allowed <- 1e-13 * pmax(1, abs(both$value_before))
  apart <- abs(both$value - both$value_before)
  both[is.na(apart) | apart > allowed, ]
}
