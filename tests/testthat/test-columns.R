test_that("columns are read as a matrix is", {
  x <- matrix(c(1:5, NaN), 3)
  columns <- amiss:::new_columns(x)
  expect_equal(dim(columns), c(3, 2))
  for (drop in c(TRUE, FALSE)) {
    expect_identical(columns[, 2, drop = drop], x[, 2, drop = drop])
    expect_identical(columns[2:3, , drop = drop], x[2:3, , drop = drop])
    expect_identical(columns[c(TRUE, FALSE, TRUE), c(2, 2, 1), drop = drop],
                     x[c(TRUE, FALSE, TRUE), c(2, 2, 1), drop = drop])
    expect_identical(columns[2:3, integer(), drop = drop], x[2:3, integer(), drop = drop])
  }
  none <- amiss:::new_columns(x[, 0])
  expect_equal(dim(none), c(3, 0))
  both <- amiss:::bind_columns(none, amiss:::bind_columns(columns, columns))
  expect_identical(both[, 1:4], cbind(x, x))
})
