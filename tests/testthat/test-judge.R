# Two models by hand, of ten days held out by the hour: the second one's error is `after`, the first
# one's `before`.
models_of <- function(before, after, time = NULL) {
  n <- length(before)
  m <- list(use = rep("validate", n), y = rep(0, n), hours = 1e5 + seq_len(n), time = time)
  model <- function(error) {
    list(fit = list(measurements = m),
         prediction = data.frame(use = "validate", observed = 0, mean = error,
                                 time = time %||% m$hours))
  }
  lapply(list(before, after), model)
}

errors <- function(n = 240) withr::with_seed(3, list(before = rnorm(n, 0, 2), after = rnorm(n)))

judged <- function(change = function(upgrade) upgrade) {
  rejudged(change(small_upgrade()))$models[[2]][c("verdict", "doubts")]
}

expect_doubt <- function(pattern, change, verdict = "likely", ...) {
  own <- judged(function(upgrade) change(upgrade, ...))
  expect_identical(own$verdict, verdict)
  expect_length(own$doubts, 1)
  expect_match(own$doubts, pattern)
}

test_that("a mechanism that nothing speaks against is named", {
  expect_identical(judged()$verdict, "named")
  model <- small_upgrade()$models[[2]]
  expect_identical(model$verdict, "named")
  expect_length(model$doubts, 0)
  expect_true(model$held_out_gain$improves)
  expect_null(small_upgrade()$models[[1]]$verdict)
})

test_that("each doubt makes a mechanism likely", {
  expect_doubt("does not distinguish it from drift \\(30 %\\)", function(u) {
    u$candidates$probability <- c(0.6, 0.3)
    u
  })
  for (k in 1:2) {
    expect_doubt("numbers behind it are not trusted", function(u) {
      u$models[[k]]$fit$trust <- amiss:::new_trust(FALSE, "chains stick")
      u
    })
  }
  expect_doubt("band holds only 70 % of the data held out", function(u) {
    u$models[[2]]$scores$validate[["coverage95"]] <- 0.7
    u
  })
  expect_doubt("the error in calibration rose with it", function(u) {
    u$models[[2]]$scores$calibrate[["rmse"]] <- 1.03 * u$models[[1]]$scores$calibrate[["rmse"]]
    u
  })
  expect_doubt("the error still responds to what drives it", function(u) {
    u$models[[2]]$attribution <- u$models[[1]]$attribution
    u
  })
  expect_doubt("at the edge of what was thought possible", function(u) {
    unit <- u$models[[2]]$fit$posterior$unit
    u$models[[2]]$fit$posterior$unit[, 3] <- 1 - 0.05 * pile_up(unit[, 3])
    u
  })
  expect_doubt("it describes what is missing and does not explain it", function(u) {
    u$catalogue$sun <- response_mechanism("Gv", u$measurements, name = "sun")
    u
  })
  # Both models as they were, plus an error that neither explains.
  expect_doubt("a good part of the error remains", function(u) {
    p <- u$models[[2]]$prediction
    extra <- ifelse(p$use == "calibrate", withr::with_seed(1, rnorm(nrow(p))), 0)
    for (k in 1:2) u$models[[k]]$prediction$observed <- p$observed + extra
    u
  })
})

test_that(paste("a condition that nobody gave a mechanism for, and that the record cannot",
                "distinguish from another, is a doubt"), {
  twin <- function(u, significant = TRUE) {
    u$models[[1]]$attribution$groups <- list(list(conditions = c("Gs", "Gv"),
                                                  significant = significant))
    u
  }
  expect_doubt("responds to Gs as well, which this record cannot distinguish from Gv", twin)
  expect_length(judged(function(u) twin(u, significant = FALSE))$doubts, 0)
  # If a mechanism of the catalogue is driven by it, the evidence distinguishes the two.
  expect_length(judged(function(u) {
    u$catalogue$drift$boundary <- "Gs"
    twin(u)
  })$doubts, 0)
})

