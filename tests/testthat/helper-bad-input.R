# What every exported function must refuse. A row is list(f, arg, value, class, pattern): `f` called
# as in valid_calls(), but with `value` for `arg`, must stop with a condition of `class` whose
# message matches `pattern`.

bad_input <- new.env()

# Small objects of every stage, made once.
bad_input_objects <- function() {
  if (!is.null(bad_input$objects)) return(bad_input$objects)
  quietly <- function(x) suppressWarnings(suppressMessages(x))
  ais <- list(pilot_chains = 8, groups = 2, max_groups = 2, chains = 4, sweeps = 1, max_sweeps = 1,
              importance_draws = 50)
  o <- list(record = linear_data(60), simulator = linear_simulator(), ais = ais)
  o$calibration <- list(ais = ais, error_ratios = c(0, 1), error_times = 2, reach = Inf,
                        error_draws = 4, check = 4, exact = 0)
  o$measurements <- linear_measurements(o$record, calibrate = 1:60 <= 45, validate = 1:60 > 45)
  o$ensemble <- quietly(simulate_design(o$simulator, o$measurements, runs = 10, seed = 1))
  o$emulator <- quietly(train_emulator(o$ensemble, o$measurements))
  o$fit <- quietly(calibrate(o$emulator, o$measurements, o$calibration, seed = 1))
  o$paper <- quietly(calibrate_paper(o$emulator, o$measurements, list(ais = ais), seed = 1))
  o$gain <- free("gain", uniform(0, 1))
  o$function_simulator <- function_simulator(
    function(values, drivers) values[["gain"]] * drivers[, "Te"], o$gain, boundary = "Te")
  o$program <- program_simulator(c("awk", "{{gain}}"), o$gain,
                                 output = c(file = "stdout.txt", column = "Ti"), cache = tempfile())
  o$fmu_file <- write_zip(tempfile(fileext = ".fmu"), list(
    modelDescription.xml = as_bytes(readLines(file.path(fmu_sources, "house2.xml")))))
  o$fmu <- fmu_simulator(o$fmu_file, free("R_out", uniform(0.005, 0.02)), output = "T_air")
  o$room <- zone(zone_wall("wall", 1, zone_layer(0.1, 1, 1e6), outside = "Te"),
                 zone_heater("heater", "P"),
                 zone_infiltration("leak", free("ach", uniform(0, 1)), "Te"), volume = 10)
  o$network <- network(network_node("air", 1), network_link("air", "Te", free("H", uniform(0, 1))),
                       network_gain("air", "P"), output = "air")
  o$drivers <- cbind(Te = rep(5, 10), P = rep(100, 10))
  o$catalogue <- catalogue(mechanism("sun", identity, "Gv", "The sun shines in."))
  o$upgrade <- quietly(
    upgrade_model(o$simulator, o$measurements, o$catalogue, runs = 10, seed = 1, quiet = TRUE,
                  control = list(calibration = o$calibration, rounds = 1, max_steps = 1)))
  o$folder <- tempfile("bad-input-")
  dir.create(o$folder)
  o$epw <- file.path(o$folder, "weather.epw")
  writeLines(c("LOCATION,A,-,DEU,None,0,48,11,1,0", rep("-", 6), "DATA PERIODS,1,1",
               "2001,1,1,1,60,?9,5"), o$epw)
  bad_input$objects <- o
}

