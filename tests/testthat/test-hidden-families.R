# The families of worlds beside the box of test-hidden-effects.R: thermal networks, a catchment with
# thresholds, and base models that are wrong in structure. First the generators, held against least
# squares on the simulators themselves; then four worlds of each family, scored (eight if
# AMISS_EXTENDED_TESTS is "true"). AMISS_WORLD_SEED moves the seeds of the latter.
bench <- test_path("..", "..", "bench", "hidden_effects")

families_scope <- function() {
  if (!dir.exists(bench)) skip("bench/ is not part of the installed package")
  scope <- new.env(parent = globalenv())
  parts <- c("worlds", "least_squares", "network", "runoff", "wrong", "families", "score")
  for (part in parts) sys.source(file.path(bench, paste0(part, ".R")), scope)
  scope
}

new_families <- c("network", "runoff", "wrong")
short <- c(network = 5, runoff = 30, wrong = 5)  # days

true_model <- function(world)
  Reduce(function(model, kind) world$catalogue[[kind]]$edit(model), world$kinds, world$base)

true_values <- function(world) {
  c(world$values, unlist(lapply(unname(world$effects), function(e) e[names(e) != "size"])))
}

output_at <- function(simulator, values, drivers) {
  simulate_runs(simulator, rbind(values[names(free_parameters(simulator))]), drivers,
                simulator$step)[, 1]
}

rms <- function(x) sqrt(mean(x^2))

# RMS of the noise that was drawn, at the steps that calibrate.
drawn_noise <- function(world) {
  m <- world$measurements
  own <- !is.na(m$block)
  clean <- as.numeric(rowsum(world$clean[own], m$block[own])) / m$per_step
  rms((m$y - clean)[m$use == "calibrate"])
}

test_that("worlds of the box are what they were", {
  skip_on_cran()
  scope <- families_scope()
  kinds <- vapply(c(1:3, 20001, 20002), function(seed) scope$draw_world(seed)$kind, "")
  expect_equal(kinds, c("unmetered load", "two effects", "wind-driven infiltration",
                        "missing thermal mass", "wind-driven infiltration"))
  world <- scope$draw_world(20001)
  expect_equal(world$family, "box")
  expect_equal(world$true_boundary, c("RHP", "Te", "Gv"))
  # As drawn before the other families were there.
  expect_equal(c(world$noise, mean(world$clean)), c(0.0818652353, 36.0845123442), tolerance = 1e-8)
})

test_that("a world follows from its seed, with all that scoring needs", {
  skip_on_cran()
  scope <- families_scope()
  fields <- names(scope$draw_world(1))
  for (family in new_families) {
    one <- scope$family_world(family, 3, strength = 2, days = short[[family]])
    set.seed(99)
    two <- scope$family_world(family, 3, strength = 2, days = short[[family]])
    other <- scope$family_world(family, 4, strength = 2, days = short[[family]])
    expect_true(all(fields %in% names(one)), info = family)
    expect_equal(one$family, family)
    drawn <- c("data", "values", "effects", "noise")
    expect_identical(one[drawn], two[drawn], info = family)
    expect_false(identical(one$data, other$data), info = family)
    expect_true(all(one$kinds %in% names(one$catalogue)), info = family)
    expect_true(all(one$true_boundary %in% one$measurements$conditions), info = family)
  }
})

test_that(
  "mechanisms stack: parameters are never lost, and where each is at zero the base model is left", {
  skip_on_cran()
  scope <- families_scope()
  for (family in c("network", "runoff")) {
    for (seed in 1:3) {
      world <- scope$family_world(family, seed, kind = "none", days = short[[family]])
      expect_length(world$catalogue, 5)
      drivers <- world$measurements$raw$drivers
      plain <- output_at(world$base, world$values, drivers)
      for (order in list(1:5, c(4, 2, 5, 1, 3))) {
        model <- world$base
        for (entry in world$catalogue[order]) {
          before <- free_parameters(model)
          model <- entry$edit(model)
          expect_identical(free_parameters(model)[names(before)], before, info = entry$name)
          expect_gt(length(free_parameters(model)), length(before))
        }
        parameters <- free_parameters(model)
        middle <- amiss:::unit_to_values(matrix(0.5, 1, length(parameters)), parameters)[1, ]
        added <- function(entry)
          setdiff(names(free_parameters(entry$edit(world$base))), names(world$values))
        extents <- vapply(world$catalogue, function(entry) added(entry)[1], "")
        with_base <- replace(middle, names(world$values), world$values)
        expect_equal(output_at(model, replace(with_base, extents, 0), drivers), plain,
                     tolerance = 1e-4, info = paste(family, seed))
        expect_gt(rms(output_at(model, with_base, drivers) - plain), 1e-3)
      }
    }
  }
})

test_that("a prior that was changed survives a mechanism", {
  scope <- families_scope()
  world <- scope$family_world("network", 1, kind = "none", days = 5)
  narrow <- free("C_air", uniform(0.9, 1.1), "kWh/K")
  narrowed <- change_component(world$base, "air", capacity = narrow)
  expect_identical(free_parameters(world$catalogue[["heater state"]]$edit(narrowed))$C_air, narrow)
})