test_that("so it is of a second sensor of the sun, not of one that is coarse", {
  skip_on_cran()  # second tier: tools/test --quick
  doubts_of <- function(sd) {
    table <- small_record()
    table$Gs <- table$Gv + withr::with_seed(2, rnorm(nrow(table), 0, sd))
    m <- measurements(table, time = "time", target = "Ti", boundary = ~ Te + Gv + Gs,
                      noise_sd = 0.05, calibrate = seq_len(240) <= 168,
                      validate = seq_len(240) > 168, warmup = 12)
    upgrade <- upgrade_model(model_of(small_upgrade()$models[[1]]$fit), m,
                             small_upgrade()$catalogue["sun"], seed = 1, quiet = TRUE,
                             control = small_upgrade()$control)
    upgrade$models[[2]]$doubts
  }
  expect_match(doubts_of(0.5), "responds to Gs as well")
  expect_length(doubts_of(40), 0)
})

test_that("what was adopted later is no other cause", {
  upgrade <- small_upgrade()
  upgrade$candidates$probability <- ifelse(upgrade$candidates$mechanism == "sun", 0.6, 0.4)
  expect_match(rejudged(upgrade)$models[[2]]$doubts, "does not distinguish it from drift")
  later <- upgrade$models[[2]]
  later[c("name", "parent", "mechanism")] <- list("base + sun + drift", "base + sun", "drift")
  upgrade$models[[3]] <- later
  upgrade$candidates <- rbind(upgrade$candidates,
                              transform(upgrade$candidates, from = "base + sun"))
  upgrade <- rejudged(upgrade)
  expect_no_match(c("", upgrade$models[[2]]$doubts), "does not distinguish")
  expect_false(any(grepl("tell sun from drift", upgrade_inspections(upgrade))))
  expect_null(upgrade$models[[2]]$doubts[["alone"]])
  # It may be, if it comes as near without the other.
  upgrade$models[[3]]$may_replace <- "sun"
  upgrade <- rejudged(upgrade)
  expect_match(upgrade$models[[2]]$doubts[["alone"]], "^drift, adopted after it, may be the cause")
  expect_identical(upgrade$models[[2]]$verdict, "likely")
})

test_that(
  "where the base model's parameters could have come nearer by themselves, the gain says so", {
  upgrade <- small_upgrade()
  nearest <- amiss:::nearest_run(upgrade$models[[1]]$fit$emulator, upgrade$models[[1]]$fit)
  runs <- simulate_design(model_of(upgrade$models[[1]]$fit), upgrade$measurements, runs = 20,
                          seed = 1)
  y <- upgrade$measurements$y[used_rows(upgrade$measurements, "calibrate")]
  # The basis leaves out less than a hundredth of the noise.
  expect_equal(amiss:::nearest_run(train_emulator(runs, upgrade$measurements),
                                   upgrade$models[[1]]$fit),
               sqrt(min(colMeans((runs$outputs - y)^2))), tolerance = 1e-3)
  gain <- function(rmse) {
    upgrade$models[[1]]$scores$calibrate[["rmse"]] <- rmse
    paste(summary(upgrade)$gain, collapse = " ")
  }
  expect_match(gain(1.2 * nearest), "one run of the base model has an error of only")
  expect_no_match(gain(1.05 * nearest), "of only")
})

test_that(
  "a parameter of the base model at the edge of its prior is no doubt about the mechanism", {
  expect_identical(judged(function(u) {
    u$models[[2]]$fit$posterior$unit[, 1] <- 0.999
    u
  })$verdict, "named")
})

test_that("a mechanism by which data held out do not gain is a stand-in, whatever its evidence", {
  worse <- function(upgrade) {
    held <- upgrade$models[[1]]$prediction$use == "validate"
    upgrade$models[[2]]$prediction$mean[held] <- upgrade$models[[1]]$prediction$mean[held]
    upgrade
  }
  expect_doubt("held-out data do not improve", worse, "stand-in")
  upgrade <- worse(small_upgrade())
  upgrade <- rejudged(upgrade)
  told <- summary(upgrade)
  expect_identical(told$verdict, "unexplained")
  expect_match(told$headline, "take it as a stand-in for something else")
})

