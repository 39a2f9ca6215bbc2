# Boundary conditions: how they are given, and what they are called.

plain_record <- function() linear_data(60)

record_of <- function(boundary)
  measurements(plain_record(), time = "hour", target = "Ti", boundary = boundary, noise_sd = 0.1)

labels <- list(Te = condition("outdoor air", "degC"), Gv = condition("sun on the wall", "W/m2"))

test_that("labels and units change nothing but what people read", {
  plain <- record_of(~ Te + Gv)
  labelled <- record_of(labels)
  expect_equal(labelled$labels, c(Te = "outdoor air", Gv = "sun on the wall"))
  expect_equal(labelled$units, c(Te = "degC", Gv = "W/m2"))
  expect_length(plain$labels, 0)
  rest <- function(m) m[setdiff(names(m), c("labels", "units"))]
  expect_identical(rest(labelled), rest(plain))
  expect_match(printed(labelled), "conditions outdoor air \\[\u00b0C\\] and sun on the wall \\[W/m")
  expect_setequal(levels(plot(labelled)$data$panel),
                  c("Ti", "outdoor air [\u00b0C]", "sun on the wall [W/m\u00b2]"))
})

test_that("names and conditions stand beside each other, directions by either", {
  m <- record_of(list("Te", Gv = condition("sun")))
  expect_identical(m$conditions, c("Te", "Gv"))
  expect_equal(m$labels, c(Gv = "sun"))
  table <- cbind(plain_record(), Wd = (1:60 * 37) %% 360)
  of <- function(boundary)
    measurements(table, time = "hour", target = "Ti", boundary = boundary, noise_sd = 0.1)
  turning <- of(list("Te", Wd = condition("wind direction", "deg", circular = TRUE)))
  expect_identical(turning$boundary, of(~ Te + circular(Wd))$boundary)
})

test_that("what is no list of conditions is refused", {
  refused <- function(boundary, pattern)
    expect_error(record_of(boundary), pattern, class = "amiss_error_input")
  refused(list(Te = "outdoor air"), "conditions under the names of their columns")
  refused(list(condition("outdoor air")), "conditions under the names of their columns")
  refused(list(), "conditions under the names of their columns")
  refused(list(Te = condition("sun"), Gv = condition("sun")), "label \"sun\"")
  refused(list(Te = condition("air"), "Te"), "name \"Te\"")
  refused(list(Tx = condition("air")), "Tx")
})

# The small upgrade as its record would be with these labels.
told_upgrade <- made_once(function() {
  upgrade <- small_upgrade()
  told <- function(m) utils::modifyList(m, record_of(labels)[c("labels", "units")])
  upgrade$measurements <- told(upgrade$measurements)
  for (k in seq_along(upgrade$models)) {
    upgrade$models[[k]]$fit$measurements <- told(upgrade$models[[k]]$fit$measurements)
    upgrade$models[[k]]$attribution$labels <- upgrade$measurements$labels
  }
  upgrade
})

test_that("people read labels in print, summary, figures; programs read the names of columns", {
  upgrade <- told_upgrade()
  expect_match(printed(upgrade), "named: sun \\(sun on the wall\\)")
  words <- paste(unlist(summary(upgrade)[c("change", "remains", "inspect", "headline")]),
                 collapse = " ")
  expect_match(words, "driven by sun on the wall")
  expect_no_match(words, "\\bGv\\b|\\bTe\\b")
  expect_match(printed(upgrade$models[[1]]$attribution), "sun on the wall")
  expect_match(amiss:::upgrade_figure(upgrade, "response")$labels$x, "sun on the wall [W/m",
               fixed = TRUE)
  drawn <- levels(amiss:::upgrade_figure(upgrade, "attribution")$data$boundary)
  expect_setequal(drawn, c("outdoor air", "sun on the wall"))
  expect_setequal(tidy(upgrade$models[[1]]$attribution)$boundary, c("Te", "Gv"))
  result <- amiss:::result_list(upgrade)
  expect_identical(unlist(result$named_cause$boundary), "Gv")
  # What else asks for columns by their names still finds them.
  driven <- amiss:::uncovered_conditions(amiss:::labelled(upgrade)$measurements,
                                         upgrade$models[[1]]$fit)
  plain <- amiss:::uncovered_conditions(upgrade$measurements, upgrade$models[[1]]$fit)
  expect_identical(driven, plain)
  faulty <- upgrade
  faulty$measurements$findings <- data.frame(id = "stuck", column = "Te", says = "It is stuck.")
  expect_identical(unname(summary(faulty)$record), "It is stuck.")
  # Twice is as once.
  expect_equal(amiss:::labelled(amiss:::labelled(upgrade)), amiss:::labelled(upgrade))
})

test_that("a study file gives labels as a list or as a mapping, and says what is wrong", {
  both <- list(list(list(Te = list(label = "outdoor air", unit = "degC")), "Gv"),
               list(Te = list(label = "outdoor air", unit = "degC"), Gv = list(label = "sun")))
  read <- lapply(both, function(b) amiss:::boundary_terms(amiss:::study_boundary(b)))
  expect_equal(read[[1]]$label, c("outdoor air", "Gv"))
  expect_equal(read[[2]]$label, c("outdoor air", "sun"))
  expect_equal(read[[1]]$unit, c("degC", ""))
  expect_identical(amiss:::study_boundary(list("Te", "circular(Wd)")), c("Te", "circular(Wd)"))
  expect_identical(amiss:::study_boundary("Te"), "Te")
  wrong <- function(b) expect_error(amiss:::study_boundary(b), "label", class = "amiss_error_input")
  wrong(list(Te = list(unit = "degC")))
  wrong(list(Te = list(label = "air", units = "degC")))
  wrong(list(list(Te = "outdoor air")))
})
