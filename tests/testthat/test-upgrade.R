skip_on_cran()  # second tier: tools/test --quick

# A short linear world in which the sun is hidden.
sunny_record <- function() {
  table <- linear_data(60)
  table$Ti <- table$Ti + 0.01 * table$Gv
  linear_measurements(table, calibrate = table$hour <= 42, validate = table$hour > 42)
}

adding <- function(name, f, ..., boundary = "Te") {
  mechanism(name, boundary = boundary, sentence = "It acts.", edit = function(model) {
    with_parameters(model, ..., boundary = boundary,
                    f = function(values, drivers, base) base(values) + f(values, drivers))
  })
}

sun <- adding("sun", function(values, drivers) values[["s"]] * drivers[, "Gv"],
              free("s", uniform(0, 0.02)), boundary = "Gv")
drift <- adding("drift", function(values, drivers) values[["d"]] * seq_len(nrow(drivers)) / 100,
                free("d", uniform(-1, 1)))
nothing <- adding("nothing", function(values, drivers) 0 * values[["n"]], free("n", uniform(0, 1)))
fails <- adding("fails", function(values, drivers) NaN * values[["n"]], free("n", uniform(0, 1)))

quick_control <- list(max_steps = 1, calibration = quick_ais, attribution = list(surrogates = 19))

loop <- function(..., m = sunny_record(), simulator = linear_simulator(), control = list(),
                 seed = 1, threads = 1, runs = NULL) {
  upgrade_model(simulator, m, catalogue(...), runs = runs, seed = seed, quiet = TRUE,
                threads = threads, control = utils::modifyList(quick_control, control))
}

test_that("what is hidden is named, the winner by runs and what cannot win by a trial", {
  upgrade <- small_upgrade()
  table <- upgrade$candidates
  expect_equal(table$mechanism[table$judged_by == "runs"], "sun")
  expect_equal(table$judged_by[table$mechanism == "drift"], "trial")
  expect_lt(table$upper95[table$mechanism == "drift"], 2)
  expect_equal(upgrade$named_cause$mechanism, "sun")
  expect_identical(upgrade$models[[2]]$verdict, "named")
  expect_identical(significant_conditions(upgrade$models[[1]]$attribution$table), "Gv")
  for (model in upgrade$models) {
    expect_true(model$fit$check$passed)
    expect_true(model$fit$trust$trusted)
    expect_lte(model$fit$rounds, 4)  # a smooth simulator needs few
  }
  # Of its prior to 0.02 the record holds the sun to a hundredth of a hundredth.
  expect_equal(coef(upgrade)[["sun_gain"]], 0.006, tolerance = 0.05)
})

test_that("an adopted model has the evidence of its row, and one of a calibration by itself", {
  upgrade <- small_upgrade()
  fits <- lapply(upgrade$models, `[[`, "fit")
  row <- upgrade$candidates[upgrade$candidates$mechanism == "sun", ]
  expect_equal(row$beside_unknown, bayes_factor(fits[[2]], fits[[1]])$log10_bf)
  alone <- lapply(fits, function(fit) {
    calibrate_refined(simulate_design(model_of(fit), upgrade$measurements, 8, seed = 5),
                      upgrade$measurements, control = list(calibration = quick_ais), seed = 5)
  })
  apart <- bayes_factor(alone[[2]], alone[[1]])
  # Two samplers, of five standard errors each at most, and a tenth of a decade for the emulators.
  expect_lt(abs(apart$log10_bf - row$beside_unknown),
            1.25 * (apart$upper95 - apart$lower95 + row$upper95 - row$lower95) + 0.1)
})

# ---- runs

test_that("a small problem takes few runs", {
  upgrade <- loop(sun)
  expect_equal(upgrade$named_cause$mechanism, "sun")
  # The base model: 6 over the priors, two searches, 25 in the region and 3 for its tangent, checks
  # of 10 and 20. The sun: a first look of 3, a search, 4 to check, and 50 to verify.
  expect_lte(upgrade$runs_total, 150)
  # Of a linear simulator a search takes a few steps, and the first check confirms it.
  expect_lte(upgrade$candidates$runs, 3 + 6 + 4)
  # Another mechanism costs a trial, of which all checks may be needed.
  both <- loop(sun, drift)
  expect_lte(both$runs_total - upgrade$runs_total, 3 + 12 + 4 * 4)
})