test_that("without data held out nothing is said of a gain", {
  upgrade <- without_held_out(small_upgrade())
  gain <- amiss:::held_out_gain(upgrade$models[[1]], upgrade$models[[2]])
  expect_identical(gain$improves, NA)
  expect_identical(judged(without_held_out)$verdict, "named")
})

test_that("the gain on data held out has the standard error of sums over days", {
  e <- errors()
  models <- models_of(e$before, e$after)
  gain <- amiss:::held_out_gain(models[[1]], models[[2]])
  fall <- e$before^2 - e$after^2
  days <- colSums(matrix(fall, 24))
  expect_equal(gain$mean, mean(fall))
  expect_equal(gain$standard_error, sqrt(10) * sd(days) / 240)
  expect_true(gain$improves)
  # Its size: of 240 independent differences. A standard deviation of ten values has an error of 24
  # %.
  expect_equal(gain$standard_error, sd(fall) / sqrt(240), tolerance = 0.75)
  # Of a short record, sums over eighths.
  short <- models_of(e$before[1:80], e$after[1:80])
  eighths <- colSums(matrix(fall[1:80], 10))
  expect_equal(amiss:::held_out_gain(short[[1]], short[[2]])$standard_error,
               sqrt(8) * sd(eighths) / 80)
})

test_that("days are counted by the hours of the measurements, whatever their time is written in", {
  e <- errors()
  gain <- function(time) {
    models <- models_of(e$before, e$after, time)
    expect_no_warning(own <- amiss:::held_out_gain(models[[1]], models[[2]]))
    own
  }
  stamp <- as.POSIXct("2013-08-30 00:10:00", tz = "UTC") + 3600 * seq_len(240)
  expect_identical(gain(format(stamp, "%Y-%m-%d %H:%M:%S")), gain(NULL))
  expect_identical(gain(stamp), gain(NULL))
  # A day of 10-minute steps stays one.
  models <- models_of(rep(e$before, 6), rep(e$after, 6))
  exact <-
    as.numeric(as.POSIXct("2013-08-30 00:10:00", tz = "UTC") + 600 * (seq_len(1440) - 1)) / 3600
  for (k in 1:2) models[[k]]$fit$measurements$hours <- exact
  days <- colSums(matrix(rep(e$before^2 - e$after^2, 6), 144))
  expect_equal(amiss:::held_out_gain(models[[1]], models[[2]])$standard_error,
               sqrt(10) * sd(days) / 1440)
})

test_that("a record with times as text is judged without a warning", {
  data <- small_record()
  data$time <- format(data$time, "%Y-%m-%d %H:%M:%S")
  m <- measurements(data, time = "time", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.05,
                    warmup = 12, calibrate = seq_len(240) <= 168, validate = seq_len(240) > 168)
  as_text <- function(u) {
    u$models <- lapply(u$models, function(model) {
      model$fit$measurements <- m
      model$prediction$time <- m$time[m$use %in% c("calibrate", "validate")]
      # Large enough to be looked at by the clock.
      model$prediction$observed <- model$prediction$observed +
        2 * (seq_len(nrow(model$prediction)) %% 24 == 9)
      model
    })
    u$measurements <- m
    u
  }
  expect_no_warning(own <- judged(as_text))
  expect_match(own$doubts, "a good part of the error remains", all = FALSE)
  pattern <- remaining_error(as_text(small_upgrade())$models[[2]], m)$pattern
  expect_match(pattern$what, "in the mean of all days")
})

