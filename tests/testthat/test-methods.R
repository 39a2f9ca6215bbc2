fit <- plain_linear_fit()
upgrade <- small_upgrade()
last <- upgrade$models[[2]]$fit
paper <- calibrate_paper(fit$emulator, fit$measurements,
                         list(ais = list(pilot_chains = 24, groups = 4, chains = 12)), seed = 1)

test_that("fitted values and residuals are the record", {
  y <- fit$measurements$y[fit$rows]
  expect_equal(fitted(fit) + residuals(fit), y)
  # Least squares leave 0.1; the posterior mean lies within a few of its errors.
  expect_equal(fitted(fit), unname(fitted(lm(Ti ~ Te, linear_data()))), tolerance = 2e-3)
  expect_identical(nobs(fit), 240L)
  table <- augment(fit)
  expect_identical(table$Ti, y)
  expect_equal(table$.resid, residuals(fit))
  expect_identical(table$Gv, linear_data()$Gv)
  expect_named(table, c("time", "Ti", "Te", "Gv", ".fitted", ".resid"))
  expect_identical(nrow(glance(fit)), 1L)
  expect_equal(glance(fit)$log10_evidence, fit$log_evidence / log(10))
})

test_that("a record of its own is augmented by its prediction", {
  data <- linear_data()[1:48, ]
  new <- data.frame(time = data$hour, data[c("Te", "Gv", "Ti")])
  table <- augment(fit, newdata = new)
  p <- predict(fit, new)
  expect_identical(table$.fitted, p$mean)
  expect_identical(table$.upper, p$upper95)
  expect_equal(table$.resid, data$Ti - p$mean)
  expect_error(augment(fit, data = new), "newdata", class = "amiss_error_input")
})

test_that("there is no likelihood, and AIC() says so", {
  for (own in list(fit, paper, upgrade)) {
    expect_error(logLik(own), "bayes_factor", class = "amiss_error_input")
    expect_error(AIC(own), "compare_models", class = "amiss_error_input")
  }
})

test_that("loo() is refused with the reason, also where package loo comes later", {
  for (own in list(fit, paper, upgrade)) {
    class <- intersect(class(own), c("amiss_fit", "amiss_upgrade"))
    refuse <- getFromNamespace(paste0("loo.", class), "amiss")
    expect_error(refuse(own), "not exchangeable.*validate.*bayes_factor",
                 class = "amiss_error_input")
  }
  # One row for each method: generic, class, function, package of the generic.
  methods <- readRDS(system.file("Meta", "nsInfo.rds", package = "amiss"))$S3methods
  of_loo <- methods[methods[, 1] == "loo" & !is.na(methods[, 4]), ]
  expect_setequal(of_loo[, 2], c("amiss_fit", "amiss_joint", "amiss_upgrade"))
  skip_if_not_installed("loo")
  expect_error(loo::loo(fit), "not exchangeable", class = "amiss_error_input")
})

test_that("log10_bf is the same number in print, in the table of candidates and at a glance", {
  seen <- glance(upgrade)
  row <- tidy(upgrade, "candidates")
  row <- row[row$mechanism == seen$named_cause, ]
  expect_identical(seen$log10_bf, row$log10_bf)
  expect_match(printed(upgrade), paste("log10 Bayes factor", round(row$log10_bf, 1)), fixed = TRUE)
  expect_identical(seen$gain_beside_unknown, upgrade$gain$log10_bf)
  expect_equal(seen$gain_beside_unknown, row$beside_unknown)
  unnamed <- upgrade
  unnamed["named_cause"] <- list(NULL)
  expect_identical(glance(unnamed)$log10_bf, NA_real_)
})

test_that("bridgesampling is told the evidence", {
  skip_if_not_installed("bridgesampling")
  expect_identical(bridgesampling::logml(fit), fit$log_evidence)
  first <- upgrade$models[[1]]$fit
  told <- bridgesampling::bf(last, first, log = TRUE)
  expect_equal(told$bf, last$log_evidence - first$log_evidence)
  expect_equal(bridgesampling::bf(last, first)$bf, exp(told$bf))
  expect_output(print(told), "Bayes factor in favor of last over first")
  expect_error(bridgesampling::bf(last, fit), "different records", class = "amiss_error_input")
})

test_that("update() repeats a calibration, with what changes", {
  expect_identical(update(fit)$log_evidence, fit$log_evidence)
  expect_identical(update(paper)$log_evidence, paper$log_evidence)
  free <- update(fit, control = list(reach = Inf))
  expect_equal(free$reach, c("Inf" = 1))
  expect_identical(free$control$ais, fit$control$ais)
  # What follows from the measurements follows from the new ones.
  expect_equal(update(fit, measurements = linear_measurements(noise_sd = 0.2))$control$amplitude,
               0.2)
  expect_error(update(fit, runs = 3), class = "rlib_error_dots_nonempty")
  expect_error(update(fit, control = list(reaches = 3)), "unknown option",
               class = "amiss_error_input")
})

test_that("an upgrade answers by its last model", {
  expect_identical(coef(upgrade), coef(last))
  expect_identical(confint(upgrade, "gain", level = 0.9), confint(last, "gain", level = 0.9))
  expect_identical(vcov(upgrade), vcov(last))
  expect_identical(tidy(upgrade, conf.level = 0.5), tidy(last, conf.level = 0.5))
  expect_identical(residuals(upgrade), residuals(last))
  expect_identical(fitted(upgrade), fitted(last))
  expect_identical(nobs(upgrade), nobs(last))
  expect_identical(augment(upgrade), augment(last))
  expect_identical(predict(upgrade, use = "validate"), predict(last, use = "validate"))
  expect_identical(simulate(upgrade, 2, seed = 1), simulate(last, 2, seed = 1))
  expect_identical(as.data.frame(upgrade, draws = 10), as.data.frame(last, draws = 10))
  expect_identical(glance(upgrade)$named_cause, "sun")
  expect_identical(glance(upgrade)$nobs, nobs(last))
  skip_if_not_installed("posterior")
  expect_identical(posterior::as_draws_df(upgrade), posterior::as_draws_df(last))
})

