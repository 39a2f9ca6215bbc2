# A budget of runs is shared: each stage leaves a part of it to those that follow.

test_that("a stage that spares leaves the others their share, and nothing is limited without one", {
  context <- amiss:::new_context(1, 1, list(), budget = 200)
  expect_equal(amiss:::runs_left(amiss:::sparing(context, 0.5)), 100)
  expect_equal(amiss:::runs_left(amiss:::sparing(amiss:::sparing(context, 0.5), 0.6)), 60)
  expect_equal(amiss:::runs_left(amiss:::sparing(amiss:::new_context(1, 1, list()), 0.5)), Inf)
})

bench <- test_path("..", "..", "bench", "hidden_effects")

test_that("with 200 runs causes of several times the noise are still adopted", {
  skip_on_cran()
  if (!dir.exists(bench)) skip("bench/ is not part of the installed package")
  scope <- new.env(parent = globalenv())
  for (part in c("worlds", "least_squares", "network", "runoff", "wrong", "families"))
    sys.source(file.path(bench, paste0(part, ".R")), scope)
  right <- vapply(world_seed(c(80102, 80103, 80106)), function(seed) {
    world <- scope$family_world("network", seed)
    upgrade <- suppressWarnings(upgrade_model(
      world$base, world$measurements, world$catalogue, seed = seed + 77, quiet = TRUE,
      control = list(max_steps = 1, runs_total = 200)))
    # What judges a mechanism that was adopted takes up to four runs more.
    expect_lte(upgrade$runs_total, 204)
    identical(upgrade$models[[length(upgrade$models)]]$mechanism, world$kinds[[1]])
  }, NA)
  # bench/budget.R says how often that is so. Of these three all were right, and one before stages
  # shared a budget.
  expect_gte(sum(right), 2)
})
