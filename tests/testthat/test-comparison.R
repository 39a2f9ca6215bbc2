# Linear worlds: the target follows Te and the sun; least squares is lm().
line <- function(..., f, boundary = c("Te", "Gv")) function_simulator(f, ..., boundary = boundary)
offset <- free("offset", uniform(10, 30), "K")
gain <- free("gain", uniform(0, 1))
blind <- line(offset, gain,
              f = function(values, drivers) values[["offset"]] + values[["gain"]] * drivers[, "Te"])
sunny <- line(offset, gain, free("sun", uniform(0, 0.01), "K/(W/m2)"),
              f = function(values, drivers)
                values[["offset"]] + values[["gain"]] * drivers[, "Te"] +
                values[["sun"]] * drivers[, "Gv"])
other <- line(offset, free("slope", uniform(-1, 1)),
              f = function(values, drivers)
                values[["offset"]] + values[["slope"]] * drivers[, "Gv"] / 100)

sunny_data <- function(n = 90) {
  data <- linear_data(n)
  data$Ti <- data$Ti + 0.005 * data$Gv
  data
}

rough_ais <- list(ais = list(pilot_chains = 24, groups = 4, chains = 12, importance_draws = 200))

compare_linear <- function(models = list(blind = blind, sunny = sunny, other = other),
                           method = "paper", m = NULL,
                           ...) {
  data <- sunny_data()
  m <- m %||% linear_measurements(data, calibrate = data$hour <= 60, validate = data$hour > 60)
  compare_models(models, m, method, runs = 12, control = list(calibration = rough_ais, ...),
                 seed = 3, threads = 2, quiet = TRUE)
}

compared <- compare_linear()

complement <- function(basis) qr.Q(qr(basis), complete = TRUE)[, -seq_len(ncol(basis))]
prod_kernel <- function(x, i, alpha) apply(x, 1, function(row) prod(alpha^(4 * (row - x[i, ])^2)))

test_that("likelihood, AIC, BIC and the likelihood ratio are those of lm()", {
  data <- sunny_data()[1:60, ]
  fits <- list(stats::lm(Ti ~ Te, data), stats::lm(Ti ~ Te + Gv, data), stats::lm(Ti ~ Gv, data))
  table <- tidy(compared, "criteria")
  # nlminb stops where the sum of squares no longer changes by 1e-10 of itself.
  expect_equal(table$log_likelihood, vapply(fits, function(f) as.numeric(stats::logLik(f)), 0),
               tolerance = 1e-7)
  expect_equal(table$aic, vapply(fits, stats::AIC, 0), tolerance = 1e-7)
  expect_equal(table$bic, vapply(fits, stats::BIC, 0), tolerance = 1e-7)
  expect_equal(table$k, c(3, 4, 3))
  expect_equal(table$lr[2], 2 * as.numeric(stats::logLik(fits[[2]]) - stats::logLik(fits[[1]])),
               tolerance = 1e-6)
  expect_equal(table$lr_p_value[2], stats::pchisq(table$lr[2], 1, lower.tail = FALSE))
  expect_identical(table$nested, c(NA, "blind", NA))
  expect_equal(table$autocorrelation[1],
               stats::cor(residuals(fits[[1]])[-1], residuals(fits[[1]])[-60]), tolerance = 1e-5)
  expect_true(all(table$converged))
  best <- compared$models$sunny$best$values
  expect_equal(unname(best[c("offset", "gain", "sun")]), unname(stats::coef(fits[[2]])),
               tolerance = 1e-5)
})

test_that("evidence, Bayes factors and probabilities are those of the calibrations", {
  table <- tidy(compared)
  m <- compared$measurements
  emulator <- train_emulator(simulate_design(sunny, m, 12, seed = 3), m)
  alone <- calibrate_paper(emulator, m, rough_ais, seed = 3)
  expect_identical(compared$models$sunny$fit$log_evidence, alone$log_evidence)
  expect_equal(table$log10_evidence[2], alone$log_evidence / log(10))
  expect_equal(sum(table$probability), 1)
  expect_equal(log10(table$probability[1] / table$probability[2]),
               table$log10_evidence[1] - table$log10_evidence[2])
  factor <- bayes_factor(compared$models$sunny$fit, compared$models$blind$fit)
  expect_identical(table$model[which.min(table$rank)], "sunny")
  expect_equal(unlist(table[2, c("log10_bf", "bf_lower95", "bf_upper95")], use.names = FALSE),
               unlist(factor[1:3], use.names = FALSE))
  expect_identical(table$word[2], factor$word)
  expect_gt(table$log10_bf[2], 1)
  expect_identical(table$against[2], table$model[table$rank == 2])
  expect_identical(table$against[table$rank == 2], "sunny")
  expect_identical(table$against[table$rank == 3], table$model[table$rank == 2])
  expect_equal(table$log10_bf_first[1], 0)
  expect_equal(glance(compared)$model, "sunny")
  expect_identical(subset(tidy(compared, "attribution"), model == "sunny", -model)$boundary,
                   alone$index$boundary)
})

