test_that("mechanisms and catalogues are checked", {
  expect_error(catalogue("sun"), "must be a mechanism", class = "amiss_error_input")
  m <- mechanism("a", function(model) model, "Te", "A.")
  expect_error(catalogue(m, m), "twice", class = "amiss_error_input")
  expect_error(mechanism("a", 3, "Te", "A."), "edit", class = "amiss_error_input")
  broken <- mechanism("b", function(model) stop("no such wall"), "Te", "B.")
  expect_error(amiss:::extend(linear_simulator(), broken), "cannot be applied.*no such wall", class = "amiss_error_input")
  other <- mechanism("c", function(model) 3, "Te", "C.")
  expect_error(amiss:::extend(linear_simulator(), other), "not a simulator", class = "amiss_error_input")
})

test_that("every mechanism of the shipped catalogues applies to its model", {
  study <- read_study(twinhouse_study("O5"))
  expect_gte(length(study$catalogue), 8)
  for (entry in study$catalogue) {
    extended <- amiss:::extend(study$model, entry)
    expect_gt(length(free_parameters(extended)), length(free_parameters(study$model)))
    expect_true(all(driver_names(extended) %in% colnames(study$measurements$raw$drivers)))
  }
  for (entry in box_catalogue()) {
    expect_gt(length(free_parameters(amiss:::extend(paper_box("M2"), entry))), length(free_parameters(paper_box("M2"))))
  }
})

test_that("braces in another's message are left as they are", {
  broken <- mechanism("b", function(model) stop("no {way} }"), "Te", "B.")
  expect_error(amiss:::extend(linear_simulator(), broken), "no {way} }", fixed = TRUE, class = "amiss_error_input")
})
