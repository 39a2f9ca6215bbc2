# Worlds with a hidden effect: the test box M2 with one mechanism of the catalogue added, simulated on a finer grid
# than the model that is fitted, so that nothing is recovered by sharing an error. The seed is drawn here, or given by
# the environment, and is never the seed of the fit.
world_seed <- function(default) {
  given <- Sys.getenv("AMISS_WORLD_SEED")
  if (nzchar(given)) as.numeric(given) + default else default
}

box_columns <- c("Te", "Gv", "Ws", "Wd", "RHP", "Lw")

box_world <- function(effect = NULL, strength = numeric(), seed, noise = 0.1, days = 8) {
  data <- synthetic_weather(days, seed = seed)
  data$RHP <- rolbs(nrow(data), power = 100, seed = seed)
  truth <- paper_box("M2")
  if (!is.null(effect)) truth <- box_catalogue(box_columns)[[effect]]$edit(truth)
  parameters <- zone_parameters(truth)
  set.seed(seed)
  values <- vapply(parameters, function(p) p$prior$lower + stats::runif(1, 0.3, 0.7) * (p$prior$upper - p$prior$lower), 0)
  values[names(strength)] <- strength
  drivers <- as.matrix(data[setdiff(names(data), "hour")])
  clean <- simulate_zone(truth, t(values), drivers, step_s = 900, control = list(max_substep_s = 150, cells = 2))[, 1]
  data$Ti <- clean + stats::rnorm(nrow(data), 0, noise)
  list(values = values, measurements = measurements(
    data, time = "hour", target = "Ti", boundary = ~ Te + Gv + Ws + circular(Wd) + RHP, noise_sd = noise, warmup = 24,
    calibrate = data$hour <= 120, validate = data$hour > 120, name = effect %||% "no effect", unit = "K"))
}

upgrade_world <- function(world, seed = 20240521) {
  upgrade_model(paper_box("M2"), world$measurements, box_catalogue(box_columns), seed = seed, threads = 2, quiet = TRUE,
                control = list(max_steps = 1, attribution = list(surrogates = 99)))
}

# A quick linear world for the tests of single stages.
linear_simulator <- function() {
  function_simulator(function(values, drivers) {
    values[["offset"]] + values[["gain"]] * drivers[, "Te"]
  }, free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), boundary = "Te", name = "linear")
}

linear_data <- function(n = 240, noise = 0.1, seed = 11) {
  set.seed(seed)
  hour <- seq_len(n)
  data <- data.frame(hour = hour, Te = 10 + 5 * sin(2 * pi * hour / 24) + as.numeric(stats::filter(stats::rnorm(n), 0.9, "recursive")),
                     Gv = pmax(0, 300 * sin(2 * pi * (hour - 6) / 24)) * stats::runif(n, 0.3, 1))
  data$Ti <- 20 + 0.4 * data$Te + stats::rnorm(n, 0, noise)
  data
}

linear_measurements <- function(data = linear_data(), ...) {
  defaults <- list(data = data, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1, unit = "K")
  do.call("measurements", utils::modifyList(defaults, list(...)))
}

quick_ais <- list(ais = list(pilot_chains = 48, groups = 4, chains = 24, sweeps = 3))

linear_fit <- function(measurements = linear_measurements(), seed = 3, threads = 1, runs = 30) {
  emulator <- train_emulator(simulate_design(linear_simulator(), measurements, runs = runs, seed = seed), measurements)
  calibrate(emulator, measurements, quick_ais, seed = seed, threads = threads)
}

# The same simulation space with its basis in another unit.
rescaled <- function(emulator, factor) {
  emulator$basis$vectors <- emulator$basis$vectors * factor
  emulator$processes$coefficients <- emulator$processes$coefficients / factor
  emulator
}

twinhouse_study <- function(house) system.file("studies", sprintf("twinhouse_%s.yml", house), package = "amiss")

# What print() says, in one line.
printed <- function(x) gsub("\\s+", " ", paste(cli::cli_fmt(print(x)), collapse = " "))