test_that("what drives a mechanism is still answered to with more than half of its evidence", {
  model <- function(log10_bf, significant = TRUE) {
    table <- data.frame(boundary = c("Gv", "Te"), log10_bf_dropped = c(log10_bf, 30),
                        significant = c(significant, TRUE))
    list(attribution = list(table = table))
  }
  still <- function(...) amiss:::still_answers(..., boundary = "Gv")
  expect_true(still(model(10), model(6)))
  expect_false(still(model(10), model(4)))
  expect_false(still(model(10), model(6, FALSE)))
  expect_false(still(model(10, FALSE), model(6)))  # no response before
  expect_true(amiss:::still_answers(model(10), model(1), c("Gv", "Te")))
})

test_that("parameters that are correlated with those of a mechanism beyond 0.4 are named", {
  unit <- withr::with_seed(2, {
    new <- runif(400)
    cbind(new, 0.5 * new + 0.5 * runif(400), runif(400), 0.1 * new + 0.9 * runif(400))
  })
  fit <- list(values = `colnames<-`(unit, c("new", "close", "far", "loose")),
              weights = rep(1 / 400, 400), posterior = list(unit = unit))
  expect_identical(amiss:::confounded_parameters(fit, "new"), "close")
  # One that is constant but for rounding is correlated with nothing.
  fit$posterior$unit[, 3] <- 0.999 + 1e-15 * unit[, 1]
  expect_identical(amiss:::confounded_parameters(fit, "new"), "close")
  expect_identical(amiss:::confounded_parameters(fit, c("new", "close")), character())
  expect_identical(amiss:::confounded_parameters(fit, character()), character())
  expect_identical(amiss:::confounded_parameters(fit, c("new", "close", "far", "loose")),
                   character())
  # Weights count: where the correlated part has none, nothing is left.
  half <- fit
  half$posterior$unit[201:400, 2] <- withr::with_seed(5, runif(200))
  half$weights <- rep(c(0, 1), each = 200)
  expect_identical(amiss:::confounded_parameters(half, "new"), character())
})

test_that("the edge of a prior is where the interval ends and the median lies", {
  draws <- cbind(top = 1 - 0.02 * (1:500) / 500, bottom = 0.02 * (1:500) / 500,
                 wide = (1:500) / 500, inside = 0.4 + 0.2 * (1:500) / 500,
                 narrow = 0.005 + 0.001 * (1:500) / 500)  # of a wide prior, and well inside it
  fit <- list(values = draws, weights = rep(1 / 500, 500), posterior = list(unit = draws))
  expect_identical(amiss:::edge_of_prior(fit),
                   c(top = TRUE, bottom = TRUE, wide = FALSE, inside = FALSE,
                     narrow = FALSE))
})

test_that("a stand-in is no named cause, and what is named goes before what is likely", {
  models <- function(...) {
    adopted <- Map(
      function(name, verdict) list(parent = "base", mechanism = name, verdict = verdict),
      c("sun", "lag"), c(...))
    c(list(list(name = "base")), unname(adopted))
  }
  candidates <- data.frame(from = "base", mechanism = c("sun", "lag"), log10_bf = c(5, 3))
  entries <- list(sun = list(boundary = "Gv", sentence = "Sun."),
                  lag = list(boundary = "P", sentence = "Lag."))
  cause <- function(...) amiss:::named_cause(models(...), candidates, entries)
  expect_null(cause("stand-in", "stand-in"))
  expect_equal(cause("stand-in", "likely")[c("mechanism", "log10_bf")],
               list(mechanism = "lag", log10_bf = 3))
  expect_equal(cause("likely", "named")$mechanism, "lag")
  expect_equal(cause("named", "named")$boundary, "Gv")
  expect_null(amiss:::named_cause(list(list(name = "base")), candidates, entries))
})

