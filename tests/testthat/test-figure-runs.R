test_that("the runs of a study are those of its models and trials", {
  upgrade <- small_upgrade()
  table <- amiss:::runs_table(upgrade)
  expect_equal(sum(table$runs), upgrade$runs_total)
  expect_equal(sort(table$runs[table$to == "added to the base model"]),
               sort(upgrade$candidates$runs[upgrade$candidates$from == upgrade$models[[1]]$name]))
  title <- ggplot2::autoplot(upgrade, "runs")$labels$title
  expect_match(title, sprintf("^%d runs of the simulator, [0-9]+ in [0-9]+ trials? of",
                              upgrade$runs_total))
})

test_that("a study without trials or runs has its figure", {
  upgrade <- small_upgrade()
  upgrade$candidates <- upgrade$candidates[0, ]
  upgrade$models <- upgrade$models[1]
  upgrade$runs_total <- upgrade$models[[1]]$fit$runs_made
  expect_match(amiss:::figure_runs(upgrade)$labels$title, "all for the base model")
  upgrade$runs_total <- 0
  expect_match(amiss:::figure_runs(upgrade)$labels$title, "No run of the simulator was made")
})