test_that("two steps with eight mechanisms take about 400 runs", {
  data <- linear_data(120)
  data$Ws <- withr::with_seed(4, stats::rnorm(120))
  data$Ti <- data$Ti + 0.01 * data$Gv - 0.5 * data$Ws
  m <- linear_measurements(data, boundary = ~ Te + Gv + Ws, calibrate = data$hour <= 84,
                           validate = data$hour > 84)
  wind <- adding("wind", function(values, drivers) values[["w"]] * drivers[, "Ws"],
                 free("w", uniform(-1, 1)), boundary = "Ws")
  waves <- lapply(1:5, function(k) {
    adding(paste("wave", k), function(values, drivers) {
      values[["a"]] * sin(seq_len(nrow(drivers)) / (3 + k))
    }, free("a", uniform(-1, 1)))
  })
  entries <- c(list(sun, wind, drift), waves)
  upgrade <- do.call(loop, c(entries, list(m = m, control = list(max_steps = 3))))
  expect_setequal(vapply(upgrade$models[-1], `[[`, "", "mechanism"), c("sun", "wind"))
  expect_equal(sum(upgrade$candidates$from == "base"), 8)
  expect_lte(upgrade$runs_total, 450)
})

test_that("never more runs are made than asked for, and a verdict is given", {
  for (budget in c(3, 7, 8, 20, 30, 31, 32, 40, 60, 80, 100, 150)) {
    calls <- 0
    counted <- linear_simulator()
    whole <- counted$f
    counted$f <- function(values, drivers) {
      calls <<- calls + 1
      whole(values, drivers)
    }
    upgrade <- loop(sun, drift, simulator = counted, control = list(runs_total = budget))
    of <- paste("runs of a budget of", budget)
    expect_lte(upgrade$runs_total, budget, label = of)
    expect_lte(calls, budget + 1, label = of)  # one where the simulator is checked
    told <- summary(upgrade)
    expect_true(told$verdict %in% c("named", "likely", "unexplained", "nothing"), label = of)
    expect_output(print(upgrade), "of the simulator")
  }
  # The last is enough.
  expect_equal(upgrade$named_cause$mechanism, "sun")
  expect_error(loop(sun, control = list(runs_total = 0)), "runs_total", class = "amiss_error_input")
})

test_that("of several records no more runs are made than asked for", {
  m <- list(a = sunny_record(), b = sunny_record())
  # An odd one leaves a run that is not enough for both.
  for (budget in c(31, 61, 100)) {
    upgrade <- loop(sun, m = m, simulator = list(a = linear_simulator(), b = linear_simulator()),
                    control = list(runs_total = budget))
    expect_lte(upgrade$runs_total, budget, label = paste("runs of a budget of", budget))
  }
})

test_that("a budget that ends the loop is told", {
  # As many as the base model is run over its priors.
  spent <- loop(sun, control = list(runs_total = 6))
  expect_identical(spent$stopped_id, "budget")
  expect_match(spent$stopped_because, "budget of 6 runs")
  expect_length(spent$models, 1)
  expect_null(spent$candidates)
  # Half way through: what was not tried is no failure, and one run of it does not show that it
  # changes nothing.
  for (budget in c(7, 16)) {
    half <- loop(drift, sun, control = list(runs_total = budget))
    expect_lte(half$runs_total, budget)
    expect_true(all(half$candidates$judged_by %in% c("trial", "none")))
    expect_match(half$stopped_because, paste("budget of", budget, "runs"))
  }
})

test_that("runs over the priors that are asked for are made", {
  upgrade <- loop(sun, runs = 60)
  # 54 more than by default; a search from nearer and runs that lie in the region may save a part.
  expect_gte(upgrade$runs_total, loop(sun)$runs_total + 30)
  expect_equal(upgrade$named_cause$mechanism, "sun")
  expect_error(loop(sun, runs = "many"), "runs", class = "amiss_error_input")
  expect_error(loop(sun, runs = 0), "runs", class = "amiss_error_input")
})

# ---- trials