# One call of every exported function with all its arguments, as good ones; `list()` stands for what
# is never used.
valid_calls <- function() {
  o <- bad_input_objects()
  opening <- list(outside = "Te", height = 0, azimuth = 0, wind_speed = NULL, wind_direction = NULL,
                  exposure = "exposed", shelter = 1)
  upgrade <- list(measurements = o$measurements, runs = 10, control = list(), seed = 1, threads = 1,
                  quiet = TRUE, checkpoint = NULL)
  list(
    add_component = list(model = o$room, zone_gain("gain", "P")),
    ais = list(log_likelihood = function(z) -z[, 1]^2, priors = list(a = uniform(0, 1)),
               control = o$ais, seed = 1, gradient = NULL),
    amiss = list(data = o$measurements, design = o$ensemble$values, runs = o$ensemble$outputs,
                 parameters = NULL, noise_sd = NULL, control = list(), seed = 1, threads = 1),
    attribute_discrepancy = list(fit = o$fit, control = list(), seed = 1, threads = 1),
    augment = list(x = o$fit, data = NULL, newdata = NULL),
    autoplot = list(object = o$upgrade, which = "fit"),
    bayes_factor = list(model = o$fit, reference = o$fit),
    beta_prior = list(shape1 = 1, shape2 = 1, lower = 0, upper = 1),
    condition = list(label = "outdoor air", unit = "degC", circular = FALSE),
    bootstrap_noise = list(replicates = 50, detrend = FALSE, seed = 1),
    box_catalogue = list(columns = "Te", azimuth = 180),
    calibrate = list(emulator = o$emulator, measurements = o$measurements, control = o$calibration,
                     seed = 1, threads = 1),
    calibrate_jointly = list(ensembles = list(a = o$ensemble, b = o$ensemble),
                             measurements = list(a = o$measurements, b = o$measurements),
                             rounds = 0, runs = 10, control = list(), seed = 1, threads = 1,
                             quiet = TRUE),
    calibrate_paper = list(emulator = o$emulator, measurements = o$measurements, control = list(),
                           seed = 1, threads = 1),
    calibrate_refined = list(ensemble = o$ensemble, measurements = o$measurements, rounds = 0,
                             runs = 10, control = list(), seed = 1, threads = 1, quiet = TRUE),
    catalogue = o$catalogue[1],
    change_component = list(model = o$room, name = "heater", capacity = 3),
    compare_models = c(list(models = list(a = o$simulator), method = "history", truth = NULL),
                       upgrade),
    component = list(model = o$room, name = "heater"),
    discrepancy = list(fit = o$fit),
    driver_names = list(simulator = o$simulator),
    drop_component = list(model = o$room, name = "leak"),
    ensemble = list(design = o$ensemble$values, outputs = o$ensemble$outputs,
                    parameters = unname(o$ensemble$parameters),
                    measurements = o$measurements, validation = NULL, time = NULL),
    epw_columns = list(),
    epw_weather = list(template = o$epw, columns = c(dry_bulb = "Te"), file = "w.epw",
                       instant = character(), utc_offset = NULL),
    fmu_simulator = list(file = o$fmu_file, free("R_out", uniform(0.005, 0.02)), output = "T_air",
                         inputs = "Te", fixed = list(), averaged = TRUE, steps_per_row = 1,
                         start = 0, tolerance = NULL, time_limit = 1, size_limit = 10, retries = 0,
                         cache = NULL, logging = FALSE, name = "house"),
    fmu_variables = list(file = o$fmu_file),
    free = list(name = "a", prior = uniform(0, 1), unit = "K", label = "A"),
    free_parameters = list(simulator = o$simulator),
    function_simulator = list(f = o$function_simulator$f, o$gain, boundary = "Te", name = "a"),
    glance = list(x = o$fit),
    heat_loss_coefficient = list(simulator = o$room, values = cbind(ach = 0.5), drivers = numeric(),
                                 outside = 10, inside = 30),
    network = list(network_node("air", 1), network_link("air", "Te", 0.1), output = "air",
                   before = list(Te = 5), hold = TRUE, interpolation = "constant",
                   output_at = "mean", start_hours = 24, name = "a"),
    network_catalogue = list(network = o$network, air = "air", envelope = NULL, outdoors = "Te",
                             sun = "Gv", heating = "P", wind = NULL, neighbour = NULL,
                             sun_factor = 1e-3),
    network_flow = list(from = "a", to = "b", rate = 1, by = NULL, name = "f"),
    network_gain = list(to = "a", driver = "P", factor = 1, by = NULL, name = "g"),
    network_link = list(from = "a", to = "b", conductance = 1, resistance = NULL, by = NULL,
                        name = "l"),
    network_node = list(name = "a", capacity = 1, start = NULL),
    lognormal = list(meanlog = 0, sdlog = 1, lower = 0, upper = Inf),
    measurements = list(data = o$record, time = "hour", target = "Ti", boundary = ~ Te + Gv,
                        noise_sd = 0.1, average = NULL, calibrate = 1:60 <= 45,
                        validate = 1:60 > 45, warmup = 0, name = "a", unit = "K",
                        time_format = NULL, time_zone = NULL, fill_gaps = 0, missing = NULL,
                        range = NULL, stamp = NULL, label = NULL),
    mechanism = list(name = "a", edit = identity, boundary = "Te", sentence = "A."),
    normal = list(mean = 0, sd = 1, lower = -Inf, upper = Inf),
    outputs_of = list(simulator = o$function_simulator, outputs = "a"),
    paper_box = list(model = "M1", azimuth = 0),
    predict = list(object = o$fit, newdata = NULL, use = "calibrate", draws = 4,
                   discrepancy = FALSE, interval = "prediction", level = 0.95, seed = 1,
                   threads = 1),
    program_simulator = list(command = c("awk", "{{gain}}"), o$gain,
                             output = c(file = "a", column = "b"), templates = list(),
                             boundary = "Te", drivers = "d.csv", time_limit = 1, retries = 0,
                             cache = "runs", version = "", name = "p", size_limit = 10,
                             files = NULL, width = NULL, lead_in = 0, before = "record", keep = 0),
    program_output = list(file = "o.csv", column = "Ti", combine = NULL, time = "t",
                          time_format = NULL, stamps = "end", utc_offset = NULL, skip = 0,
                          comment = "#", separator = NULL, decimal = ".", units_rows = 0,
                          drop_first = 0, drop_last = 0, transform = NULL),
    program_step = list(command = "awk", input = NULL, stdout = NULL, folder = NULL, makes = NULL,
                        needs = NULL, fails_if = NULL, log = NULL, time_limit = NULL, status = 0),
    read_calibro = list(folder = o$folder, parameters = NULL, relative = FALSE, step_h = 1,
                        files = NULL),
    read_study = list(path = system.file("studies", "paper_synthetic.yml", package = "amiss"),
                      quiet = TRUE, trust = FALSE),
    refine_ensemble = list(ensemble = o$ensemble, fit = o$fit, runs = 10, threads = 1,
                           quiet = TRUE),
    render_run = list(simulator = o$program, values = c(gain = 0.5), folder = tempfile(),
                      measurements = NULL, segment = 1),
    rename_parameters = list(simulator = o$function_simulator, gain = "other"),
    report = list(x = o$upgrade, file = file.path(o$folder, "report.html"),
                  quiet = TRUE),
    report_fragment = list(x = o$upgrade, parts = NULL, level = 2),
    response_mechanism = list(boundary = "Gv", measurements = o$measurements, unit = "W/m2",
                              gain = NULL, time_constant = NULL, reference = NULL, name = "sun"),
    responses = list(measurements = o$measurements, units = character()),
    rolbs = list(n = 10, step_h = 0.25, power = 100, lengths = c(1, 2), seed = 1),
    run_study = list(path = system.file("studies", "paper_synthetic.yml", package = "amiss"),
                     out = NULL, seed = 1, threads = 1, quiet = TRUE, trust = FALSE),
    simulate = list(object = o$fit, nsim = 2, seed = 1, threads = 1),
    simulate_design = list(simulator = o$simulator, measurements = o$measurements, runs = 10,
                           seed = 1, threads = 1, quiet = TRUE),
    simulate_jointly = list(simulators = list(a = o$simulator, b = o$simulator),
                            measurements = list(a = o$measurements, b = o$measurements), runs = 10,
                            seed = 1, threads = 1, quiet = TRUE),
    simulate_runs = list(simulator = o$function_simulator, values = cbind(gain = 0.5),
                         drivers = o$drivers, step_h = 1, hold = NULL,
                         threads = 1),
    simulate_zone = list(zone = o$room, values = cbind(ach = 0.5), drivers = o$drivers,
                         step_s = 900, hold = NULL, threads = 1, control = list(), flux = NULL),
    sobol_indices = list(x = o$emulator, points = 32, replicates = 4, by_time = FALSE, seed = 1),
    survey = list(results = list(a = o$upgrade)),
    synthetic_weather = list(days = 1, step_h = 0.25, day_of_year = 100, latitude = 36,
                             temperature = 17, daily_range = 9, cloudiness = 0.3, wind = 3,
                             wind_direction = 240, azimuth = 180, seed = 1),
    tidy = list(x = o$fit, conf.level = 0.95),
    train_emulator = list(ensemble = o$ensemble, noise_sd = 0.1, control = list(), threads = 1),
    triangular = list(lower = 0, mode = 1, upper = 2),
    try_run = list(simulator = o$simulator, measurements = o$measurements, runs = 200, threads = 1,
                   quiet = TRUE),
    uniform = list(lower = 0, upper = 1),
    upgrade_model = c(list(simulator = o$simulator, catalogue = o$catalogue), upgrade),
    with_fmu = list(model = o$fmu, free("leak", uniform(0, 1)), inputs = "Te", fixed = list(),
                    name = "b"),
    with_parameters = list(model = o$function_simulator, free("k", uniform(0, 1)), f = NULL,
                           boundary = "Te", name = "b"),
    with_template = list(simulator = o$program, templates = list(b.txt = I("{{k}}")),
                         free("k", uniform(0, 1)), boundary = "Gv"),
    zone = list(zone_heater("h", "P"), volume = 10, air_capacity_factor = 1, initial_air = 20,
                initial_wall_offset = 0),
    zone_boundary = list(zone = o$room),
    zone_coupling = list(name = "c", conductance = 1, temperature = "T"),
    zone_crack = c(list(name = "o", width = 1, length = 1), opening),
    zone_flux = list(zone = o$room, wall = "wall", air = "Ti"),
    zone_gain = list(name = "g", power = "P", scale = 1, radiant_fraction = 0.5),
    zone_heater = list(name = "h", power = "P", radiant_fraction = 0.3, capacity = 0,
                       conductance = 10),
    zone_infiltration = list(name = "i", ach = 1, outside = "Te"),
    zone_layer = list(thickness = 0.1, conductivity = 1, capacity = 1e6),
    zone_opening = c(list(name = "o", area = 1), opening),
    zone_parameters = list(zone = o$room),
    zone_resolve = list(zone = o$room, values = c(ach = 0.5)),
    zone_supply = list(name = "s", flow = "F", temperature = "T", scale = 1),
    zone_wall = list(name = "w", area = 1, zone_layer(0.1, 1, 1e6), outside = "Te",
                     outside_film = 25, sun = NULL, absorptance = 0.5, sky = NULL, sky_view = 0.5,
                     wind_speed = "Ws", wind_direction = "Wd", azimuth = 0, wind_film = 0.1,
                     inside_convection = 3, inside_emissivity = 0.9, outside_emissivity = 0.9),
    zone_window = list(name = "w", area = 1, outside = "Te", u_value = 1, solar_factor = 0.5,
                       sun = NULL, to_air = 0.1))
}