test_that("scores are those of predictions, at calibration and held-out rows", {
  model <- compared$models$sunny
  p <- predict(model$fit, use = "validate")
  expect_equal(unname(model$scores$validate[["rmse"]]), sqrt(mean((p$observed - p$mean)^2)))
  expect_equal(tidy(compared, "criteria")$rmse_validation[2],
               unname(model$scores$validate[["rmse"]]))
  expect_lt(tidy(compared, "criteria")$rmse_validation[2], 0.15)  # noise of 0.1
  data <- sunny_data()
  alone <- compare_linear(list(blind = blind), m = linear_measurements(data))
  expect_true(is.na(tidy(alone, "criteria")$rmse_validation))
  expect_false("held_out" %in% figures_of(alone))
  expect_match(summary(alone)$headline, "nothing to compare")
})

test_that("a disagreement between criteria and evidence is told", {
  x <- compared
  expect_length(disagreements(x), 0)
  x$tables$ranking[-1] <- rep(list(c(2, 1, 3)), ncol(x$tables$ranking) - 1)
  expect_length(disagreement_sentences(x), 0)
  x$tables$ranking$aic <- c(1, 2, 3)
  expect_identical(disagreements(x), c(aic = "blind"))
  x$tables$ranking$bic <- c(3, 1, 2)
  expect_match(disagreement_sentences(x)[1], "AIC would choose blind; the evidence chooses sunny")
  expect_match(disagreement_sentences(x)[2],
               "AIC puts 1 and BIC puts 1 of 3 pairs of models in another order")
  x$tables$criteria$lr_p_value[2] <- 0.3
  expect_match(disagreement_sentences(x)[3], "does not prefer sunny to blind")
})

test_that("what cannot be trusted is told", {
  x <- compared
  x$models$sunny$fit$trust <- list(trusted = FALSE, verdict = "chains stick")
  x$models$sunny$fit$emulator$basis$discarded_rms <- 1
  told <- doubt_sentences(x)
  expect_match(summary(x)$headline, "though the numbers are rough|not decisively")
  expect_match(told, "sunny: the evidence is rough .chains stick", all = FALSE)
  expect_match(told, "sunny: the basis is coarse", all = FALSE)
  narrow <- line(free("offset", uniform(20.5, 30)), gain, f = blind$f)
  narrow <- compare_linear(list(narrow = narrow, wide = sunny))
  expect_match(doubt_sentences(narrow), "edge of what was thought possible: narrow: offset",
               all = FALSE)
  expect_true(is.na(tidy(narrow, "criteria")$nested[2]))  # another prior: not nested
})

test_that("the chi-square test is called invalid at the edge of a range", {
  at_edge <- line(offset, gain, free("sun", uniform(0, 0.001)), f = sunny$f)
  table <- tidy(compare_linear(list(blind = blind, edge = at_edge)), "criteria")
  expect_match(table$lr_note[2], "invalid: sun at the edge")
})

test_that("the history method carries its own attribution", {
  x <- compare_linear(list(blind = blind, sunny = sunny), "history",
                      attribution = list(surrogates = 19,
                                         ais = list(pilot_chains = 24, groups = 4)))
  expect_s3_class(x$models$blind$fit, "amiss_calibration")
  expect_true(all(c("log10_bf_dropped", "p_value") %in% names(tidy(x, "attribution"))))
  expect_identical(glance(x)$model, "sunny")
  expect_error(bayes_factor(x$models$blind$fit, compared$models$blind$fit), "different methods",
               class = "amiss_error_input")
  expect_true(ggplot2::is.ggplot(ggplot2::autoplot(x, "attribution")))
})

test_that(paste("a comparison prints within fifteen lines, draws all figures and says what is",
                "wrong with its arguments"), {
  expect_lte(length(capture.output(print(compared))), 15)
  grDevices::pdf(NULL)
  withr::defer(grDevices::dev.off())
  for (which in figures_of(compared))
    expect_error(ggplot2::ggplot_build(ggplot2::autoplot(compared, which)), NA)
  expect_error(plot(compared, "heat_loss"), class = "amiss_error_input")
  expect_error(tidy(compared, "nonsense"), class = "amiss_error_input")
  m <- compared$measurements
  expect_error(compare_models(list(blind, sunny), m), "named list", class = "amiss_error_input")
  expect_error(compare_models(list(a = blind, b = 3), m), "Model \"b\" is no simulator",
               class = "amiss_error_input")
  expect_error(compare_models(list(a = blind), m, "guess"), "method", class = "amiss_error_input")
  expect_error(compare_models(list(a = blind), m,
                              control = list(attribution = list(surrogates = 9))),
               "belongs to", class = "amiss_error_input")
  expect_error(compare_models(list(a = blind), m, control = list(steps = 1)), "unknown option",
               class = "amiss_error_input")
  expect_error(compare_models(list(a = blind), m, truth = list(values = 1)), "truth",
               class = "amiss_error_input")
  nameless <- line(offset, f = blind$f, boundary = "Gh")
  expect_error(compare_models(list(lacking = nameless), m, quiet = TRUE), "lacking",
               class = "amiss_error_input")
})