present_model <- made_once(function() {
  m <- sunny_record()
  control <- amiss:::fill_upgrade_control(quick_control, m)
  context <- amiss:::new_context(1, 1, control)
  base <- amiss:::base_model(amiss:::upgrade_start(linear_simulator(), m), NULL, context)
  list(model = amiss:::as_present(base, catalogue(), NULL, context), context = context)
})

trial_of <- function(mechanism, off = NULL) {
  present <- present_model()
  extended <- amiss:::extend(linear_simulator(), mechanism)
  before <- amiss:::runs_spent(present$context)
  trial <- amiss:::try_mechanism(present$model, mechanism$name, list(extended), off, 2,
                                 present$context)
  list(trial = trial, made = amiss:::runs_spent(present$context) - before)
}

test_that("a trial takes the present model's runs where its mechanism can be switched off", {
  present <- present_model()$model
  own <- trial_of(sun)
  known <- ncol(present$runs$outputs)
  runs <- own$trial$runs
  expect_equal(own$trial$off, c(s = -sqrt(3)))
  expect_equal(ncol(runs$outputs), known + own$made)
  expect_identical(runs$outputs[, seq_len(known)], present$runs$outputs[, seq_len(known)])
  expect_equal(unname(runs$z[seq_len(known), "s"]), rep(-sqrt(3), known))
  expect_equal(runs$z[seq_len(known), c("offset", "gain")], present$runs$z)
  # They are the simulator's: a run with the mechanism switched off is that of the present model.
  again <- amiss:::run_at(own$trial, runs$z[1:3, ], present_model()$context)
  expect_equal(again$outputs[, 1:3], runs$outputs[, 1:3])
  # Where it is switched off is known then: its run is not made again.
  twice <- trial_of(sun, off = own$trial$off)
  expect_equal(twice$trial$off, own$trial$off)
  expect_lt(twice$made, own$made)
})

# The state after `first` was adopted on the base model, and `second` on top of it; the trial of
# `second` on the base model was not trusted.
two_adopted <- function(first, second) {
  base <- present_model()
  base$model$name <- "base"
  extended <- amiss:::extend(linear_simulator(), first)
  with_first <- amiss:::try_mechanism(base$model, first$name, list(extended), NULL, 2,
                                      base$context)
  with_first <- amiss:::as_present(with_first, catalogue(), NULL, base$context)
  both <- amiss:::extend(extended, second, names(first$parameters))
  with_both <- amiss:::try_mechanism(with_first, second$name, list(both), NULL, 2, base$context)
  own <- data.frame(from = "base", mechanism = second$name, trusted = FALSE)
  list(state = list(present = with_first, former = list(base$model), candidates = own,
                    catalogue = catalogue(first, second), base = c("offset", "gain"),
                    started = list(record = "linear")),
       adopted = with_both, context = base$context)
}

test_that("what is adopted later is searched without what was before, from the mode of both", {
  found <- two_adopted(drift, sun)
  expect_identical(amiss:::may_replace(found$adopted, found$state, found$context), "drift")
  # As near as least squares on the simulator with the sun alone comes.
  base <- replace(found$state, "present", found$state$former)
  alone <- amiss:::error_alone(found$adopted, base, found$context)
  m <- sunny_record()
  at <- m$use == "calibrate"
  drivers <- m$raw$drivers[at, ]
  least <- sum(residuals(lm(m$y[at] ~ drivers[, "Te"] + drivers[, "Gv"]))^2) / m$noise_sd^2
  found_squares <- unname(alone)^2 * (sum(at) - 3)
  expect_gte(found_squares, least)
  # A search ends if it promises less than that, in units of the error that is left.
  expect_lt((found_squares - least) / 2, amiss:::rules$search_gain * found_squares / sum(at))
  found <- two_adopted(sun, drift)
  expect_identical(amiss:::may_replace(found$adopted, found$state, found$context), character())
  # Whose own trial was trusted is not searched.
  found <- two_adopted(drift, sun)
  found$state$candidates$trusted <- TRUE
  before <- amiss:::runs_spent(found$context)
  expect_identical(amiss:::may_replace(found$adopted, found$state, found$context), character())
  expect_identical(amiss:::runs_spent(found$context), before)
})

