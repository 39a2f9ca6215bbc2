# A small upgrade, made once for a session: the target follows a lagged Te and, unknown to the base
# model, the sun.

upgrade_cache <- new.env()

lagged <- function(x, hours) {
  kept <- exp(-1 / hours)
  as.numeric(stats::filter(x * (1 - kept), kept, method = "recursive", init = x[1]))
}

small_record <- function(n = 240) {
  withr::with_seed(1, {
    hour <- seq_len(n)
    table <- data.frame(time = as.POSIXct("2024-03-01", tz = "UTC") + 3600 * hour,
                        Te = 5 + 4 * sin(2 * pi * (hour - 9) / 24) +
                          as.numeric(stats::filter(rnorm(n, 0, 0.5), 0.95, method = "recursive")),
                        Gv = pmax(0, sin(2 * pi * (hour - 6) / 24)) *
                          rep(runif(ceiling(n / 24), 0.1, 1), each = 24)[seq_len(n)] * 500)
    table$Ti <- 15 + 0.8 * lagged(table$Te, 6) + 0.006 * lagged(table$Gv, 3) + rnorm(n, 0, 0.05)
    table
  })
}

small_upgrade <- function() {
  if (is.null(upgrade_cache$upgrade)) {
    m <- measurements(small_record(), time = "time", target = "Ti", boundary = ~ Te + Gv,
                      noise_sd = 0.05, unit = "K", name = "small room",
                      calibrate = seq_len(240) <= 168, validate = seq_len(240) > 168, warmup = 12)
    base <- function_simulator(function(values, drivers) values[["offset"]] +
                               values[["gain"]] * lagged(drivers[, "Te"], 6),
                               free("offset", uniform(10, 20), "K", "offset"),
                               free("gain", uniform(0, 2), "", "gain"),
                               boundary = "Te")
    sun <- mechanism("sun", boundary = "Gv",
                     sentence = "Sun enters through a window <that> the model *leaves* out.",
                     edit = function(model) {
      with_parameters(model, free("sun_gain", uniform(0, 0.02), "Km2/W", "gain of the sun"),
                      boundary = "Gv", f = function(values, drivers, base) {
        base(values) + values[["sun_gain"]] * lagged(drivers[, "Gv"], 3)
      })
    })
    nothing <- mechanism("drift", boundary = "Te", sentence = "The target drifts.",
                         edit = function(model) {
      with_parameters(model, free("drift", uniform(-1, 1), "K", "drift"), boundary = "Te",
                      f = function(values, drivers, base) {
        base(values) + values[["drift"]] * seq_len(nrow(drivers)) / 100
      })
    })
    coarse <- list(pilot_chains = 24, groups = 4, importance_draws = 200)
    control <- list(max_steps = 1, calibration = list(ais = c(coarse, chains = 8)),
                    # With 24 chains a loss is off by six decades for a quarter of the seeds.
                    attribution = list(surrogates = 39,
                                       ais = utils::modifyList(coarse, list(pilot_chains = 128))))
    upgrade_cache$upgrade <- upgrade_model(base, m, catalogue(sun, nothing), runs = 30, seed = 1,
                                           quiet = TRUE, control = control)
  }
  upgrade_cache$upgrade
}

# The upgrade with its mechanisms judged anew, after a change by hand.
rejudged <- function(upgrade) {
  upgrade$models <- judge_models(upgrade$models, upgrade$candidates, upgrade$catalogue,
                                 upgrade$measurements, upgrade$control, threads = 1)
  upgrade
}

# The same upgrade as if nothing had been adopted, and as if nothing had been held out.
base_only <- function(upgrade) {
  upgrade$models <- upgrade$models[1]
  upgrade$candidates <- upgrade$candidates[upgrade$candidates$from == upgrade$models[[1]]$name, ]
  upgrade["named_cause"] <- list(NULL)
  upgrade
}

without_held_out <- function(upgrade) {
  upgrade$models <- lapply(upgrade$models, function(m) {
    m$prediction <- m$prediction[m$prediction$use == "calibrate", ]
    m$scores$validate[] <- NA
    m
  })
  upgrade
}

# In the order of x, from 0 to 1, most of them near 0: how draws lie that a prior's end cuts off.
pile_up <- function(x) (rank(x, ties.method = "first") / length(x))^4
