# Are the probabilities of the models M1, M2 and M3 of the paper's box calibrated? The model that
# makes the data is drawn with equal odds, its parameters from their priors; of the cases in which a
# model is given probability p, it should be the true one in a share p.

box_models <- c("M1", "M2", "M3")

# Two days of hourly values and a noise as large as the models' differences, so that the
# probabilities are spread.
box_worlds <- function(noise_sd = 1.5) {
  weather <- amiss::synthetic_weather(3, step_h = 1, seed = 5)
  weather$RHP <- amiss::rolbs(nrow(weather), step_h = 1, power = 100, seed = 5)
  weather$Ti <- 20 + sin(weather$hour)
  record <- amiss::measurements(weather, time = "hour", target = "Ti",
                                boundary = ~ Te + Gv + Ws + RHP, noise_sd = noise_sd, warmup = 24,
                                unit = "K", name = "box")
  lapply(stats::setNames(box_models, box_models), function(model) {
    simulator <- amiss::paper_box(model)
    runs <- amiss::simulate_design(simulator, record, runs = 60, seed = 6)
    emulator <- amiss::train_emulator(runs, record, list(noise_fraction = 0.02))
    list(measurements = record, simulator = simulator, emulator = emulator,
         spread = simulator_spread(emulator))
  })
}

# What makes the data: the simulator itself with white noise (and calibrate() told that there is no
# discrepancy), or the whole history model with the emulator in the simulator's place.
sources <- list(
  simulator = list(
    control = list(inclusion = 1e-6, error_times = numeric(), confidence = 0.5),
    draw = function(world, control) {
      m <- world$measurements
      values <- vapply(world$emulator$parameters,
                       function(p) amiss:::prior_quantile(p$prior, stats::runif(1)), 0)
      clean <- amiss:::simulate_measured(
        world$simulator, matrix(values, 1, dimnames = list(NULL, names(values))), m, "calibrate", 1)
      n <- length(clean)
      priors <- list(noise_sd = m$noise_sd, noise_shape = n * control$confidence)
      clean[, 1] + stats::rnorm(n, 0, sqrt(draw_variance(1, priors)))
    }),
  "history model" = list(
    control = list(confidence = 0.5),
    draw = function(world, control) draw_history(world, control)$y))

model_case <- function(worlds, source, seed) {
  set.seed(seed)
  true <- sample(length(worlds), 1)
  record <- worlds[[1]]$measurements
  control <- amiss:::fill_calibration_control(utils::modifyList(list(ais = sbc_ais, check = 0),
                                                                source$control),
                                              record, sum(record$use == "calibrate"))
  y <- source$draw(worlds[[true]], control)
  evidence <- vapply(worlds,
                     function(world)
                       amiss::calibrate(world$emulator, observed(record, y), control,
                                        seed = seed)$log_evidence, 0)
  weight <- exp(evidence - max(evidence))
  c(true = true, weight / sum(weight))
}

# With probabilities p (one row a case), the truth of each case is a draw from its own row: the null
# distribution of every score comes from such draws. Two-sided for the mean log score and for the
# frequency of each model, one-sided for the reliability: squared deviations in ten classes of
# probability, over their variances.
probability_rows <- function(cases, name, redraws = 4999) {
  p <- cases[, -1, drop = FALSE]
  score <- function(true) {
    hit <- outer(true, seq_len(ncol(p)), "==") - p
    class <- cut(p, seq(0, 1, 0.1), include.lowest = TRUE)
    off <- tapply(hit, class, sum)^2 / (tapply(p * (1 - p), class, sum) + 1e-6)
    c("log score" = mean(log(p[cbind(seq_along(true), true)])),
      "reliability" = sum(off, na.rm = TRUE), colSums(hit))
  }
  own <- score(cases[, 1])
  set.seed(1)
  cumulative <- t(apply(p, 1, cumsum))
  null <- replicate(
    redraws,
    score(1L + as.integer(rowSums(stats::runif(nrow(p)) > cumulative[, -ncol(p), drop = FALSE]))))
  above <- (1 + rowSums(null >= own)) / (1 + redraws)
  below <- (1 + rowSums(null <= own)) / (1 + redraws)
  p_value <- ifelse(names(own) == "reliability", above, pmin(1, 2 * pmin(above, below)))
  labels <- ifelse(names(own) %in% colnames(p), paste("share of", names(own)), names(own))
  data.frame(case = paste("model probabilities,", name), quantity = labels, draws = nrow(p),
             p_value = p_value, row.names = NULL)
}