test_that("a mechanism that cannot be switched off has runs of its own alone", {
  always <- adding("always", function(values, drivers) values[["s"]] * drivers[, "Gv"],
                   free("s", uniform(0.005, 0.02)), boundary = "Gv")
  own <- trial_of(always)
  expect_null(own$trial$off)
  expect_equal(ncol(own$trial$runs$outputs), own$made)
  expect_identical(own$trial$level, "tried")
})

test_that("one whose parameters are off in the middle of their priors is found there", {
  both <- adding("both", function(values, drivers) values[["w"]] * drivers[, "Gv"],
                 free("w", uniform(-0.02, 0.02)), boundary = "Gv")
  own <- trial_of(both)
  expect_equal(own$trial$off, c(w = 0))
})

test_that("a mechanism that replaces a parameter of the model is tried without the model's runs", {
  anew <- mechanism("anew", boundary = "Te", sentence = "It acts.", edit = function(model) {
    function_simulator(function(values, drivers) {
      values[["offset"]] + values[["part"]] * drivers[, "Te"]
    }, free("offset", uniform(10, 30), "K"), free("part", uniform(0, 1)), boundary = "Te")
  })
  own <- trial_of(anew)
  expect_identical(own$trial$level, "tried")
  expect_equal(ncol(own$trial$runs$outputs), own$made)
  # The same model under another name: the same evidence, to what a trial states.
  factor <- amiss:::log10_factor(own$trial, present_model()$model)
  expect_lt(abs(factor), 0.5)
})

# A trial at the poor one of two places; the better one is narrow, and its first look says nothing
# of it.
poor_trial <- made_once(function() {
  bump <- function(place) 0.6 * exp(-((place - 0.2) / 0.25)^2) + exp(-((place - 0.85) / 0.08)^2)
  hidden <- adding("hidden",
                   function(values, drivers) 0.01 * bump(values[["place"]]) * drivers[, "Gv"],
                   free("place", uniform(0, 1)), boundary = "Gv")
  present <- present_model()
  amiss:::try_mechanism(present$model, "hidden",
                        list(amiss:::extend(linear_simulator(), hidden)), NULL,
                        bar_at(present$model), present$context)
})

bar_at <- function(model) list(factor = 2, standing = -Inf, leader = model)

test_that("a trial that ended at a poor mode is searched again from runs over its priors", {
  present <- present_model()
  poor <- poor_trial()
  place <- function(trial) {
    unit <- amiss:::to_unit(trial$runs$z[trial$mode, , drop = FALSE], trial$space)
    amiss:::unit_to_values(unit, trial$parameters)[1, "place"]
  }
  expect_lt(place(poor), 0.3)
  better <- amiss:::widened_trial(poor, present$model, bar_at(present$model), present$context)
  expect_equal(place(better), 0.85, tolerance = 0.02, ignore_attr = TRUE)
  expect_lt(amiss:::least_error(better), 0.5 * amiss:::least_error(poor))
})

# Its evidence is a lower bound then, and the run of least squares that of all searches.
test_that("a mode that was verified stays if there is no emulator of all modes", {
  skip_on_cran()  # second tier: tools/test --quick
  present <- present_model()
  poor <- poor_trial()
  one <- amiss:::verify_trial(poor, present$model, present$context)
  expect_true(one$fit$trust$trusted)
  far <- amiss:::to_unit(one$runs$z[one$mode, , drop = FALSE], one$space)
  far[, match("place", names(one$parameters))] <- 0.83
  stand_in(far_points = function(...) list(amiss:::from_unit(far, one$space)[1, ]))
  all <- amiss:::searched_again(one, present$model, present$context)
  expect_gt(all$fit$log_evidence, one$fit$log_evidence + 3)
  refuting <- amiss:::from_unit(0.99 * far, one$space)
  refuted <- function(model, present, context) {
    model <- amiss:::with_runs(model, refuting, context)$model
    model$fit$log_evidence <- -1e3
    model$fit$standard_error <- 1e6
    model$fit$check$passed <- FALSE
    model
  }
  stand_in(verify_trial = refuted)
  kept <- amiss:::searched_again(one, present$model, present$context)
  expect_identical(kept$fit$log_evidence, one$fit$log_evidence)
  expect_false(kept$fit$trust$trusted)
  expect_equal(kept$fit$modes$lost, 1)
  expect_lt(amiss:::least_error(kept), 0.5 * amiss:::least_error(one))
  # The runs that refuted it are kept; what no run has checked does not stay.
  expect_lt(min(colSums(abs(t(kept$runs$z) - c(refuting)))), 1e-6)
  stays <- function(all) amiss:::may_stay(all, one, present$model, present$context)
  expect_true(stays(one))
  unchecked <- one
  unchecked$fit$check <- NULL
  expect_false(stays(unchecked))
  # A refuted one stays if it is decisive beside an unknown response, and no less.
  refuted_one <- function(more) {
    one$fit$check$passed <- FALSE
    one$fit$log_evidence <- one$fit$log_evidence + more
    one
  }
  expect_true(stays(refuted_one(20)))
  expect_false(stays(refuted_one(-1)))
})