test_that("the mechanisms that an upgrade tried are a plain table", {
  table <- tidy(upgrade, "candidates")
  expect_identical(table, tidy(upgrade, what = "candidates", conf.level = 0.95))
  expect_identical(table$mechanism, upgrade$candidates$mechanism)
  same <- c("from", "log10_bf", "standing", "beside_unknown", "probability", "trusted")
  expect_identical(table[same], upgrade$candidates[same])
  expect_identical(table$conf.low, upgrade$candidates$lower95)
  expect_identical(table$conf.high, upgrade$candidates$upper95)
  expect_true(all(vapply(table, is.atomic, NA)))
  expect_identical(tidy(upgrade, "parameters"), tidy(last))
  untried <- upgrade
  untried["candidates"] <- list(NULL)
  expect_identical(tidy(untried, "candidates"), table[0, ])
})

test_that("a table that an upgrade does not have, and what was its second argument, are errors", {
  expect_error(tidy(upgrade, "nonsense"), "what", class = "amiss_error_input")
  expect_error(tidy(upgrade, 0.9), "conf.level = 0.9", class = "amiss_error_input")
  expect_error(tidy(upgrade, "candidates", 0.9), "conf.level", class = "amiss_error_input")
})

test_that("a discrepancy is a table with a row for each row of the record", {
  found <- discrepancy(last)
  m <- last$measurements
  table <- as.data.frame(found)
  expect_identical(table[c("time", "use", "measured")],
                   data.frame(time = m$time, use = m$use, measured = m$y))
  own <- table[last$rows, ]
  expect_true(all(own$use == "calibrate"))
  expect_identical(own$mean, found$series$discrepancy)
  expect_identical(own$upper95, found$series$upper95)
  expect_identical(own$residual, unname(residuals(last)))
  expect_identical(own$response_Gv, unname(found$responses[, "Gv"]))
  expect_equal(own$response_Te + own$response_Gv, own$mean)
  expect_true(all(is.na(table$mean[-last$rows])) && !anyNA(own$mean))
  expect_identical(rownames(as.data.frame(found, paste0("r", seq_along(m$y))))[2], "r2")
  expect_error(as.data.frame(found, nonsense = 1), class = "rlib_error_dots_nonempty")
  expect_named(as.data.frame(discrepancy(paper)),
               c("time", "use", "measured", "mean", "lower95", "upper95", "residual"))
  # As written before the whole record was kept.
  found[c("record", "rows")] <- NULL
  expect_equal(as.data.frame(found), own, ignore_attr = "row.names")
})

test_that("what is asked and not known is an error", {
  calls <- list(coef, confint, vcov, fitted, residuals, nobs, generics::tidy, generics::glance,
                generics::augment, summary, predict, simulate, as.data.frame, as.matrix, update)
  for (own in list(fit, paper)) for (call in calls)
    expect_error(call(own, nonsense = 1), class = "rlib_error_dots_nonempty")
  for (call in list(coef, confint, generics::tidy, generics::glance, predict)) {
    expect_error(call(upgrade, nonsense = 1), class = "rlib_error_dots_nonempty")
  }
  tidied <- list(upgrade$models[[1]]$attribution, fit$emulator)
  for (own in tidied) expect_error(tidy(own, nonsense = 1), class = "rlib_error_dots_nonempty")
})

test_that("everything prints on standard output, in fifteen lines, and names the next step", {
  shown <- list(upgrade, upgrade$catalogue, upgrade$catalogue$sun, upgrade$models[[1]]$attribution,
                fit, paper, summary(fit), summary(paper), fit$measurements, discrepancy(fit),
                discrepancy(paper), fit$emulator, fit$emulator$simulator,
                simulate_design(linear_simulator(), fit$measurements, runs = 12, seed = 1),
                ais(function(values) -0.5 * rowSums(values^2), list(a = normal(0, 1)),
                    list(pilot_chains = 24), seed = 1))
  for (x in shown) {
    expect_silent(lines <- capture.output(same <- print(x)))
    expect_identical(same, x)
    expect_lte(length(lines), 15)
    expect_match(lines[length(lines) - 0:1], "next: ", all = FALSE, info = class(x)[1])
  }
})

test_that(paste("a summary of the paper's calibration leads to its index, not to an attribution",
                "that it does not have"), {
  told <- paste(capture.output(print(summary(paper))), collapse = " ")
  expect_match(told, "index")
  expect_no_match(told, "attribute_discrepancy")
})

test_that("the print of an upgrade names every mechanism, however many", {
  many <- upgrade
  step <- upgrade$models[[2]]
  names <- paste("mechanism", 1:12)
  many$models <- c(many$models[1],
                   lapply(names,
                          function(n) utils::modifyList(step, list(name = n, mechanism = n))))
  row <- upgrade$candidates[upgrade$candidates$mechanism == "sun", ]
  many$candidates <- do.call(rbind, lapply(names, function(n) transform(row, mechanism = n)))
  many$catalogue[names] <- list(upgrade$catalogue$sun)
  lines <- capture.output(print(many))
  expect_lte(length(lines), 15)
  told <- gsub("\\s+", " ", paste(lines, collapse = " "))
  for (name in names) expect_match(told, paste0("named:? ", name, "\\b"))
})