test_that(
  "a mechanism with which the simulation's own error rises is not adopted, and why is told", {
  upgrade <- base_only(small_upgrade())
  expect_lt(upgrade$candidates$error_ratio[upgrade$candidates$mechanism == "sun"], 0.5)
  upgrade$candidates$error_ratio <- 1.9
  told <- summary(upgrade)
  expect_match(
    paste(told$sure, collapse = " "),
    "Sun was not adopted: with it the simulation's own error .* does not fall by 1 % \\(it is 1.9")
  expect_match(told$candidates[["error in calibration"]], "1.9 times", all = FALSE)
  expect_match(ggplot2::autoplot(upgrade, "candidates")$labels$title,
               "the best does not lower the error")
  # One that loses to an unknown response is refused for that.
  upgrade$candidates[c("error_ratio", "beside_unknown")] <- list(0.5, -5)
  expect_match(paste(summary(upgrade)$sure, collapse = " "),
               "not adopted, because an unknown response .* its log10 Bayes factor is -5.0")
  figure <- ggplot2::autoplot(upgrade, "candidates")
  expect_match(figure$labels$title, "an unknown response does better than the best")
  expect_identical(as.character(figure$data$state[figure$data$mechanism == "sun"]), "refused")
})

test_that("why nothing was adopted names the best, also where the error rises with it", {
  present <- list(attribution = small_upgrade()$models[[2]]$attribution)
  context <- amiss:::new_context(1, 1, list(decisive = 2))
  table <- data.frame(mechanism = c("sun", "lag"), log10_bf = c(1.2, 0.3), lower95 = c(0.1, -1),
                      upper95 = 2, judged_by = "runs", error_ratio = c(1.4, 0.9),
                      beside_unknown = 1)
  told <- function(...) amiss:::no_winner(utils::modifyList(table, list(...)), present, context)
  expect_identical(told()$id, "not_decisive")
  expect_match(told()$words,
               "no mechanism has enough evidence \\(best: sun, log10 Bayes factor 1.2; 2 or more")
  risen <- told(log10_bf = c(3, 0.3))
  expect_identical(risen$id, "keeps_error")
  expect_match(
    risen$words,
    "with decisive evidence lowers the error by 1 % \\(sun has a log10 Bayes factor of 3.0")
  expect_identical(told(log10_bf = c(3, 4), lower95 = c(1, -1))$id, "uncertain")
  expect_match(told(log10_bf = c(3, 4), lower95 = c(1, -1))$words, "too uncertain \\(best: lag")
  imitated <- told(log10_bf = c(1, 4), beside_unknown = c(1, -5))
  expect_identical(imitated$id, "imitated")
  expect_match(imitated$words,
               "lag has a log10 Bayes factor of 4.0, but one of -5.0 beside an unknown response")
  expect_identical(told(log10_bf = c(NA_real_, NA_real_))$id, "none_computed")
  # Rounded it would look like enough.
  expect_match(told(log10_bf = c(1.96, 0.3))$words, "log10 Bayes factor 1.96;")
})

test_that("numbers that are not trusted give no odds, and no values to find on site", {
  texts <- function(upgrade) {
    upgrade <- rejudged(upgrade)
    paste(c(utils::capture.output(print(upgrade)), unlist(summary(upgrade))), collapse = " ")
  }
  sound <- small_upgrade()
  expect_match(texts(sound), "odds of 10\\^.*lies between")
  lost <- sound
  lost$models[[2]]$fit$trust <- amiss:::new_trust(FALSE, "no draws lie at 1 of the modes")
  lost$candidates$trusted[lost$candidates$mechanism == "sun"] <- FALSE
  told <- texts(lost)
  expect_no_match(told, "odds of|most probable|per cent of the probability|lies between")
  expect_match(told, "sun \\(Gv\\), its numbers are not trusted")
  expect_match(told, "Not trusted: sun \\(no draws lie at 1 of the modes\\)")
  expect_match(told, "measure gain of the sun on site: the calibrated value is not trusted")
  # A rival keeps its name, and its probability only if its own numbers are trusted too.
  near <- function(u, trusted) {
    second <- u$candidates$mechanism == "drift"
    u$candidates$probability <- ifelse(second, 0.2, 0.8)
    u$candidates$trusted[second] <- trusted
    texts(u)
  }
  expect_match(near(sound, TRUE), "distinguish it from drift \\(20 %\\)")
  expect_match(near(sound, FALSE), "distinguish it from drift(;|\\.)")
  expect_no_match(near(lost, TRUE), "\\((20|80) %\\)")
})

