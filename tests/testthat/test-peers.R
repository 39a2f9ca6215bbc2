skip_on_cran()  # second tier: tools/test --quick
test_that("the posterior of SEPIA's ball drop is SEPIA's", {
  script <- test_path("..", "..", "bench", "peers", "ball_drop.R")
  if (!file.exists(script)) skip("bench/ is not part of the installed package")
  peer <- new.env()
  sys.source(script, peer)
  own <- peer$ball_drop(sub("\\.R$", "", script))
  expect_true(own$posterior$trusted)
  # A quarter of the posterior's standard deviation: the data's noise differs (0.02 sd), the
  # hyper-parameters are fixed.
  expect_lt(abs(own$mean - peer$published[["mean"]]), 0.25 * peer$published[["sd"]])
  expect_equal(own$sd, peer$published[["sd"]], tolerance = 0.2)
})
