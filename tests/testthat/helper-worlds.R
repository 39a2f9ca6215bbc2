# Seeds of worlds with a hidden effect; the environment may move them.
world_seed <- function(default) {
  given <- Sys.getenv("AMISS_WORLD_SEED")
  if (nzchar(given)) as.numeric(given) + default else default
}

# A quick linear world for the tests of single stages.
linear_simulator <- function() {
  function_simulator(function(values, drivers) {
    values[["offset"]] + values[["gain"]] * drivers[, "Te"]
  }, free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), boundary = "Te",
     name = "linear")
}

linear_data <- function(n = 240, noise = 0.1, seed = 11) {
  set.seed(seed)
  hour <- seq_len(n)
  data <- data.frame(hour = hour, Te = 10 + 5 * sin(2 * pi * hour / 24) +
                     as.numeric(stats::filter(stats::rnorm(n), 0.9, "recursive")),
                     Gv = pmax(0, 300 * sin(2 * pi * (hour - 6) / 24)) * stats::runif(n, 0.3, 1))
  data$Ti <- 20 + 0.4 * data$Te + stats::rnorm(n, 0, noise)
  data
}

linear_measurements <- function(data = linear_data(), ...) {
  defaults <- list(data = data, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
                   unit = "K")
  do.call("measurements", utils::modifyList(defaults, list(...)))
}

# `make`, whose results are kept: the same arguments are worked on once. What is to be made twice,
# to see whether it comes out the same, calls `make` itself.
made_once <- function(make) {
  made <- new.env()
  function(...) {
    key <- rlang::hash(list(...))
    if (is.null(made[[key]])) made[[key]] <- make(...)
    made[[key]]
  }
}

# Functions that stand in for the package's own of the same names until a test ends.
stand_in <- function(..., frame = parent.frame()) {
  set <- function(functions)
    for (name in names(functions)) utils::assignInNamespace(name, functions[[name]], "amiss")
  given <- list(...)
  own <- mget(names(given), asNamespace("amiss"))
  withr::defer(set(own), envir = frame)
  set(given)
}

quick_ais <- list(ais = list(pilot_chains = 48, groups = 4, chains = 24, sweeps = 3))

linear_fit <- function(measurements = linear_measurements(), seed = 3, threads = 1, runs = 30) {
  emulator <- train_emulator(
    simulate_design(linear_simulator(), measurements, runs = runs, seed = seed), measurements)
  calibrate(emulator, measurements, quick_ais, seed = seed, threads = threads)
}

plain_linear_fit <- made_once(function() linear_fit())

# The same simulation space with its basis in another unit.
rescaled <- function(emulator, factor) {
  emulator$basis$vectors <- emulator$basis$vectors * factor
  emulator$processes$coefficients <- emulator$processes$coefficients / factor
  emulator$spread <- emulator$spread / factor
  emulator
}

twinhouse_study <- function(house)
  system.file("studies", sprintf("twinhouse_%s.yml", house), package = "amiss")

# What print() says, in one line.
printed <- function(x) gsub("\\s+", " ", paste(utils::capture.output(print(x)), collapse = " "))

# A world that bends: lag and strength depend on one parameter, the sun on another. Three vectors
# leave out a sixth of the noise.
bent_simulator <- function(f = bent_run) {
  function_simulator(f, free("a", uniform(0, 1)), free("b", uniform(0, 2)),
                     boundary = c("Te", "Gv"), name = "bent")
}

bent_run <- function(values, drivers) {
  air <- exp(2 * values[["a"]]) * 0.05 * lagged(drivers[, "Te"], 4 + values[["a"]])
  20 + air + values[["b"]] * drivers[, "Gv"] / 300
}

bent_measurements <- function(n = 120, noise = 0.05) {
  data <- linear_data(n)
  error <- withr::with_seed(1, stats::rnorm(n, 0, noise))
  data$Ti <- bent_run(c(a = 0.6, b = 0.8), as.matrix(data[c("Te", "Gv")])) + error
  linear_measurements(data, noise_sd = noise)
}