test_that("a second mechanism whose numbers are not trusted is said beside a first whose are", {
  upgrade <- small_upgrade()
  second <- upgrade$models[[2]]
  second$name <- "base + sun + drift"
  second$parent <- upgrade$models[[2]]$name
  second$mechanism <- "drift"
  second$fit$trust <- amiss:::new_trust(FALSE, "chains hardly move")
  upgrade$models[[3]] <- second
  row <- upgrade$candidates[upgrade$candidates$mechanism == "sun", ]
  upgrade$candidates <- rbind(upgrade$candidates,
                              transform(row, from = second$parent, mechanism = "drift",
                                        trusted = FALSE))
  sure <- paste(amiss:::sure_sentences(upgrade), collapse = " ")
  expect_match(sure, "The evidence for sun over no change is decisive: odds of")
  expect_match(sure, "No odds are given for drift.*Not trusted: drift \\(chains hardly move\\)")
  expect_no_match(sure, "can be trusted")
})

test_that(
  "where the base model's emulator is refuted, no mechanism is judged and no odds are given", {
  open <- base_only(small_upgrade())
  expect_match(paste(summary(open)$sure, collapse = " "), "odds of")
  open$models[[1]]$fit$check$passed <- FALSE
  open$models[[1]]$fit$trust <- amiss:::new_trust(FALSE,
                                                  "the emulator's error is 0.64 of the noise")
  told <- summary(open)
  expect_identical(told$verdict, "unexplained")
  expect_match(told$headline,
               paste("responds to Gv. The model's emulator is not good enough to decide whether",
                     ".* not found"))
  expect_match(told$tag, "not good enough")
  expect_no_match(paste(c(told$sure, told$inspect), collapse = " "),
                  "something is missing, or the noise|is not established")
  stand_in(remaining_error = function(...) list(ratio = 3, large = TRUE, pattern = NULL))
  expect_match(summary(open)$remains,
               "noise is too small, or something is missing, or the parameters were not",
               all = FALSE)
  sure <- paste(told$sure, collapse = " ")
  expect_no_match(sure, "odds of|most probable")
  expect_match(
    sure,
    "No odds can be given for or against any mechanism: the emulator's error is 0.64 of the noise")
})

test_that("a mechanism that no boundary condition drives is not said to be driven", {
  upgrade <- small_upgrade()
  expect_match(paste(summary(upgrade)$change, collapse = " "), "sun (named), driven by Gv:",
               fixed = TRUE)
  upgrade$catalogue$sun$boundary <- character()
  expect_match(paste(summary(upgrade)$change, collapse = " "), "sun (named): Sun enters",
               fixed = TRUE)
  expect_no_match(paste(capture.output(print(upgrade)), collapse = " "), "sun ()", fixed = TRUE)
})

test_that("where the catalogue was empty, no mechanism of it is said to have failed", {
  upgrade <- base_only(small_upgrade())
  upgrade["candidates"] <- list(NULL)
  expect_match(summary(upgrade)$headline,
               "Gv is missing from the model, but no mechanism was tried")
})

