layers_of <- function(figure) vapply(figure$layers, function(layer) class(layer$geom)[1], "")

test_that("every figure of an upgrade draws, whatever is missing from it", {
  skip_on_cran()
  grDevices::pdf(NULL)
  withr::defer(grDevices::dev.off())
  full <- small_upgrade()
  for (upgrade in list(full, base_only(full), without_held_out(full),
                       without_held_out(base_only(full)))) {
    for (which in figure_names) {
      figure <- ggplot2::autoplot(upgrade, which)
      expect_true(ggplot2::is.ggplot(figure))
      expect_gt(figure_height(figure), 1)
      expect_error(ggplot2::ggplot_build(figure), NA)
    }
  }
})

test_that("figures show what they are for", {
  upgrade <- small_upgrade()
  fit <- ggplot2::autoplot(upgrade, "fit")
  expect_identical(nrow(fit$data), 2L * nrow(upgrade$models[[1]]$prediction))
  expect_true("GeomRibbon" %in% layers_of(fit))
  expect_match(fit$labels$title, "typical error falls from")
  expect_identical(levels(fit$data$stage), c("before", "after"))

  candidates <- ggplot2::autoplot(upgrade, "candidates")
  expect_identical(as.character(candidates$data$mechanism[candidates$data$adopted]), "sun")
  expect_true(all(c("GeomVline", "GeomLinerange", "GeomPoint") %in% layers_of(candidates)))

  expect_setequal(ggplot2::autoplot(upgrade, "parameters")$data$name,
                  c("offset", "gain", "sun_gain"))
  expect_setequal(ggplot2::autoplot(upgrade, "attribution")$data$boundary, c("Te", "Gv"))
  expect_setequal(ggplot2::autoplot(upgrade, "gain")$data$score, c("rmse", "crps", "coverage95"))
  expect_lte(max(ggplot2::autoplot(upgrade, "mean_day")$data$hour), 24)
})

test_that("titles tell of a change what the numbers beside them say", {
  upgrade <- small_upgrade()
  with_errors <- function(before, after) {
    upgrade$models[[1]]$scores$validate[["rmse"]] <- before
    upgrade$models[[2]]$scores$validate[["rmse"]] <- after
    upgrade$models <- upgrade$models[1:2]
    vapply(c("gain", "steps", "fit"),
           function(which) ggplot2::autoplot(upgrade, which)$labels$title, "")
  }
  same <- with_errors(0.0838, 0.0842)
  expect_match(same[["gain"]], "the error stays at 0.084 K;", fixed = TRUE)
  # though it falls in calibration
  expect_identical(same[["steps"]], "No step lowers the typical error (held out)")
  expect_match(same[["fit"]], "it stays at 0.084 K", fixed = TRUE)
  less <- with_errors(0.4, 0.1)
  expect_match(less[["gain"]], "the error falls by 75 %;", fixed = TRUE)
  expect_match(less[["steps"]], "falls from 0.40 to 0.10 K", fixed = TRUE)
  expect_match(with_errors(0.1, 0.12)[["gain"]], "the error rises by 20 %;", fixed = TRUE)
})

test_that("a stand-in is not called for", {
  upgrade <- small_upgrade()
  title <- function() ggplot2::autoplot(upgrade, "candidates")$labels$title
  upgrade$models[[2]]$verdict <- "named"
  expect_identical(title(), "The measurements call for sun")
  upgrade$models[[2]]$verdict <- "stand-in"
  expect_identical(title(), "Adopted, but only as a stand-in: sun")
})

test_that("no error is less than can be expected", {
  upgrade <- small_upgrade()
  subtitle <- function() ggplot2::autoplot(upgrade, "steps")$labels$subtitle
  upgrade$measurements$noise_sd <- 1e-6
  expect_match(subtitle(), "about the smallest error that can be expected")
  upgrade$measurements$noise_sd <- 10
  expect_match(subtitle(), "less noisy than stated")
  expect_no_match(subtitle(), "smallest")
})

test_that("most of what is missing is more than half", {
  expect_identical(missing_title(c(sun = 3, wind = 1), "sun", "the model", "K"),
                   "what the model lacks is mostly a response to sun, typically 3.0 K")
  even <- c(sun = 3, wind = 2.9, sky = 2)
  expect_match(missing_title(even, "sun", "before", "K"), "^before the change, the largest resp")
  expect_match(missing_title(even, "wind", "before", "K"), "the largest significant response")
})

