test_that("an error that stays the same is not called lower", {
  upgrade <- small_upgrade()
  title <- function(before, after) {
    upgrade$models[[1]]$scores$validate[["rmse"]] <- before
    upgrade$models[[2]]$scores$validate[["rmse"]] <- after
    amiss:::figure_steps(upgrade)$labels$title
  }
  expect_match(title(0.2, 0.1), "lowers the error: the typical error (held out) falls from 0.20 to",
               fixed = TRUE)
  expect_match(title(0.08831, 0.08824), "No step lowers the typical error (held out)", fixed = TRUE)
  expect_match(title(0.1, 0.2), "No step lowers the typical error (held out)", fixed = TRUE)
})
