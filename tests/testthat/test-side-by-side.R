# Trials in workers of package future: the same results, runs and messages as one after the other.

with_workers <- function(plan, code) {
  before <- if (plan == "sequential") future::plan(future::sequential)
            else future::plan(plan, workers = 2)
  withr::defer(future::plan(before))
  code
}

# Sessions are long to start.
plans <- c("sequential", if (.Platform$OS.type == "unix") "multicore",
           if (identical(Sys.getenv("NOT_CRAN"), "true")) "multisession")

test_that("values come in order, and runs are counted, wherever work is done", {
  work <- function(item, context) {
    count_runs(item)
    count_found(1)
    c(item^2, runs_spent(context), runs_found(context))
  }
  for (plan in plans) with_workers(plan, {
    context <- new_context(1, 1, list())
    count_runs(3)
    heard <- NULL
    values <- side_by_side(c(2, 5, 4), work, function(value) heard <<- c(heard, value[1]), context,
                           NULL)
    expect_equal(values, list(c(4, 5, 1), c(25, 8, 1), c(16, 7, 1)), info = plan)
    expect_equal(heard, c(4, 25, 16), info = plan)
    expect_equal(c(runs_spent(context), runs_found(context)), c(14, 3), info = plan)
  })
})

# A house of which code and numbers stand in the global environment, as in a script.
house_in_script <- function() {
  d <- linear_data(120)
  d$Ti <- d$Ti + 0.02 * d$Gv
  assign("amiss_test_offset", 20, globalenv())
  script <- quote({
    amiss_test_base <- function(values, drivers) {
      amiss_test_offset + values[["gain"]] * drivers[, "Te"]
    }
    amiss_test_more <- function(column) {
      function(values, drivers, base) base(values) + values[["more"]] * drivers[, column]
    }
    amiss_test_edit <- function(column) {
      force(column)
      function(model) {
        with_parameters(model, free("more", uniform(-0.1, 0.1)), boundary = column,
                        f = amiss_test_more(column))
      }
    }
  })
  eval(script, globalenv())
  made <- function(name) get(name, globalenv())
  list(model = function_simulator(made("amiss_test_base"), free("gain", uniform(0, 1)),
                                  boundary = "Te"),
       measurements = linear_measurements(d),
       catalogue = catalogue(
         mechanism("sun", made("amiss_test_edit")("Gv"), "Gv", "Sun."),
         mechanism("more of it", made("amiss_test_edit")("Te"), "Te", "More."),
         mechanism("square", function(model) {
           with_parameters(model, free("square", uniform(0, 0.1)), boundary = "Te",
                           f = function(values, drivers, base) {
                             base(values) + values[["square"]] * drivers[, "Te"]^2
                           })
         }, "Te", "Square.")))
}

test_that("the loop gives the same with workers as without, also of code in a script", {
  withr::defer(rm(list = ls(globalenv(), pattern = "^amiss_test_"), envir = globalenv()))
  house <- house_in_script()
  quick <- list(calibration = list(ais = list(pilot_chains = 48, groups = 4)),
                attribution = list(surrogates = 19), max_steps = 1)
  loop <- function() suppressWarnings(upgrade_model(house$model, house$measurements,
                                                    house$catalogue, control = quick, seed = 1,
                                                    quiet = TRUE))
  found <- lapply(plans, function(plan) with_workers(plan, loop()))
  expect_equal(last_model(found[[1]]$models)$mechanism, "sun")
  for (other in found[-1]) {
    expect_identical(other$candidates, found[[1]]$candidates)
    expect_identical(other$runs_total, found[[1]]$runs_total)
    expect_identical(other$gain, found[[1]]$gain)
  }
})

test_that("what holds a pointer stays in its process", {
  pointer <- methods::new("externalptr")
  holds <- function_simulator(function(values, drivers) {
    stopifnot(typeof(pointer) == "externalptr")
    drivers[, "Te"]
  }, free("gain", uniform(0, 1)), boundary = "Te")
  expect_true(needed_in_workers(list(holds))$pointers)
  expect_false(needed_in_workers(list(linear_simulator()))$pointers)
  skip_on_os("windows")
  here <- Sys.getpid()
  process <- function(item, context) Sys.getpid()
  with_workers("multicore", {
    context <- new_context(1, 1, list())
    told <- function(value) NULL
    expect_false(here %in% unlist(side_by_side(1:2, process, told, context, linear_simulator())))
    expect_equal(unlist(side_by_side(1:2, process, told, context, holds)), c(here, here))
  })
})