test_that(paste("the models' coarser steps stay below the noise: a simulator with the true values",
                "gives the truth"), {
  skip_on_cran()
  scope <- families_scope()
  for (family in c("network", "runoff")) {
    kinds <- scope$families[[family]]$kinds
    for (i in seq_along(kinds)) {
      world <- scope$family_world(family, 10 + i, kind = kinds[i], strength = 1,
                                  days = short[[family]])
      own <- world$measurements$raw$use != "warmup"
      error <- (output_at(true_model(world), true_values(world), world$measurements$raw$drivers) -
                world$clean)[own]
      expect_lt(rms(error), 0.3 * world$noise, label = paste(family, kinds[i]))
    }
  }
})

test_that("least squares with what is really there reaches the noise, and without it does not", {
  skip_on_cran()
  scope <- families_scope()
  some <- list(network = c("none", "solar gain on the air", "heater state"),
               runoff = c("none", "overflow threshold", "snow store"))
  for (family in names(some)) {
    kinds <- some[[family]]
    for (i in seq_along(kinds)) {
      world <- scope$family_world(family, 20 + i, kind = kinds[i], strength = 4,
                                  days = short[[family]])
      told <- paste(family, kinds[i])
      noise <- drawn_noise(world)
      ratio <- scope$best_rmse(world) / noise
      # Parameters take up a part of the noise (all the more if it is autocorrelated), coarser steps
      # add a little.
      expect_gt(ratio, 0.7, label = told)
      expect_lt(ratio, 1.1, label = told)
      if (kinds[i] == "none") {
        expect_length(world$kinds, 0)
        expect_equal(world$achieved, 0)
        next
      }
      expect_equal(world$achieved, 4, tolerance = 0.05, label = told)
      base <- scope$best_on_record(world$base, world$measurements, 1, starts = 2)$rms
      expect_gt(base / noise, 2, label = told)
    }
  }
})

test_that(
  "a wrong base leaves what its parameters cannot follow, whether an effect is hidden or not", {
  skip_on_cran()
  scope <- families_scope()
  worlds <- lapply(1:12, function(seed) scope$family_world("wrong", seed, days = 5))
  hidden <- vapply(worlds, function(w) length(w$kinds) > 0, NA)
  structure <- vapply(worlds, `[[`, "", "structure")
  expect_true(any(hidden) && any(!hidden))
  expect_setequal(structure, scope$wrong_structures)
  misfit <- vapply(worlds, `[[`, 0, "misfit")
  expect_true(all(misfit > 0))
  expect_gt(stats::median(misfit), 1.5)
  layers <- Filter(function(w) !length(w$kinds), worlds[structure == "one layer for three"])
  best <- function(world) scope$best_on_record(world$base, world$measurements, 1, starts = 1)$rms
  ratio <- vapply(layers[1:2], function(w) best(w) / drawn_noise(w), 0)
  expect_gt(min(ratio), 1.5)
})

test_that(
  "rates tell families, verdicts and checks apart, and do without what the package does not say", {
  scope <- families_scope()
  row <- function(...) {
    usual <- list(family = "network", kind = "heater state", hidden = TRUE,
                  true_mechanism = "heater state", true_boundary = "P", achieved = 4,
                  condition = "P", attributed_condition = "P", mechanism = "heater state",
                  adopted = c("heater state", "envelope leak"), verdicts = c("named", "likely"),
                  verdict = "named", unexplained = FALSE, covered = TRUE,
                  physical_covered = TRUE, check_passed = TRUE, rmse_ratio = 1.1, gain_share = 1,
                  wall_s = 1)
    utils::modifyList(usual, list(...))
  }
  rows <- list(row(), row(verdicts = c("named", "named"), rmse_ratio = 1.5),
               row(check_passed = FALSE), row(check_passed = NA),
               row(kind = "none", hidden = FALSE, true_mechanism = character(), achieved = 0,
                   verdicts = c("stand-in", "likely")),
               row(family = "runoff"))
  rates <- scope$by_family(rows, scope$score_rates)
  expect_named(rates, c("network", "runoff"))
  network <- lapply(rates$network, `[[`, "rate")
  expect_equal(network$false_named, 1 / 5)
  expect_equal(network$hidden_among_adopted, 1)
  expect_equal(network$rmse_ratio_ok, 3 / 4)
  expect_equal(network$check_failed, 1 / 4)
  expect_equal(rates$network$check_failed$n, 4)
  expect_equal(network$named_unchecked, 1)
  expect_equal(network$false_mechanism, 1)
  expect_equal(rates$network$right_paper_condition$n, 0)
  told <- scope$attributed_kinds(
    c(rows, list(row(attributed_condition = "Te"), row(attributed_condition = NA))))
  expect_equal(told, data.frame(kind = "heater state", right = 5L, wrong = 1L, none = 1L))
  model <- function(...) list(...)
  upgrade <- list(
    models = list(model(), model(verdict = "stand-in", fit = list(check = list(passed = FALSE)))))
  expect_equal(scope$mechanism_verdicts(upgrade, "named"), "stand-in")
  expect_false(scope$check_passed(upgrade))
  older <- list(models = list(model(), model(fit = list())))
  expect_equal(scope$mechanism_verdicts(older, "likely"), "likely")
  expect_true(is.na(scope$check_passed(older)))
})

