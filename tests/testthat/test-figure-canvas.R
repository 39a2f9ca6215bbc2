# Widths in pixels at 120 to an inch, as figures are saved.
widths <- c(400, 800, 1400)
fonts <- c("DejaVu Sans", "Liberation Sans")

skip_without_devices <- function() {
  skip_if_not_installed("ragg")
  skip_if_not_installed("systemfonts")
  skip_if_not(all(fonts %in% systemfonts::system_fonts()$family), "the fonts are not installed")
}

# TRUE where nothing is drawn along the edges of the canvas: text that runs out of it crosses them.
edges_blank <- function(figure, width, res = 120) {
  captured <- ragg::agg_capture(width = width, height = figure_height(figure, width / res) * res,
                                units = "px", res = res, background = "white")
  withr::defer(grDevices::dev.off())
  print(figure)
  pixels <- captured(native = FALSE)
  n <- dim(pixels)
  edge <- c(pixels[c(1, 2, n[1] - 1, n[1]), ], pixels[, c(1, 2, n[2] - 1, n[2])])
  all(grepl("^(#FFFFFF(FF)?|WHITE)$", toupper(edge)))
}

test_that("no text leaves the canvas, whatever its width and font", {
  skip_on_cran()
  skip_without_devices()
  upgrade <- small_upgrade()
  extended <- identical(Sys.getenv("AMISS_EXTENDED_TESTS"), "true")
  for (k in seq_along(figure_names)) for (w in seq_along(widths)) {
    for (font in if (extended) fonts else fonts[1 + (k + w) %% 2]) {
      withr::with_options(list(amiss.font = font), {
        figure <- ggplot2::autoplot(upgrade, figure_names[k])
        expect_true(edges_blank(figure, widths[w]), info = paste(figure_names[k], widths[w], font))
      })
    }
  }
})

test_that("titles of a fixed number of letters leave it", {
  skip_without_devices()
  figure <- withr::with_options(list(amiss.font = fonts[1]),
                                ggplot2::autoplot(small_upgrade(), "attribution"))
  figure$labels$subtitle <- paste(strwrap(figure$labels$subtitle, 92), collapse = "\n")
  class(figure) <- setdiff(class(figure), "amiss_figure")
  expect_false(edges_blank(figure, 800))
})

test_that("lines are as long as the width allows, in the font at hand", {
  grDevices::pdf(NULL)
  withr::defer(grDevices::dev.off())
  text <- paste(rep("97 % of it lie inside", 8), collapse = " ")
  for (width in c(1, 2, 4)) {
    lines <- strsplit(wrap_measured(text, width, 12), "\n")[[1]]
    expect_identical(paste(lines, collapse = " "), text)
    expect_false(any(grepl("^%", lines)))
    expect_lte(max(text_inches(lines, 12)), width)
  }
  expect_gt(length(strsplit(wrap_measured(strrep("x", 60), 1, 12), "\n")[[1]]), 1)
  expect_identical(wrap_measured("", 1, 12), "")
  # A unit at the end does not stand alone, where there is room for it beside what it belongs to.
  with_unit <- "the response of the room to the sun, in 1.0 / K"
  for (width in seq(0.8, 4, by = 0.1)) {
    lines <- strsplit(wrap_measured(with_unit, width, 12), "\n")[[1]]
    expect_match(lines[length(lines)], "/ K$")
  }
  expect_identical(wrap_measured("neighbouring K", text_inches("neighbouring", 12) * 1.02, 12),
                   "neighbouring\nK")
})

test_that("a figure keeps its whole title, and builds without a device", {
  skip_if(grDevices::dev.cur() > 1, "a device is open")
  figure <- ggplot2::autoplot(small_upgrade(), "fit")
  expect_no_match(figure$labels$title, "\n")
  expect_s3_class(ggplot2::ggplot_build(figure), "ggplot_built")
  expect_identical(grDevices::dev.cur()[[1]], 1L)
})

test_that("figures look as they did", {
  # kept where this is skipped
  for (file in c("measurements.svg", "sampler.svg")) announce_snapshot_file(name = file)
  skip_on_cran()
  skip_if_not_installed("vdiffr")
  version <- utils::packageVersion("ggplot2")
  skip_if_not(version >= "3.4.1" && version < "3.5", "drawn with ggplot2 3.4")
  m <- measurements(data.frame(hour = 1:96, Ti = 20 + sin(1:96 / 4), Te = 5 + 3 * sin(1:96 / 4)),
                    time = "hour", target = "Ti", boundary = ~Te, noise_sd = 0.1, warmup = 6,
                    unit = "K", name = "a room")
  vdiffr::expect_doppelganger("measurements", ggplot2::autoplot(m))
  ladder <- data.frame(beta = c(0.1, 0.4, 1), step = 1, sweeps = 3, acceptance = c(0.4, 0.3, 0.25),
                       ess = c(0.7, 0.6, 0.65))
  sampler <- list(ladder = ladder, annealed = c(-12.3, 0.2), second = c(-12.1, 0.1), trusted = TRUE,
                  verdict = "trusted")
  vdiffr::expect_doppelganger("sampler", figure_sampler(list("the model" = sampler)))
})

test_that("Sobol indices stay on the canvas", {
  skip_without_devices()
  table <- data.frame(
    parameter = c("a", "b", "c"), first = c(0.6, 0.2, 0), first_sampling = 0.02,
    first_emulator = 0.1, total = c(0.7, 0.3, 0.02), total_sampling = 0.01, total_emulator = 0.05,
    label = c("conductivity of the insulation of all outer walls", "g", "air changes per hour"))
  indices <- structure(list(format_version = format_version, table = table), class = "amiss_sobol")
  for (width in widths) expect_true(edges_blank(ggplot2::autoplot(indices), width), info = width)
})

test_that("a legend of many keys stays on the canvas", {
  skip_without_devices()
  keys <- c("adopted", "another was better", "held-out too weak", "refused", "too weak",
            "estimate rough")
  points <- data.frame(x = 1:6, key = factor(keys, keys), row = "infiltration")
  figure <- ggplot2::ggplot(points, ggplot2::aes(.data$x, .data$row, colour = .data$key)) +
    ggplot2::geom_point() + amiss:::figure_theme()
  figure <- amiss:::with_keys(amiss:::with_height(figure, 4), keys)
  for (width in widths) expect_true(edges_blank(figure, width), info = width)
})
