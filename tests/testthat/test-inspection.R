inspected <- function(upgrade) upgrade_inspections(upgrade)
about <- function(told, what) unname(told[names(told) == what])

# The small upgrade as if nothing hung together with what the sun brought. In its record the gains
# of the sun and of the air are correlated by -0.38 (least squares) to -0.51; from 0.4 that is told.
untied <- function() {
  upgrade <- small_upgrade()
  upgrade$models[[2]]$confounded_with <- character()
  upgrade
}

test_that("what to inspect next names the value that the mechanism asks for", {
  told <- inspected(untied())
  sun <- tidy(small_upgrade())
  sun <- sun[sun$term == "sun_gain", ]
  expect_match(about(told, "site"),
               sprintf("gain of the sun lies between %s and", short(sun$physical.low, 3)))
  expect_match(about(told, "steps"), "max_steps")
  expect_setequal(names(told), c("site", "steps"))
  expect_identical(summary(untied())$inspect, told)
  expect_identical(summary(untied())$mechanisms[[1]]$inspect, told[1])
})

test_that("rivals are distinguished by what only one of them responds to, or on site", {
  upgrade <- untied()
  upgrade$candidates$probability <- c(0.7, 0.3)
  m <- upgrade$measurements
  used <- m$use == "calibrate"
  r <- cor(m$boundary[used, m$condition == 1], m$boundary[used, m$condition == 2])
  told <- about(inspected(upgrade), "rival")
  expect_match(told,
               paste("distinguish sun from drift, measure a period in which Gv changes and Te does",
                     "not, or vice versa"))
  expect_match(told, sprintf("correlation of Gv and Te is %.2f", r))
  m$boundary[used, m$condition == 2] <- rnorm(sum(used))
  expect_identical(amiss:::correlation_words(m, "Gv", "Te"), "")
  expect_match(summary(upgrade)$mechanisms[[1]]$also, "drift \\(30 %\\)", all = FALSE)
  upgrade$catalogue$drift$boundary <- upgrade$catalogue$sun$boundary <- character()
  expect_match(about(inspected(upgrade), "rival"),
               "^Sun and drift respond to no condition that was measured, so only a check on site")
  upgrade$catalogue$drift$boundary <- upgrade$catalogue$sun$boundary <- "Gv"
  expect_match(about(inspected(upgrade), "rival"),
               paste("only a check on site can distinguish them: the first needs a",
                     "gain of the sun of 0.00"))
  upgrade$models[[2]]$confounded_with <- "gain"
  expect_match(about(inspected(upgrade), "tied"),
               paste("The estimate of sun \\(gain of the sun\\) is correlated with gain:",
                     "measuring that would narrow it"))
})

test_that("a stand-in and a drifting sensor have tests of their own", {
  upgrade <- small_upgrade()
  upgrade$models[[2]]$verdict <- "stand-in"
  expect_match(about(inspected(upgrade), "stand_in"), "^Sun probably stands in for another cause")
  expect_length(about(inspected(upgrade), "site"), 0)
  upgrade$models[[2]]$doubts <- c(slow = "anything that changes slowly would explain the error too")
  expect_match(about(inspected(upgrade), "drift"),
               "whether the sensor drifts or what it measures changes")
  upgrade$models[[2]]$doubts <- c(drift = "a drifting sensor would explain the error as well")
  expect_match(about(inspected(upgrade), "drift"), "sensor of Ti with a second one")
})

test_that("a time of about a step asks for finer steps of the simulator", {
  upgrade <- small_upgrade()
  brought <- function(median, unit) {
    upgrade$candidates$parameters[[1]][c("name", "median", "unit")] <- list("lag", median, unit)
    about(inspected(upgrade), "step")
  }
  expect_identical(upgrade$candidates$mechanism[1], "sun")
  expect_match(brought(1.5, "h"),
               "The time of sun \\(lag\\) is about a step of the record")
  expect_match(brought(80, "min"), "finer steps before you believe in sun")
  expect_length(brought(3, "h"), 0)
  expect_length(brought(1.5, "K"), 0)
})

test_that("conditions are told as not covered only where the model reads them", {
  m <- small_upgrade()$measurements
  m$boundary[m$use == "validate", ] <- m$boundary[m$use == "validate", ] + 1e3
  expect_named(amiss:::uncovered_conditions(m, small_upgrade()$models[[1]]$fit), "Te")
  expect_named(amiss:::uncovered_conditions(m, small_upgrade()$models[[2]]$fit), c("Te", "Gv"))
})