test_that("a mechanism that changes nothing costs its first look, and appears in no odds", {
  alone <- loop(sun)
  expect_warning(upgrade <- loop(nothing, sun), "\"nothing\" changes nothing",
                 class = "amiss_warning_input")
  expect_equal(upgrade$runs_total - alone$runs_total, 3)
  row <- upgrade$candidates[upgrade$candidates$mechanism == "nothing", ]
  expect_identical(row$judged_by, "silent")
  expect_true(is.na(row$log10_bf))
  expect_equal(row$probability, 0)
  expect_equal(row$runs, 3)
  other <- upgrade$candidates[upgrade$candidates$mechanism == "sun", ]
  expect_equal(other$log10_bf, alone$candidates$log10_bf)
  expect_equal(other$probability, alone$candidates$probability)
  expect_no_match(paste(summary(upgrade)$sure, collapse = " "), "2 mechanisms")
})

test_that("a mechanism whose runs fail does not end the loop, nor one whose numbers fail", {
  expect_warning(upgrade <- loop(fails, sun), "\"fails\" could not be tried",
                 class = "amiss_warning_trial")
  row <- upgrade$candidates[upgrade$candidates$mechanism == "fails", ]
  expect_identical(row$judged_by, "none")
  expect_equal(row$probability, 0)
  expect_equal(upgrade$named_cause$mechanism, "sun")
  tried <- amiss:::tried_model
  stand_in(tried_model = function(model, ...) {
    if (model$mechanism == "drift") amiss:::abort_numerical("No draw is possible here.")
    tried(model, ...)
  })
  expect_warning(upgrade <- loop(drift, sun), "\"drift\" could not be tried.*No draw is possible",
                 class = "amiss_warning_trial")
  expect_identical(upgrade$candidates$judged_by[upgrade$candidates$mechanism == "drift"], "none")
  expect_equal(upgrade$named_cause$mechanism, "sun")
})

test_that("a mechanism that fails in a part of its prior is tried where it does not", {
  half <- adding("half", function(values, drivers) {
    values[["s"]] * drivers[, "Gv"] * if (values[["s"]] > 0.015) NaN else 1
  }, free("s", uniform(0, 0.02)), boundary = "Gv")
  upgrade <- loop(half)
  expect_equal(upgrade$models[[2]]$mechanism, "half")
  # The sun's 0.01 lies a third below where it fails.
  expect_equal(coef(upgrade)[["s"]], 0.01, tolerance = 0.1)
})

test_that("where no mechanism could be computed, the result says so in all its words", {
  for (entry in list(fails, nothing)) {
    upgrade <- suppressWarnings(loop(entry))
    expect_identical(upgrade$stopped_id, "none_computed")
    expect_match(upgrade$stopped_because, "no mechanism could be computed")
    expect_no_error(told <- summary(upgrade))
    expect_identical(told$verdict, "unexplained")
    expect_output(print(told), "Gv")
  }
})

test_that("an edit is not asked for once the limit of steps is reached", {
  # Made anew, it would lose what was adopted.
  anew <- mechanism("drift", boundary = "Te", sentence = "It drifts.", edit = function(model) {
    function_simulator(function(values, drivers) {
      values[["offset"]] + values[["gain"]] * drivers[, "Te"] +
        values[["d"]] * seq_len(nrow(drivers)) / 100
    }, free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), free("d", uniform(-1, 1)),
    boundary = "Te")
  })
  upgrade <- loop(sun, anew)
  expect_identical(upgrade$stopped_id, "steps")
  expect_equal(upgrade$models[[2]]$mechanism, "sun")
})

