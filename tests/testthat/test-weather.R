test_that("the weather is plausible, follows its seed and the sun's path", {
  w <- synthetic_weather(6, seed = 1)
  expect_equal(nrow(w), 576)
  expect_identical(w, synthetic_weather(6, seed = 1))
  expect_true(all(w$Gh >= 0 & w$Gh < 1300 & w$Gv >= 0 & w$Ws > 0 & w$Wd >= 0 & w$Wd < 360 &
                  w$Lw > 150 & w$Lw < 500))
  expect_equal(sum(w$Gh[w$hour %% 24 <= 4]), 0)
})

test_that("sun elevation at noon is 90 degrees less latitude plus declination", {
  sun <- amiss:::sun_position(172 + 0.5, 36.8)  # midsummer: declination 23.45 degrees
  expect_equal(sun$elevation * 180 / pi, 90 - 36.8 + 23.45, tolerance = 0.002)
  expect_equal(sun$azimuth * 180 / pi, 180, tolerance = 1e-3)
  # equinox, 6 h: east
  expect_equal(amiss:::sun_position(80 + 0.25, 36.8)$azimuth * 180 / pi, 90, tolerance = 0.02)
})

test_that("a heating sequence holds each length as often on as off", {
  p <- rolbs(124 * 4, 0.25, 100, lengths = c(1, 2, 4, 8, 16), seed = 2)[seq_len(62 * 4)]
  expect_setequal(unique(p), c(0, 100))
  expect_equal(mean(p), 50)
})