test_that("conditions that go together, answers without a mechanism and absent drivers are told", {
  upgrade <- base_only(small_upgrade())
  attribution <- upgrade$models[[1]]$attribution
  attribution$table$significant <- TRUE
  attribution$table$group <- NA_character_
  upgrade$models[[1]]$attribution <- attribution
  answers <- function(log10_bf, error_ratio) {
    upgrade$candidates$log10_bf[upgrade$candidates$mechanism == "sun"] <- log10_bf
    upgrade$candidates$error_ratio[upgrade$candidates$mechanism == "sun"] <- error_ratio
    about(inspected(upgrade), "answer")
  }
  expect_match(answers(-1, 0.9),
               paste("responds to (Gv and Te|Te and Gv)\\. (Sun and drift|Drift and sun), which",
                     "they drive, were tried but not adopted"))
  expect_length(answers(-1, 0.9), 1)
  expect_match(answers(-1, 0.7),
               paste("Gv\\. With sun, which it drives, the error falls to 70 % of what it is, but",
                     "an unknown response to Gv would explain this as well \\(log10 Bayes factor",
                     "beside it: [-+0-9.]+\\). Check on site whether there is a gain of the sun"),
               all = FALSE)
  expect_match(answers(1, 0.7), "responds to Gv: sun may be why, and is not decided", all = FALSE)
  plain <- upgrade$catalogue
  upgrade$catalogue$sun$boundary <- c("Te", "Gv")
  expect_match(answers(1, 0.7),
               "responds to Te and Gv: sun may be why, and is not decided|to Gv and Te: sun may be",
               all = FALSE)
  expect_length(answers(1, 0.7), 1)
  upgrade$catalogue <- plain
  attribution$table$group <- "Te or Gv"
  attribution$groups <- list(list(conditions = c("Te", "Gv"), significant = TRUE,
                                  correlation = 0.97))
  upgrade$models[[1]]$attribution <- attribution
  expect_match(about(inspected(upgrade), "group"),
               paste("Te and Gv go together .correlation 0.97.*Te changes while",
                     "Gv stays as it is"))
  # A weak correlation is not told as the reason.
  upgrade$models[[1]]$attribution$groups[[1]]$correlation <- 0.12
  expect_match(about(inspected(upgrade), "group"),
               "a response to Te or to Gv would do.*Te changes while Gv stays as it is")
  expect_no_match(amiss:::group_words(upgrade$models[[1]]$attribution), "correlation")
  upgrade$catalogue$sun$boundary <- c("Gv", "wind")
  expect_match(about(inspected(upgrade), "driver"),
               "^In the catalogue wind drives sun, but is not analysed: name it in boundary")
})

test_that("a candidate that is near is named with what would decide it", {
  upgrade <- base_only(small_upgrade())
  upgrade$candidates$log10_bf <- c(1, -1)
  upgrade$candidates$probability <- c(0.8, 0.01)
  expect_match(about(inspected(upgrade), "nearest"),
               paste("sun is not established \\(odds of 10 to 1 in favour; with it",
                     "the error falls to 8.*Gv changes strongly"))
  upgrade$catalogue$sun$boundary <- character()
  upgrade$candidates$error_ratio <- 0.9
  expect_match(about(inspected(upgrade), "nearest"),
               "10 to 1 in favour\\): a longer record \\(about 6 days more at this pace\\) would")
  wide <- upgrade
  wide$candidates$lower95 <- -20
  expect_length(about(inspected(wide), "nearest"), 0)
  upgrade$candidates$probability <- c(0.04, 0.01)
  expect_length(about(inspected(upgrade), "nearest"), 0)
})

test_that("a trial is near as well, and one that no runs were left to verify asks for a budget", {
  upgrade <- base_only(small_upgrade())
  sun <- upgrade$candidates$mechanism == "sun"
  upgrade$candidates <- upgrade$candidates[sun, ]
  upgrade$candidates[c("judged_by", "log10_bf", "lower95", "upper95")] <- list("trial", 1, 0.4, 1.6)
  expect_match(about(inspected(upgrade), "nearest"),
               "sun is not established \\(odds of 10 to 1 in favour")
  upgrade$candidates[c("log10_bf", "lower95", "upper95")] <- list(3, 2.4, 3.6)
  expect_match(about(inspected(upgrade), "nearest"),
               "sun was not verified \\(odds of 1,000 to 1.*runs_total")
  expect_match(summary(upgrade)$sure, "no runs were left to verify it", all = FALSE)
  expect_match(plot(upgrade, "candidates")$labels$title, "no runs were left to verify the best")
})