test_that("a seed gives the same result on one thread and on two, another the same decision", {
  parts <- c("candidates", "gain", "named_cause", "runs_total", "stopped_because")
  m <- sunny_record()
  # Whatever the session's own random numbers are.
  one <- withr::with_seed(5, loop(drift, sun, m = m))
  two <- withr::with_seed(6, loop(drift, sun, m = m, threads = 2))
  expect_identical(two[parts], one[parts])
  values <- function(upgrade) lapply(upgrade$models, function(m) m$fit$values)
  expect_identical(values(two), values(one))
  other <- loop(drift, sun, seed = 2)
  expect_equal(other$named_cause$mechanism, "sun")
  row <- function(upgrade) upgrade$candidates[upgrade$candidates$mechanism == "sun", ]
  # Four standard errors of a difference, and a tenth of a decade for the emulators.
  error <- (row(one)$upper95 - row(one)$lower95) / 3.92
  expect_lt(abs(row(other)$log10_bf - row(one)$log10_bf), 4 * sqrt(2) * error + 0.1)
})

test_that("mechanisms are tried in the order of what the error responds to", {
  attribution <- list(table = data.frame(boundary = c("Te", "Gv"), log10_bf_dropped = c(0.2, 6),
                                         significant = c(FALSE, TRUE)))
  expect_equal(amiss:::trial_order(catalogue(drift, sun), attribution), c("sun", "drift"))
  attribution$table$significant <- FALSE
  expect_equal(amiss:::trial_order(catalogue(drift, sun), attribution), c("drift", "sun"))
})

# ---- rules and options

test_that("every number that decides has its unit, what it decides, its reason and its benchmark", {
  table <- decision_rules()
  expect_gt(nrow(table), 30)
  expect_false(anyNA(table))
  expect_true(is.numeric(table$value) && all(is.finite(table$value)))
  for (field in c("rule", "unit", "decides", "reason", "benchmark")) {
    expect_true(all(nzchar(trimws(table[[field]]))), label = paste("every", field, "is given"))
  }
  expect_match(table$benchmark, "^bench/[a-z_]+[.]R$")
  expect_false(anyDuplicated(table$rule) > 0)
})

test_that("every rule is read by the code, and the code reads no other", {
  package <- asNamespace("amiss")
  functions <- c(Filter(is.function, mget(ls(package, all.names = TRUE), package)),
                 lapply(amiss:::doubts, `[[`, "says"))
  text <- unlist(lapply(functions, deparse))
  text <- c(text, unlist(lapply(list(amiss:::upgrade_control), deparse)))
  read <- unlist(regmatches(text, gregexpr("rules[$][a-z_]+", text)))
  read <- sub("rules$", "", unique(read), fixed = TRUE)
  # The defaults of control hold their values: read once as the package is made.
  expect_setequal(union(read, c("decisive", "verify_rounds")), decision_rules()$rule)
})

test_that("bad settings are refused before anything runs", {
  refused <- function(what, ...) {
    expect_error(loop(sun, control = list(...)), what, class = "amiss_error_input")
  }
  refused("unknown option.*margin", margin = 1)
  refused("rounds", rounds = -1)
  refused("rounds", rounds = 0)
  refused("decisive", decisive = -1)
  refused("max_steps", max_steps = 1.5)
  refused("runs_total", runs_total = "few")
})

test_that("checks of a model end where the control says; one that they refute is not trusted", {
  m <- bent_measurements()
  of <- function(rounds) {
    loop(m = m, simulator = bent_simulator(), control = list(rounds = rounds))$models[[1]]$fit
  }
  expect_true(of(4)$trust$trusted)
  expect_equal(of(1)$rounds, 1)
  own <- amiss:::emulation_check
  stand_in(emulation_check = function(...) {
    utils::modifyList(own(...), list(passed = FALSE, ratio = 1, effective = 0.01, border = 0.5,
                                     verdict = "the emulator is off"))
  })
  expect_false(of(2)$trust$trusted)
})