# Values that an argument of each kind cannot take, by what they are.
date <- as.Date("2024-03-01")
kinds <- list(
  number = list(NaN, Inf, "nonsense", c(1, 2), date),
  limit = list(NA, "nonsense", c(1, 2)),
  field = list(NaN, identity),
  positive = list(NULL, "nonsense", date, -1, 0),
  not_negative = list(NaN, list(1), -1),
  share = list(NA, identity, -0.1, 1.1),
  count = list(NA, "nonsense", Inf, -1, 1.5),
  positive_count = list(NULL, numeric(), -1, 0, 1.5),
  huge = list(1e9),
  seed = list(NA, "nonsense", -1, 1.5, 2^31),
  threads = list(NULL, 0, 1.5, 1e6),
  flag = list(NULL, NA, "yes", c(TRUE, FALSE)),
  string = list(NA_character_, 1, c("a", "b")),
  filled_string = list(NULL, "", 1, c("a", "b")),
  file_name = list("", 1, "../a", "/a"),
  file_names = list("", 1, NA_character_, c("a", "../b")),
  pattern = list("(", NA_character_, 1),
  column = list(NA_character_, "", 1),
  columns = list(NULL, NA_character_, list("a")),
  choice = list(NULL, NA_character_, "nonsense", identity),
  object = list(NULL, "nonsense", data.frame(a = 1)),
  matrix = list("nonsense", list(), identity, matrix("a")),
  control = list(1, "nonsense", list(1), list(nonsense = 1)))