test_that("a candidate whose emulator was too coarse is not ruled out in silence", {
  upgrade <- base_only(small_upgrade())
  rough <- which(upgrade$candidates$mechanism == "drift")[1]
  upgrade$candidates[rough, c("log10_bf", "lower95", "upper95")] <- list(-3.5, -5.9, 3)
  upgrade$candidates[rough, c("judged_by", "trusted")] <- list("trial", FALSE)
  expect_match(about(inspected(upgrade), "undecided"),
               "drift is not ruled out: its numbers are not trusted. A larger budget")
  upgrade$candidates$upper95[rough] <- 54
  expect_match(about(inspected(upgrade), "undecided"),
               "drift is not ruled out: its numbers are too rough for odds")
  expect_length(about(inspected(upgrade), "nothing"), 0)
  expect_match(paste(summary(upgrade)$sure, collapse = " "),
               "numbers behind drift, which was not adopted, are not trusted")
  upgrade$candidates$trusted[rough] <- TRUE
  expect_length(about(inspected(upgrade), "undecided"), 0)
  upgrade$candidates$trusted[rough] <- FALSE
  upgrade$candidates$upper95[rough] <- 1.9
  expect_length(about(inspected(upgrade), "undecided"), 0)
  expect_no_match(paste(summary(upgrade)$sure, collapse = " "), "numbers behind drift")
  # Beside what was adopted only where it could be better.
  adopted <- small_upgrade()
  upper <- adopted$candidates$log10_bf[adopted$candidates$mechanism == "sun"][1]
  rough <- which(adopted$candidates$mechanism == "drift" & adopted$candidates$from == "base")
  adopted$candidates[rough, c("judged_by", "trusted")] <- list("trial", FALSE)
  adopted$candidates$upper95[rough] <- upper - 1
  expect_length(about(inspected(adopted), "undecided"), 0)
  adopted$candidates$upper95[rough] <- upper + 1
  expect_length(about(inspected(adopted), "undecided"), 1)
  # A later trial counts in its place; beside the last model only where something is left to
  # explain.
  later <- adopted$candidates[rough, ]
  later$from <- adopted$models[[2]]$name
  adopted$candidates <- rbind(adopted$candidates, later)
  expect_length(about(inspected(adopted), "undecided"), 0)
  adopted$models[[2]]$attribution$table$significant[1] <- TRUE
  expect_length(about(inspected(adopted), "undecided"), 1)
  adopted$candidates$trusted[nrow(adopted$candidates)] <- TRUE
  expect_length(about(inspected(adopted), "undecided"), 0)
})

test_that("numbers that are not trusted come first", {
  upgrade <- small_upgrade()
  upgrade$models[[1]]$fit$check[c("passed", "verdict")] <- list(FALSE, "half of the noise")
  upgrade$models[[2]]$fit$posterior$trusted <- FALSE
  upgrade$models[[2]]$fit$posterior$why <- "chains stand still"
  told <- inspected(upgrade)
  expect_identical(names(told)[1:2], c("emulator", "sampler"))
  runs <- nrow(upgrade$models[[1]]$fit$emulator$processes$inputs)
  expect_match(
    told[1],
    sprintf(paste("emulator of base is not trusted \\(half of the noise\\): make more runs",
                  "\\(%d now\\)"), runs))
  expect_match(told[2], "\\(chains stand still\\): give it more chains \\(pilot_chains, 24 now\\)")
  upgrade$models[[1]]$fit$emulator["simulator"] <- list(NULL)
  expect_match(inspected(upgrade)[1], "give more runs where the posterior lies")
})

test_that("data held out are asked for, and what they hold that calibration did not", {
  upgrade <- without_held_out(small_upgrade())
  expect_match(about(inspected(upgrade), "held_out"), "No data were held out")
  upgrade <- small_upgrade()
  upgrade$models[[2]]$scores$validate[["rmse"]] <- 5
  expect_match(about(inspected(upgrade), "held_out"),
               "error is .* times that in calibration: compare the two periods")
  m <- upgrade$measurements
  m$boundary[m$use == "validate", m$condition == 1] <-
    m$boundary[m$use == "validate", m$condition == 1] + 100
  upgrade$measurements <- m
  expect_match(about(inspected(upgrade), "held_out"),
               "Te \\(.* of the steps\\) lies outside of what calibration saw")
})