test_that("what has evidence only with what it is correlated with is likely at most", {
  model <- function(name, mechanism, parameters) {
    list(name = name, mechanism = mechanism,
         fit = list(values = matrix(0, 1, length(parameters), dimnames = list(NULL, parameters)),
                    emulator = list(parameters = stats::setNames(nm = as.list(parameters)))))
  }
  models <- list(model("base", NULL, "C"), model("base + a", "a", c("C", "of_a")),
                 model("base + a + b", "b", c("C", "of_a", "of_b")))
  candidates <- function(alone)
    data.frame(from = c("base", "base", "base + a"), mechanism = c("a", "b", "b"),
               log10_bf = c(12, alone, 5))
  told <- function(alone = -1, confounded = c("C", "of_a"), steps = 3) {
    amiss:::only_beside(models[seq_len(steps)], confounded, candidates(alone))
  }
  expect_identical(told(), "it has evidence only together with a, with which it is correlated")
  expect_null(told(alone = 1))
  expect_null(told(confounded = "C"))
  expect_null(told(steps = 2))
})

test_that(paste("where nothing is wrong in calibration and the error on held-out data is larger,",
                "the headline says so"), {
  upgrade <- base_only(small_upgrade())
  base <- upgrade$models[[1]]
  base$attribution$table$significant <- FALSE
  p <- base$prediction
  p$mean <- p$observed + 0.05 * (-1)^seq_len(nrow(p))
  base$prediction <- p
  base$scores$calibrate[["rmse"]] <- 0.05
  upgrade$models[[1]] <- base
  told <- function(held) {
    upgrade$models[[1]]$scores$validate[["rmse"]] <- held
    amiss:::diagnosis_verdict(upgrade)
  }
  expect_identical(told(0.07)$tag, "Nothing decisive")
  expect_identical(told(0.12)$verdict, "nothing")
  expect_match(told(0.12)$headline,
               "In calibration no mechanism is called for.* held-out data the error is 2.4 times")
})

test_that("why the one of highest evidence was not adopted is told", {
  upgrade <- small_upgrade()
  other <- upgrade$candidates$mechanism != "sun"
  upgrade$candidates$log10_bf[other] <- max(upgrade$candidates$log10_bf) + 1
  upgrade$candidates$error_ratio[other] <- 1.2
  told <- paste(summary(upgrade)$sure, collapse = " ")
  expect_match(
    told, paste(capital(upgrade$candidates$mechanism[other][1]),
                "was not adopted first: with it the simulation's own error in calibration does not",
                "fall by 1 % \\(it is 1.2 times"))
  upgrade$candidates$error_ratio[other] <- 0.9
  expect_no_match(paste(summary(upgrade)$sure, collapse = " "), "not adopted first")
})

test_that("a parameter beside it at its prior's end, or another not ruled out, is a doubt", {
  expect_doubt("with which it is correlated, lies at the edge", function(u) {
    fit <- u$models[[2]]$fit
    sun <- fit$posterior$unit[, match("sun_gain", colnames(fit$values))]
    fit$posterior$unit[, match("offset", colnames(fit$values))] <- 1 - 0.05 * pile_up(sun)
    u$models[[2]]$fit <- fit
    u
  })
  not_trusted <- function(u, error_ratio) {
    drift <- u$candidates$mechanism == "drift"
    u$candidates$trusted[drift] <- FALSE
    u$candidates$error_ratio[drift] <- error_ratio * u$candidates$error_ratio[!drift]
    u
  }
  expect_doubt("drift comes as near to the record, by numbers that are not trusted", not_trusted,
               error_ratio = 1)
  expect_length(judged(function(u) not_trusted(u, error_ratio = 1.1))$doubts, 0)
})

test_that("a mechanism found on top of one that is not named is not named", {
  adopted <- function(mechanism, verdict) list(mechanism = mechanism, verdict = verdict)
  base <- list(list(name = "base"))
  last <- list(list(mechanism = "c"))
  found <- function(...) amiss:::unnamed_before(c(base, list(...), last))
  expect_null(found())
  expect_null(found(adopted("a", "named")))
  expect_identical(found(adopted("a", "named"), adopted("b", "likely")),
                   "b, on top of which it was found, is not named")
  expect_identical(found(adopted("a", "stand-in"), adopted("b", "likely")),
                   "a and b, on top of which it was found, are not named")
})