# Bounds on eight worlds of a family, or on the twelve of all in the short form. At most one of them
# has a mechanism named that is not there. Of the networks and catchments whose effect the base
# model cannot imitate to a fifth of the noise all but one have it among what is adopted. Nowhere is
# anything named on an emulator that the simulator does not confirm.
family_worlds <- function(scope, extended) {
  effects <- function(family) scope$families[[family]]$mechanisms
  network <- c(effects("network"), "solar gain on the air", "none", "none")
  runoff <- c(effects("runoff"), "overflow threshold", "none", "none")
  layers <- c("none", "window transmission", "none", "neighbour coupling")
  zones <- c("none", "solar gain on the air", "none", "envelope leak")
  worlds <- data.frame(family = rep(new_families, each = 8),
                       kind = c(network, runoff, layers, zones),
                       strength = rep_len(c(4, 2, 8, 4), 24),
                       structure = rep(c(NA, scope$wrong_structures), c(16, 4, 4)))
  worlds$seed <- world_seed(900) + seq_len(24)
  worlds$days <- short[worlds$family]
  if (extended) worlds else worlds[c(outer(c(1, 2, 6, 7), c(0, 8, 16), `+`)), ]
}

# The design promises so many runs of the simulator in the median over the worlds of a family. A
# single world may take more: one that ends unexplained is searched again from all priors, a base on
# a curved ridge asks for several rounds. No more than three times as many.
promised_runs <- c(network = 600, runoff = 500, wrong = 600)

expect_runs <- function(rows, promised) {
  runs <- vapply(rows, function(r) as.numeric(r$runs_total), 0)
  worst <- rows[[which.max(runs)]]
  expect_lte(stats::median(runs), promised, label = paste("median number of runs,", worst$family))
  expect_lte(max(runs), 3 * promised,
             label = sprintf("runs of the worst world (%s, %s, seed %d)", worst$family, worst$kind,
                             worst$seed))
}

test_that("what is hidden in worlds of each family is found, and nothing else is named", {
  skip_on_cran()
  scope <- families_scope()
  extended <- identical(Sys.getenv("AMISS_EXTENDED_TESTS"), "true")
  worlds <- family_worlds(scope, extended)
  # The last ones take longest: they begin.
  rows <- parallel::mclapply(rev(seq_len(nrow(worlds))), function(i) {
    w <- worlds[i, ]
    fixed <- list(w$family, w$seed, kind = w$kind, strength = w$strength, days = w$days)
    if (!is.na(w$structure)) fixed$structure <- w$structure
    control <- list(max_steps = 1, calibration = list(ais = list(precision = 0.3)))
    scope$score_world(do.call(scope$family_world, fixed), control, rivals = FALSE,
                      least_squares = FALSE)
  }, mc.cores = 2, mc.preschedule = FALSE)
  failed <- vapply(rows, inherits, NA, "try-error")
  expect_false(any(failed), info = paste(unlist(rows[failed]), collapse = "; "))
  rows <- rows[!failed]
  falsely <- function(row) any(!scope$named_mechanisms(row) %in% row$true_mechanism)
  told <- function(rows) {
    paste(vapply(rows,
                 function(r)
                   sprintf("%s %s (seed %d, ratio %.1f): %s", r$family, r$kind, r$seed, r$achieved,
                           paste(r$adopted, r$verdicts, collapse = ", ")), ""), collapse = "; ")
  }
  families <- split(rows, factor(vapply(rows, `[[`, "", "family"), new_families))
  expect_equal(lengths(families), c(table(factor(worlds$family, new_families))))
  for (family in new_families) expect_runs(families[[family]], promised_runs[[family]])
  for (own in if (extended) families else list(rows)) {
    wrongly <- Filter(falsely, own)
    expect_lte(length(wrongly), 1, label = paste0("named though not there (", told(wrongly), ")"))
    # Where the base model comes down to the noise by itself, no record could show what is missing.
    with_effect <- Filter(
      function(r) r$family != "wrong" && r$hidden && r$rmse[1] > 1.2 * r$noise, own)
    if (own[[1]]$family != "wrong" || !extended) expect_gte(length(with_effect), 5)
    missed <- Filter(function(r) !r$true_mechanism %in% r$adopted, with_effect)
    expect_lte(length(missed), 1, label = paste0("missed (", told(missed), ")"))
  }
  unchecked <- Filter(function(r) isFALSE(r$check_passed) && length(scope$named_mechanisms(r)),
                      rows)
  expect_length(unchecked, 0)
})