test_that("edges of the prior are told with the end and its value", {
  fit <- small_upgrade()$models[[1]]$fit
  expect_length(edge_inspections(fit), 0)
  fit$values[, "gain"] <- 1.9999
  fit$posterior$unit[, match("gain", colnames(fit$values))] <- 1 - 0.05 * pile_up(fit$weights)
  expect_match(edge_inspections(fit),
               paste("gain lies at the upper end of its prior \\(2.0\\): measure it, .* if",
                     "more is possible"))
})

test_that("the size of the error that remains asks for a check of the noise", {
  model <- small_upgrade()$models[[2]]
  m <- small_upgrade()$measurements
  expect_null(remainder_inspection(model, m))
  m$noise_sd <- 0.2
  expect_match(remainder_inspection(model, m), "only 0.2. times the stated noise of 0.20 K")
  m$noise_sd <- 0.01
  expect_match(remainder_inspection(model, m), "times the stated noise of 0.010 K")
})

test_that("a calibration tells what it does not know", {
  fit <- plain_linear_fit()
  told <- calibration_inspections(fit)
  expect_match(about(told, "cause"), "attribute_discrepancy")
  fit$values[, "gain"] <- (fit$values[, "offset"] - 10) / 40
  expect_match(about(calibration_inspections(fit), "tied"),
               "offset and gain are correlated .1.00.")
})

test_that("models that are not distinguished are so where their simulations differ most", {
  data <- linear_data(90)
  m <- linear_measurements(data, calibrate = data$hour <= 60, validate = data$hour > 60)
  steep <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
                              free("gain", uniform(0, 1)), boundary = "Te")
  rough <- list(calibration = list(ais = list(pilot_chains = 24, groups = 4, chains = 12,
                                              importance_draws = 200)))
  compared <- compare_models(list(a = linear_simulator(), b = steep), m, "paper", runs = 12,
                             control = rough, seed = 3, quiet = TRUE)
  compared$tables$evidence$log10_bf <- c(1, 1)
  compared$models$b$prediction$mean <- compared$models$a$prediction$mean + c(data$Te / 10)
  told <- summary(compared)$inspect
  at <- which.max(data$Te)
  expect_match(about(told, "separate"),
               sprintf(paste("differ most \\(by %s K\\) at hour %s. The difference grows if Te is",
                             "higher"), short(data$Te[at] / 10), data$hour[at]))
  text <- knitr::knit(text = c("```{r}", "report_fragment(compared, \"summary\")", "```"),
                      quiet = TRUE,
                      envir = list2env(list(compared = compared), parent = globalenv()))
  expect_match(text, "differ most")
})

test_that("sentences are ranked by what they would settle", {
  ids <- c("spikes", "tied", "answer", "step", "unknown", "site", "held_out", "clock", "edge",
           "emulator", "steps", "nearest")
  told <- stats::setNames(paste("Sentence", seq_along(ids)), ids)
  expect_named(ranked(told), c("emulator", "clock", "held_out", "step", "site", "nearest", "answer",
                               "tied", "edge", "steps", "spikes", "unknown"))
  expect_identical(ranked(told)[["site"]], told[["site"]])
  # Of the same rank, the order in which they were made.
  expect_identical(ranked(c(answer = "a", edge = "b", answer = "c")),
                   c(answer = "a", answer = "c", edge = "b"))
  upgrade <- small_upgrade()
  upgrade$models[[2]]$confounded_with <- "gain"
  expect_named(inspected(upgrade), c("site", "tied", "steps"))
  upgrade <- without_held_out(upgrade)
  upgrade$models[[2]]$fit$check[c("passed", "verdict")] <- list(FALSE, "half of the noise")
  told <- inspected(upgrade)
  expect_named(told, c("emulator", "held_out", "site", "tied", "steps"))
  expect_match(told[["held_out"]], "Measure 2 days more of Ti and its conditions and hold them out")
  stand_in(record_faults = function(...) c(clock = "a", daylight = "b", stuck = "c"))
  expect_named(inspected(upgrade)[1:3], c("emulator", "record", "held_out"))
  expect_match(about(inspected(upgrade), "record"),
               "record has clocks that differ and a sensor that is stuck")
})