# Rows of a function's arguments, by kind: rows_of("uniform", lower = "number").
rows_of <- function(.function, ...) {
  arguments <- list(...)
  rows <- lapply(names(arguments), function(arg) {
    lapply(unlist(kinds[arguments[[arg]]], recursive = FALSE),
           function(value) list(f = .function, arg = arg, value = value))
  })
  lapply(unlist(rows, recursive = FALSE), function(row) {
    row$class <- "amiss_error_input"
    row$pattern <- row$arg
    row
  })
}

bad <- function(f, arg, value, pattern = arg, class = "amiss_error_input") {
  list(list(f = f, arg = arg, value = value, class = class, pattern = pattern))
}

# Options at any depth of `control`, such as c("calibration", "ais"). No option takes a text of no
# sense.
rows_of_control <- function(f, defaults, depth = character(), wrong = list("nonsense")) {
  nested <- function(control) {
    for (level in rev(depth)) control <- stats::setNames(list(control), level)
    control
  }
  where <- paste(c("control", depth), collapse = "\\$")
  rows <- lapply(names(defaults), function(option) {
    lapply(wrong, function(value) {
      bad(f, "control", nested(stats::setNames(list(value), option)), paste0(where, "\\$", option))
    })
  })
  c(unlist(unlist(rows, recursive = FALSE), recursive = FALSE),
    bad(f, "control", nested(list(nonsense = 1)), paste0(where, ".*nonsense")))
}