test_that("the density of a posterior does not fall to the end of a flat prior", {
  flat <- data.frame(value = seq(0, 1, length.out = 128), density = 1)
  density <- posterior_points(stats::ppoints(500), rep(1, 500), flat)$density
  expect_gt(min(density), 0.9 * max(density))
})

test_that("a constant between residual and discrepancy is explained", {
  table <- data.frame(residual = c(1, 2, 1, 2), discrepancy = c(-0.5, 0.5, 1, 2),
                      stage = rep(c("before", "after"), each = 2))
  expect_match(constant_words(table, "K", c(-1, 2)), "(1.5 K before)", fixed = TRUE)
  expect_null(constant_words(table[3:4, ], "K", c(-1, 2)))
})

test_that("titles begin with a capital, but not if the first word is a name", {
  given <- c("sun moves", "Te moves", "x2 moves", "u_south moves", "sun")
  expect_identical(vapply(given, capital, "", USE.NAMES = FALSE),
                   c("Sun moves", "Te moves", "x2 moves", "u_south moves", "Sun"))
})

test_that("stages have figures of their own", {
  grDevices::pdf(NULL)
  withr::defer(grDevices::dev.off())
  upgrade <- small_upgrade()
  model <- upgrade$models[[1]]
  for (x in list(upgrade, model$fit, model$attribution, discrepancy(model$fit),
                 upgrade$measurements)) {
    drawn <- withVisible(plot(x))
    expect_true(ggplot2::is.ggplot(drawn$value))
    expect_false(drawn$visible)
  }
  expect_error(plot(upgrade, "nonsense"), class = "amiss_error_input")
})

test_that("figures are saved, one PNG each", {
  skip_on_cran()
  which <- figures_of(small_upgrade())
  expect_identical(figure_files(which), paste0(figure_names, ".png"))
  path <- withr::local_tempfile(fileext = ".png")
  for (one in which) {
    save_figure(ggplot2::autoplot(small_upgrade(), one), path, dpi = 40)
    expect_gt(file.size(path), 1000)
    unlink(path)
  }
})

test_that("numbers are short and readable", {
  expect_identical(short(c(1.108, 0.1656, 0.0801, 10.4, 1.6e6)),
                   c("1.1", "0.17", "0.080", "10", "1,600,000"))
  expect_identical(change_words(1.11, 0.166, "K"), "falls from 1.1 to 0.17 K")
  expect_identical(change_words(0.1, 0.1001, ""), "stays at 0.10")
  expect_identical(level_unit("K", c(20, 30)), "\u00b0C")
  expect_identical(level_unit("K", c(290, 300)), "K")
  expect_identical(hour_of_day(c(1, 24, 25), 1), c(0.5, 23.5, 0.5))
})

test_that("a circular condition is shown in degrees", {
  table <- data.frame(hour = 1:48, Ti = 20 + sin(1:48 / 4), Wd = (1:48 * 15) %% 360)
  m <- measurements(table, time = "hour", target = "Ti", boundary = ~ circular(Wd), noise_sd = 0.1,
                    warmup = 6)
  expect_equal(condition_values(m, "Wd"), table$Wd)
})

test_that("an argument that a figure does not know is an error", {
  upgrade <- small_upgrade()
  fit <- upgrade$models[[1]]$fit
  for (x in list(upgrade, fit, upgrade$models[[1]]$attribution, discrepancy(fit),
                 upgrade$measurements)) {
    expect_error(plot(x, colour = "red"), "must be empty")
    expect_error(ggplot2::autoplot(x, colour = "red"), "must be empty")
  }
})

test_that("a response larger than what least squares leaves is explained", {
  found <- discrepancy(plain_linear_fit())
  size <- max(sqrt(colMeans(found$responses^2)))
  told <- function(left) amiss:::figure_missing(found, left = left)$labels$subtitle
  expect_match(told(0.9 * size), "least squares leaves only .* its parameters make up for a part")
  expect_no_match(told(1.1 * size), "least squares")
})