test_that("what asks for the same action is one sentence", {
  fit <- small_upgrade()$models[[1]]$fit
  edge <- function(...) {
    for (name in c(...)) {
      fit$values[, name] <- c(gain = 1.9999, offset = 10.0001)[[name]]
      low <- 0.05 * pile_up(fit$weights)
      unit <- if (name == "gain") 1 - low else low
      fit$posterior$unit[, match(name, colnames(fit$values))] <- unit
    }
    edge_inspections(fit)
  }
  expect_length(edge("gain", "offset"), 1)
  expect_match(edge("gain", "offset"), "offset .lower end, 10 K. and gain .upper end, 2.0.")

  upgrade <- small_upgrade()
  for (k in 1:2) upgrade$models[[k]]$fit$check[c("passed", "verdict")] <- list(FALSE, "too coarse")
  told <- about(inspected(upgrade), "emulator")
  expect_length(told, 1)
  expect_match(told, paste("The emulators of base .too coarse. and base . sun .too coarse. are not",
                           "trusted: make more runs .* before anything is read from their numbers"))

  # Two mechanisms: one comparison of sensors, also for the noise, one look at the steps.
  upgrade <- small_upgrade()
  later <- upgrade$models[[2]]
  later[c("name", "parent", "mechanism")] <- list("base + sun + moon", "base + sun", "moon")
  upgrade$catalogue$moon <- upgrade$catalogue$sun
  upgrade$models[[3]] <- later
  for (k in 2:3) upgrade$models[[k]]$doubts <- c(drift = "a drift", steps = "the steps")
  stand_in(remaining_error = function(...) list(ratio = 3, large = TRUE, pattern = NULL))
  told <- inspected(upgrade)
  expect_length(grep("second", told), 1)
  expect_match(about(told, "drift"),
               paste("the error as well as sun or moon. The remaining error is 3.0 times the",
                     "stated noise of 0.050 K: check that noise with the same second sensor"))
  expect_length(grep("finer steps before", told), 1)
  expect_match(about(told, "step"), "before you believe in sun or moon")
  for (k in 2:3) upgrade$models[[k]]$verdict <- "stand-in"
  expect_match(about(inspected(upgrade), "stand_in"),
               "^Sun and moon probably stand in for another cause")
  upgrade <- base_only(upgrade)
  upgrade$catalogue <- upgrade$catalogue["moon"]
  upgrade$models[[1]]$attribution$table[c("significant", "group")] <- list(TRUE, NA_character_)
  upgrade$catalogue$moon$boundary <- character()
  expect_match(about(inspected(upgrade), "answer"),
               paste("responds to (Te and Gv|Gv and Te), and no mechanism of the catalogue is",
                     "driven by (Te or Gv|Gv or Te): add one that is"))
})

test_that("rivals that the same period distinguishes share a sentence, and so do looks on site", {
  pair <- function(a, b, when = NULL)
    list(names = c(a, b), measure = when, drivers = "Gv",
         asks = stats::setNames(paste("a value of", c(a, b)), c(a, b)))
  expect_identical(unname(measured_words(list(pair("sun", "drift", "x"), pair("sun", "leak", "x"),
                                              pair("sun", "wind", "y")))),
                   c(paste("To distinguish sun from drift and from leak, measure a period in which",
                           "x."), "To distinguish sun from wind, measure a period in which y."))
  expect_match(looked_words(list(pair("sun", "drift"), pair("sun", "leak"))),
               paste("^sun, drift and leak respond to the same conditions, so .*: sun needs a",
                     "value of sun; drift needs a value of drift; leak needs"))
})

test_that("a printed summary shows three sentences and says how many more there are", {
  told <- summary(untied())
  shown <- function(n) {
    told$inspect <- stats::setNames(sprintf("Sentence {%d}.", seq_len(n)), rep("site", n))
    paste(capture.output(print(told)), collapse = "\n")
  }
  expect_match(shown(5), "Sentence .1.*Sentence .2.*Sentence .3.*2 more to inspect: .*[$]inspect")
  expect_no_match(shown(5), "Sentence .4")
  expect_no_match(shown(3), "more to inspect")
  expect_match(shown(3), "next: .*report")
  expect_length(summary(without_held_out(small_upgrade()))$inspect,
                length(inspected(without_held_out(small_upgrade()))))
})

test_that("for numbers that are not trusted there is always something to do", {
  upgrade <- small_upgrade()
  with_reason <- function(why) {
    upgrade$models[[1]]$fit$trust <- amiss:::new_trust(FALSE, why)
    amiss:::upgrade_inspections(upgrade)
  }
  expect_match(with_reason("no two of 2 searches led to one mode")[["numbers"]],
               "not trusted \\(no two of 2 searches .*another seed and more chains")
  expect_match(with_reason("the budget allowed a single search")[["numbers"]], "larger budget")
  expect_false("numbers" %in% names(amiss:::upgrade_inspections(upgrade)))
})