test_that("an interrupted comparison goes on where it stopped, with the same bits on one thread", {
  folder <- withr::local_tempdir()
  again <- function(models) compare_models(models, compared$measurements, runs = 12, control = list(
    calibration = rough_ais), seed = 3, quiet = TRUE, checkpoint = folder)
  again(list(blind = blind))
  before <- list.files(folder)
  expect_length(before, 2)
  times <- file.mtime(file.path(folder, before))
  both <- again(list(blind = blind, sunny = sunny, other = other))
  expect_identical(file.mtime(file.path(folder, before)), times)
  expect_identical(tidy(both), tidy(compared))
  expect_identical(tidy(both, "criteria"), tidy(compared, "criteria"))
})

test_that(paste("the paper's discrepancy over time lies outside the simulation space, with the",
                "variance of the formula"), {
  fit <- compared$models$blind$fit
  d <- discrepancy(fit)
  expect_s3_class(d, "amiss_discrepancy")
  expect_equal(d$series$simulated, unname(fitted(fit)))
  expect_lt(max(abs(crossprod(fit$emulator$basis$vectors, d$series$discrepancy))),
            1e-6 * max(abs(fit$emulator$basis$vectors)) * nrow(d$series))
  # Brute force with H formed: covariance of H v' is H'ZH - H'ZH (H'AH)^-1 H'ZH.
  m <- fit$measurements
  x <- m$boundary[fit$rows, , drop = FALSE]
  width <- tapply(apply(x, 2, function(v) diff(range(v))), m$condition, max)[m$condition]
  x <- structure(sweep(x, 2, width, "/"), condition = m$condition)
  basis <- qr.Q(qr(fit$emulator$basis$vectors))
  alpha <- c(0.9, 0.5, 1)
  h <- complement(basis)
  z <- matrix(0, nrow(x), nrow(x))
  for (i in seq_len(nrow(x))) z[i, ] <- 4 * prod_kernel(x, i, alpha[attr(x, "condition")])
  inside <- t(h) %*% z %*% h
  covariance <- inside - inside %*% solve(inside + diag(0.1, nrow(inside)), inside)
  # The fictitious condition, the last, is constant.
  own <- paper_discrepancy_(paper_data(fit$emulator, fit$measurements, fit$rows, fit$control),
                            fit$priors, list(alpha = rbind(alpha), t2 = 0.2, lambda = 10),
                            engine_context(1, 1))
  expect_equal(own$variance[, 1], diag(h %*% covariance %*% t(h)), tolerance = 1e-8)
})

test_that("what remains of each model is told with the conditions in a list", {
  told <- function(...) {
    table <- data.frame(model = "blind", boundary = c("Te", "Gv"), significant = c(...))
    amiss:::remains_sentences(list(models = list(blind = NULL), tables = list(attribution = table)))
  }
  expect_identical(told(TRUE, TRUE), "blind: the discrepancy responds to Te and Gv.")
  expect_identical(told(FALSE, FALSE), "blind: the discrepancy responds to no boundary condition.")
})

test_that("labelled conditions stand under their labels in all that people read", {
  data <- sunny_data()
  m <- linear_measurements(data, calibrate = data$hour <= 60, validate = data$hour > 60,
                           boundary = list(Te = condition("outdoor air", "degC"),
                                           Gv = condition("sun on the wall", "W/m2")))
  labels <- c("outdoor air", "sun on the wall")
  short <- list(surrogates = 19, ais = list(pilot_chains = 24, groups = 4))
  for (x in list(compare_linear(list(blind = blind), m = m),
                 compare_linear(list(blind = blind), "history", m, attribution = short))) {
    told <- summary(x)
    expect_output(print(x), "1 model")
    expect_output(print(told), "blind: the discrepancy responds to sun on the wall")
    expect_identical(names(told$attribution), c("model", labels))
    expect_false(anyNA(told$attribution))
    figure <- ggplot2::autoplot(x, "attribution")
    expect_match(figure$labels$title, "responds to sun on the wall")
    expect_setequal(levels(figure$data$boundary), labels)
    for (which in figures_of(x)) expect_no_error(ggplot2::ggplot_build(ggplot2::autoplot(x, which)))
    expect_setequal(tidy(x, "attribution")$boundary, c("Te", "Gv"))
  }
  table <- data.frame(boundary = c("Te", "Gv"), group = c("Te or Gv", NA))
  expect_identical(amiss:::labelled_conditions(table, function(n) amiss:::condition_label(m, n)),
                   data.frame(boundary = labels, group = c("outdoor air or sun on the wall", NA)))
})

test_that("what the paper's method finds significant is in the title of its figure", {
  figure <- ggplot2::autoplot(compare_linear(list(blind = blind)), "attribution")
  expect_match(figure$labels$title, "responds to Gv$")
})
