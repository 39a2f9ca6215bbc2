# The checks of bench/calibration.R: a short form with fixed seeds, and the long one when
# AMISS_EXTENDED_TESTS is "true".
skip_on_cran()  # second tier: tools/test --quick
bench <- test_path("..", "..", "bench", "calibration")
extended <- identical(Sys.getenv("AMISS_EXTENDED_TESTS"), "true")
checks <- new.env()
if (dir.exists(bench)) {
  for (part in c("world", "prior_predictive", "ranks", "model_probability", "bridge"))
    sys.source(file.path(bench, paste0(part, ".R")), checks)
  checks$world <- checks$sbc_world()
}
skip_without_bench <- function()
  if (!dir.exists(bench)) skip("bench/ is not part of the installed package")

# A right implementation fails with probability 0.001 for a fresh seed (Holm's method over the
# quantities).
expect_uniform <- function(...) {
  rows <- do.call(rbind, list(...))
  expect_gt(min(p.adjust(rows$p_value, "holm")), 0.001,
            label = paste(rows$quantity[which.min(rows$p_value)], "ranks"))
}
records <- if (extended) 200 else 60

test_that("ranks of draws from the prior are uniform among draws of posteriors (5) and (6)", {
  skip_without_bench()
  for (shared in if (extended) c(FALSE, TRUE) else FALSE) {
    results <- checks$sbc_run("paper", checks$world, records, 4e4, list(shared_lambda = shared))
    expect_uniform(checks$sbc_rows("(5)", results, "inside"),
                   checks$sbc_rows("(6)", results, "outside"))
  }
})

test_that("ranks of draws from the prior are uniform among draws of the joint posterior", {
  skip_without_bench()
  results <- checks$sbc_run("history", checks$world, 2 * records, 5e4)
  expect_uniform(checks$sbc_rows("joint", results, "joint"))
})

test_that("uniformity is missed where it should be", {
  skip_without_bench()
  set.seed(1)
  expect_lt(checks$uniformity(pmin(19, stats::rpois(60, 12))), 1e-4)
  expect_gt(checks$uniformity(sample(0:19, 60, replace = TRUE)), 0.01)
})

test_that("probabilities of models are calibrated", {
  skip_without_bench()
  skip_if_not(extended, "the long form runs with AMISS_EXTENDED_TESTS=true")
  worlds <- checks$box_worlds()
  for (name in names(checks$sources)) {
    cases <- do.call(rbind,
                     lapply(6e4 + 1:300,
                            function(seed) checks$model_case(worlds, checks$sources[[name]], seed)))
    expect_uniform(checks$probability_rows(cases, name))
  }
})

test_that("scores of probabilities see overconfidence", {
  skip_without_bench()
  set.seed(2)
  p <- matrix(stats::rexp(900), 300, dimnames = list(NULL, c("A", "B", "C")))
  p <- p / rowSums(p)
  true <- apply(p, 1, function(row) sample(3, 1, prob = row))
  sharp <- p^2 / rowSums(p^2)
  expect_gt(min(checks$probability_rows(cbind(true, p), "right", 999)$p_value), 0.01)
  expect_lt(min(checks$probability_rows(cbind(true, sharp), "overconfident", 999)$p_value), 0.01)
})

test_that("evidences agree with bridge sampling", {
  skip_without_bench()
  skip_if_not_installed("bridgesampling")
  rows <- checks$bridge_rows(checks$world, 7e4, records = if (extended) 10 else 3)
  expect_gt(min(rows$p_value), 0.001)  # chi-square of the differences over their errors
  expect_lt(max(rows$largest), 0.3)
})