# Outcome of a row, within ten seconds: "" where it is refused as it should be, and otherwise what
# happened.
row_outcome <- function(row, calls) {
  arguments <- calls[[row$f]]
  arguments[row$arg] <- list(row$value)
  f <- switch(row$f, predict = stats::predict, simulate = stats::simulate,
              getExportedValue("amiss", row$f))
  setTimeLimit(elapsed = 10, transient = TRUE)
  on.exit(setTimeLimit())
  refused <- tryCatch({
    suppressWarnings(suppressMessages(do.call(f, arguments, quote = TRUE)))
    NULL
  }, error = identity)
  # Not conditionMessage(), which lays the text out anew.
  message <-
    if (inherits(refused, "rlang_error")) paste(c(refused$message, refused$body), collapse = " ")
    else if (!is.null(refused)) conditionMessage(refused)
  message <- gsub("`", "", gsub("\\s+", " ", cli::ansi_strip(message)))
  if (is.null(refused)) "was accepted"
  else if (!inherits(refused, row$class))
    paste0("stopped with <", class(refused)[1], ">: ", message)
  else if (!grepl(row$pattern, message)) paste0("says not '", row$pattern, "': ", message)
  else ""
}

# A study that is read and checked without being run; `fields` replace its own, NULL leaves one out.
bad_study <- function(fields) {
  o <- bad_input_objects()
  utils::write.csv(o$record, file.path(o$folder, "data.csv"), row.names = FALSE)
  writeLines(
    paste('function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],',
          'free("gain", uniform(0, 1)), boundary = "Te")'), file.path(o$folder, "model.R"))
  writeLines('catalogue(mechanism("sun", identity, "Gv", "The sun."))',
             file.path(o$folder, "catalogue.R"))
  study <- list(study = "linear", data = "data.csv", time = "hour", target = "Ti",
                boundary = list("Te", "Gv"), noise_sd = 0.1, model = "model.R",
                catalogue = "catalogue.R", runs = 10, seed = 1)
  study[names(fields)] <- fields
  path <- file.path(o$folder, "study.yml")
  yaml::write_yaml(study, path)
  path
}

# As row_outcome(), of a field of a study file.
study_outcome <- function(row) {
  calls <- list(run_study = list(path = bad_study(stats::setNames(list(row$value), row$arg)),
                                 quiet = TRUE, trust = TRUE))
  row_outcome(utils::modifyList(row, list(f = "run_study", arg = "quiet", value = TRUE)), calls)
}

# Rows of a field: what it cannot be, each said with its name.
study_rows <- function(field, ..., pattern = field) unlist(
  lapply(list(...), function(value) bad("study", field, value, pattern)), recursive = FALSE)

row_name <- function(row) sprintf("%s(%s = %s)", row$f, row$arg, substr(deparse1(row$value), 1, 60))

# Arguments that take anything, or nothing.
takes_all <- list(circular = "x", program_simulator = "version", glance = "x", tidy = "x",
                  augment = "x", autoplot = "object",
                  # gives none to any
                  slopes = c("simulator", "values", "drivers", "step_h", "hold"))
