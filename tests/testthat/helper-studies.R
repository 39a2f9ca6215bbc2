# Study files of quick worlds, with their data and their code beside them.

write_study_file <- function(folder, ..., drop = character()) {
  fields <- list(study = "linear", data = "data.csv", time = "hour", target = "Ti",
                 boundary = list("Te", "Gv"), noise_sd = 0.1, unit = "K", calibrate = "hour <= 180",
                 validate = "hour > 180", model = "model.R", catalogue = "catalogue.R", runs = 30,
                 seed = 4, control = list(max_steps = 1, calibration = quick_ais,
                                          attribution = list(surrogates = 19)))
  edits <- list(...)
  fields[names(edits)] <- edits
  data <- linear_data()
  data$Ti <- data$Ti + 0.002 * data$Gv
  utils::write.csv(data, file.path(folder, "data.csv"), row.names = FALSE)
  writeLines('function_simulator(
    function(values, drivers) values[["offset"]] + values[["gain"]] * drivers[, "Te"],
    free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)), boundary = "Te",
    name = "linear")',
             file.path(folder, "model.R"))
  writeLines('catalogue(mechanism("sun", boundary = "Gv", sentence = "The sun shines in.",
    edit = function(model) function_simulator(function(values, drivers) {
      values[["offset"]] + values[["gain"]] * drivers[, "Te"] + values[["sun"]] * drivers[, "Gv"]
    }, free("offset", uniform(10, 30), "K"), free("gain", uniform(0, 1)),
      free("sun", uniform(0, 0.01), "K/(W/m2)"),
      boundary = c("Te", "Gv"))))',
             file.path(folder, "catalogue.R"))
  path <- file.path(folder, "study.yml")
  yaml::write_yaml(fields[setdiff(names(fields), drop)], path)
  path
}

write_comparison_study <- function(folder, ...) {
  writeLines('offset <- free("offset", uniform(10, 30), "K")
    list(level = function_simulator(function(values, drivers) {
           values[["offset"]] + 0 * drivers[, "Te"] + 0.4 * values[["a"]] * drivers[, "Gv"]
         }, offset, free("a", uniform(0, 0.01)), boundary = c("Te", "Gv")),
         line = function_simulator(function(values, drivers) {
           values[["offset"]] + values[["gain"]] * drivers[, "Te"]
         }, offset, free("gain", uniform(0, 1)), boundary = "Te"))',
             file.path(folder, "models.R"))
  writeLines('source("values.R", local = TRUE)$value', file.path(folder, "made.R"))
  writeLines(
    paste("data.frame(hour = 1:80, Te = 10 + 5 * sin(1:80 / 4), Gv = pmax(0, 300 * sin(1:80 / 5)),",
          "Ti = 24 + 2 * sin(1:80 / 4) + with_seed(3, rnorm(80, 0, 0.1)))"),
    file.path(folder, "values.R"))
  write_study_file(
    folder, data = "made.R", models = "models.R", calibrate = "hour <= 60", validate = "hour > 60",
    runs = 12,
    control = list(calibration = list(ais = list(pilot_chains = 24, groups = 4, chains = 12,
                                                 importance_draws = 200))),
    ..., drop = c("model", "catalogue"))
}

# expect_match() would escape a page of megabytes to quote it, which takes a minute.
expect_on_page <- function(page, told) expect_true(grepl(told, page, fixed = TRUE), info = told)
