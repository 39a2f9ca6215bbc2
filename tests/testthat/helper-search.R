# Models of the loop, for tests of its searches.

search_context <- function(budget = NULL, threads = 1, control = list()) {
  amiss:::new_context(1, threads, control, budget = budget)
}

searched_model <- function(simulator, m) {
  amiss:::new_model(list(simulator), list(amiss:::loop_record(m, quick_ais)))
}

# A model with runs at these coordinates (one a row).
run_model <- function(simulator, m, z, context = search_context()) {
  amiss:::with_runs(searched_model(simulator, m), z, context)$model
}

runs_of <- function(model) ncol(model$runs$outputs)

measured_run <- function(simulator, values) {
  data <- linear_data()
  noise <- withr::with_seed(8, rnorm(nrow(data), 0, 0.1))
  data$Ti <- simulator$f(values, as.matrix(data["Te"])) + noise
  linear_measurements(data)
}

# The output knows the square of a parameter alone: a = 0.6 and a = -0.6 are both modes.
squared_simulator <- function() {
  function_simulator(function(values, drivers) 20 + values[["a"]]^2 * drivers[, "Te"],
                     free("a", uniform(-1, 1)), boundary = "Te")
}

# Outflow of a store for an inflow that is constant over an hour.
routed <- function(inflow, time) {
  kept <- if (time > 0) exp(-1 / time) else 0
  as.numeric(stats::filter((1 - kept) * inflow, kept, "recursive"))
}

# Two stores in a row: output does not know which of them is the quick one.
stores_simulator <- function(first = free("first", uniform(0.5, 12), "h"),
                             second = free("second", uniform(0.5, 12), "h")) {
  function_simulator(function(values, drivers) {
    20 + 8 * routed(routed(drivers[, "Te"], values[["first"]]), values[["second"]])
  }, first, second, boundary = "Te")
}

space_of <- function(...)
  amiss:::coordinates_of(lapply(list(...), function(prior) free("k", prior)))

# The model as if one of its runs had failed.
failing <- function(model, k) {
  model$runs$outputs[[k]][] <- NaN
  model$runs$squares[k] <- NaN
  model
}
