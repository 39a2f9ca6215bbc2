# What must be refused, and how: see helper-bad-input.R. A new function, or a new argument, needs
# its rows here.

rows_by_kind <- function() c(
  rows_of("add_component", model = "object"),
  rows_of("ais", log_likelihood = "positive", priors = "object", control = "control",
          seed = "seed"),
  rows_of("amiss", data = "object", design = "matrix", runs = "matrix", control = "control",
          seed = "seed", threads = "threads"),
  rows_of("attribute_discrepancy", fit = "object", control = "control", seed = "seed",
          threads = "threads"),
  rows_of("autoplot", which = "choice"),
  rows_of("bayes_factor", model = "object", reference = "object"),
  rows_of("beta_prior", shape1 = "positive", shape2 = "positive", lower = "limit", upper = "limit"),
  rows_of("condition", label = "filled_string", unit = "string", circular = "flag"),
  rows_of("bootstrap_noise", replicates = "positive_count", detrend = "flag", seed = "seed"),
  rows_of("box_catalogue", columns = "columns", azimuth = "number"),
  rows_of("calibrate", emulator = "object", measurements = "object", control = "control",
          seed = "seed", threads = "threads"),
  rows_of("calibrate_jointly", ensembles = "object", measurements = "object",
          rounds = c("count", "huge"), runs = "huge", control = "control", seed = "seed",
          threads = "threads", quiet = "flag"),
  rows_of("calibrate_paper", emulator = "object", measurements = "object", control = "control",
          seed = "seed", threads = "threads"),
  rows_of("calibrate_refined", ensemble = "object", measurements = "object",
          rounds = c("count", "huge"), runs = "huge", control = "control", seed = "seed",
          threads = "threads", quiet = "flag"),
  rows_of("change_component", model = "object", name = "choice", capacity = "field"),
  rows_of("compare_models", models = "object", measurements = "object", method = "choice",
          runs = c("positive_count", "huge"),
          control = "control", seed = "seed", threads = "threads", quiet = "flag"),
  rows_of("component", model = "object", name = "choice"),
  rows_of("discrepancy", fit = "object"),
  rows_of("driver_names", simulator = "object"),
  rows_of("drop_component", model = "object", name = "choice"),
  rows_of("ensemble", design = "matrix", outputs = "matrix"),
  rows_of("free", name = "filled_string", prior = "object", unit = "string", label = "string"),
  rows_of("free_parameters", simulator = "object"),
  rows_of("function_simulator", f = "positive", boundary = "columns", name = "string"),
  rows_of("heat_loss_coefficient", simulator = "object", values = "matrix", outside = "number",
          inside = "number"),
  rows_of("lognormal", meanlog = "number", sdlog = "positive", lower = "limit", upper = "limit"),
  rows_of("measurements", data = "object", time = "string", target = "string",
          warmup = "not_negative",
          name = "string", unit = "string", time_format = "string", fill_gaps = "not_negative",
          missing = "matrix", range = "matrix"),
  rows_of("epw_weather", template = "filled_string", columns = "columns",
          file = c("filled_string", "file_name"), instant = "column", utc_offset = "limit"),
  rows_of("render_run", simulator = "object", folder = "filled_string"),
  rows_of("try_run", simulator = "object", measurements = "object", runs = "positive_count",
          threads = "threads", quiet = "flag"),
  rows_of("mechanism", name = "filled_string", edit = "positive", boundary = "columns",
          sentence = "filled_string"),
  rows_of("network", output = "filled_string", before = "positive", hold = "flag",
          interpolation = "choice", output_at = "choice", start_hours = "not_negative",
          name = "string"),
  rows_of("network_catalogue", network = "object", air = "choice", envelope = "column",
          outdoors = "column", sun = "column", heating = "column", wind = "column",
          neighbour = "column", sun_factor = "not_negative"),
  rows_of("network_flow", from = "column", to = "column", rate = "field", by = "column",
          name = "filled_string"),
  rows_of("network_gain", to = "filled_string", driver = "column", factor = "field", by = "column",
          name = "filled_string"),
  rows_of("network_link", from = "filled_string", to = "filled_string", conductance = "field",
          resistance = "field", by = "column", name = "filled_string"),
  rows_of("network_node", name = "filled_string", capacity = "field", start = "field"),
  rows_of("normal", mean = "number", sd = "positive", lower = "limit", upper = "limit"),
  rows_of("outputs_of", simulator = "object", outputs = "columns"),
  rows_of("paper_box", model = "choice", azimuth = "number"),
  rows_of("predict", use = "choice", draws = c("positive_count", "huge"), discrepancy = "flag",
          interval = "choice", level = "share", seed = "seed", threads = "threads"),
  rows_of("fmu_simulator", file = "filled_string", output = "filled_string", inputs = "columns",
          averaged = "flag", steps_per_row = c("positive_count", "huge"), start = "number",
          tolerance = "count", time_limit = "positive", size_limit = "positive",
          retries = c("count", "huge"), logging = "flag"),
  rows_of("fmu_variables", file = "filled_string"),
  rows_of("program_simulator", command = "columns", boundary = "columns", drivers = "filled_string",
          time_limit = "positive", size_limit = "positive", retries = c("count", "huge"),
          cache = "filled_string", name = "string", files = "file_names", lead_in = "not_negative",
          before = "choice", keep = "count"),
  rows_of("program_output", file = c("filled_string", "file_name"), column = "column",
          combine = "column", time = "column", time_format = "string", stamps = "choice",
          utc_offset = "limit", skip = "count", comment = "string", separator = "string",
          decimal = "choice", units_rows = "count", drop_first = "count", drop_last = "count"),
  rows_of("program_step", command = "filled_string", input = "string", stdout = "file_name",
          folder = "file_name", makes = "file_names", needs = "pattern", fails_if = "pattern",
          log = "file_names"),
  rows_of("read_calibro", folder = "filled_string", relative = "flag", step_h = "positive"),
  rows_of("read_study", path = "filled_string", quiet = "flag", trust = "flag"),
  rows_of("refine_ensemble", ensemble = "object", fit = "object",
          runs = c("positive_count", "huge"), threads = "threads", quiet = "flag"),
  rows_of("rename_parameters", simulator = "object", gain = "filled_string"),
  rows_of("report", x = "object", file = "filled_string", quiet = "flag"),
  rows_of("report_fragment", x = "object"),
  rows_of("response_mechanism", boundary = "filled_string", measurements = "object",
          unit = "string", reference = "field", name = "filled_string"),
  rows_of("responses", measurements = "object", units = "columns"),
  rows_of("rolbs", n = "positive_count", step_h = "positive", power = "number", seed = "seed"),
  rows_of("run_study", path = "filled_string", seed = "seed", threads = "threads", quiet = "flag",
          trust = "flag"),
  rows_of("simulate", nsim = c("positive_count", "huge"), seed = "seed", threads = "threads"),
  rows_of("simulate_design", simulator = "object", measurements = "object",
          runs = c("positive_count", "huge"), seed = "seed", threads = "threads", quiet = "flag"),
  rows_of("simulate_jointly", simulators = "object", measurements = "object",
          runs = c("positive_count", "huge"), seed = "seed", threads = "threads", quiet = "flag"),
  rows_of("simulate_runs", simulator = "object", values = "matrix", drivers = "matrix",
          step_h = "positive", threads = "threads"),
  rows_of("simulate_zone", zone = "object", drivers = "matrix", step_s = "positive",
          control = "control", threads = "threads", flux = "column"),
  rows_of("sobol_indices", x = "object", points = c("positive_count", "huge"),
          replicates = "positive_count", by_time = "flag", seed = "seed"),
  rows_of("synthetic_weather", days = c("positive", "huge"), step_h = "positive",
          day_of_year = "number", latitude = "number", temperature = "number",
          daily_range = "not_negative", cloudiness = "share", wind = "not_negative",
          wind_direction = "number", azimuth = "number", seed = "seed"),
  rows_of("tidy", conf.level = "share"),
  rows_of("train_emulator", ensemble = "object", noise_sd = "not_negative", control = "control",
          threads = "threads"),
  rows_of("triangular", lower = "limit", mode = "number", upper = "limit"),
  rows_of("uniform", lower = "limit", upper = "limit"),
  rows_of("upgrade_model", simulator = "object", measurements = "object", catalogue = "object",
          runs = c("count", "huge"),
          control = "control", seed = "seed", threads = "threads", quiet = "flag"),
  rows_of("with_fmu", model = "object", inputs = "columns", name = "string"),
  rows_of("with_parameters", model = "object", boundary = "columns", name = "string"),
  rows_of("with_template", simulator = "object", boundary = "columns"),
  rows_of("zone", volume = "positive", air_capacity_factor = "positive", initial_air = "number",
          initial_wall_offset = "number"),
  rows_of("zone_boundary", zone = "object"),
  rows_of("zone_coupling", name = "filled_string", conductance = "field",
          temperature = "filled_string"),
  rows_of("zone_crack", name = "filled_string", width = "not_negative", length = "field",
          outside = "filled_string", height = "field", azimuth = "field", wind_speed = "column",
          wind_direction = "column", exposure = "choice", shelter = "field"),
  rows_of("zone_flux", zone = "object", wall = "filled_string", air = "filled_string"),
  rows_of("zone_gain", name = "filled_string", power = "filled_string", scale = "number",
          radiant_fraction = "share"),
  rows_of("zone_heater", name = "filled_string", power = "filled_string",
          radiant_fraction = "share", capacity = "field",
          conductance = "positive"),
  rows_of("zone_infiltration", name = "filled_string", ach = "not_negative",
          outside = "filled_string"),
  rows_of("zone_layer", thickness = "positive", conductivity = "positive",
          capacity = "not_negative"),
  rows_of("zone_opening", name = "filled_string", area = "not_negative", outside = "filled_string",
          height = "field", azimuth = "field", wind_speed = "column", wind_direction = "column",
          exposure = "choice", shelter = "field"),
  rows_of("zone_parameters", zone = "object"),
  rows_of("zone_resolve", zone = "object", values = "limit"),
  rows_of("zone_supply", name = "filled_string", flow = "filled_string",
          temperature = "filled_string",
          scale = "field"),
  rows_of("zone_wall", name = "filled_string", area = "positive", outside = "column",
          outside_film = "field", sun = "column", absorptance = "field", sky = "column",
          sky_view = "field", wind_speed = "column", wind_direction = "column", wind_film = "share",
          inside_convection = "field", inside_emissivity = "field",
          outside_emissivity = "field"),
  rows_of("zone_window", name = "filled_string", area = "positive", outside = "filled_string",
          u_value = "field", solar_factor = "share", sun = "column", to_air = "field"))

rows_of_controls <- function() {
  every <- list("nonsense", NaN, c(1, 2, 3), identity)
  loop <- function(f, own) c(
    rows_of_control(f, own),
    rows_of_control(f, emulator_control, "emulator"),
    rows_of_control(f, calibration_control, "calibration"),
    rows_of_control(f, ais_defaults_(), c("calibration", "ais")))
  c(rows_of_control("ais", ais_defaults_(), wrong = every),
    rows_of_control("train_emulator", emulator_control, wrong = every),
    rows_of_control("calibrate", calibration_control, wrong = list("nonsense", NaN, -1)),
    rows_of_control("calibrate", ais_defaults_(), "ais"),
    rows_of_control("calibrate_paper", paper_control, wrong = list("nonsense", NaN, c(1, -1))),
    rows_of_control("calibrate_paper", ais_defaults_(), "ais"),
    rows_of_control("attribute_discrepancy", attribution_control, wrong = every),
    rows_of_control("attribute_discrepancy", ais_defaults_(), "ais"),
    rows_of_control("simulate_zone", zone_control, wrong = every),
    loop("upgrade_model", upgrade_control),
    loop("compare_models", comparison_control),
    rows_of_control("compare_models", attribution_control, "attribution"),
    rows_of_control("calibrate_refined", emulator_control, "emulator"),
    rows_of_control("calibrate_refined", calibration_control, "calibration"))
}

# What is of the right kind and wrong all the same; and what fits no kind.
rows_of_their_own <- function() {
  o <- bad_input_objects()
  values <- o$ensemble$values
  twice <- cbind(values, gain = values[, "gain"])
  steps <- o$drivers[, c("Te", "P", "Te")]
  half <- function(x) function(z) ifelse(z[, 1] > 0.5, x, 0)
  c(
    bad("ais", "log_likelihood", half(NaN), "log_likelihood.*not a number at .* points.*a = ",
        "amiss_error_numerical"),
    bad("ais", "log_likelihood", half(Inf), "log_likelihood.* is Inf at a = "),
    bad("ais", "log_likelihood", function(z) "likely", "log_likelihood.*<character>"),
    bad("ais", "gradient", "steep"), bad("ais", "gradient", function(z) 1, "gradient.*matrix"),
    bad("ais", "priors", list(a = uniform(0, 1), a = uniform(0, 1))),
    bad("ais", "control", list(groups = 1e7, chains = 1000),
        "groups = 1e\\+07 would take about .* hours.*allow_large"),
    bad("ais", "control", list(groups = 4, groups = 8), "groups.* twice"),
    bad("attribute_discrepancy", "control", list(surrogates = 1e9),
        "surrogates = 1e\\+09 would take.*--large"),
    bad("augment", "data", o$record, "data.* is not used"), bad("augment", "newdata", "new"),
    bad("beta_prior", "upper", -1, "lower < upper"),
    bad("beta_prior", "lower", -Inf, "finite limits"),
    bad("calibrate", "control",
        list(error_ratios = seq(0, 100, length.out = 1000), reach = c(1, 2, 3)),
        "error_ratios \\(1000 values\\).*GB"),
    bad("calibrate", "control", list(error_draws = 1e9), "error_draws = 1e\\+09 would take about"),
    bad("calibrate", "control", list(check = 1e9), "check = 1e\\+09 would take about"),
    bad("calibrate", "control", list(reach = c(1, 1)), "reach has number 2, 1, twice"),
    bad("calibrate", "measurements", linear_measurements(o$record, calibrate = 1:60 > 15),
        "other rows"),
    bad("calibrate_paper", "control", list(fictitious_seed = 1.5),
        "fictitious_seed .*number 1\\.5"),
    bad("calibrate_refined", "rounds", 2000, "rounds = 2000 would take"),
    bad("calibrate_refined", "runs", 0),
    bad("catalogue", 1, "sun", "number 1 is \"sun\""),
    bad("change_component", "name", "attic", "attic"),
    bad("compare_models", "models", list(o$simulator)),
    bad("compare_models", "models", list(a = 3), "\"a\" is no simulator"),
    bad("compare_models", "truth", list(simulator = o$simulator), "truth.*values"),
    bad("compare_models", "truth", list(simulator = o$simulator, values = c(gain = 1)),
        "truth\\$values.*offset"),
    bad("compare_models", "truth",
        list(simulator = o$simulator, values = c(gain = Inf, offset = 1)), "truth\\$values"),
    bad("compare_models", "truth", "M3"), bad("compare_models", "checkpoint", 1),
    bad("compare_models", "runs", 3, "too few"),
    bad("compare_models", "checkpoint",
        file.path(system.file("DESCRIPTION", package = "amiss"), "kept"), "a file, not a folder"),
    bad("amiss", "noise_sd", 0.2, "noise_sd.*part of"),
    bad("amiss", "parameters", list("gain"), "got \"gain\""), bad("amiss", "data", o$record[1:5, ]),
    bad("ensemble", "design", twice),
    bad("ensemble", "design", cbind(values, sun = 1:10), "column.*sun.*without a parameter"),
    bad("ensemble", "design", values[, 1, drop = FALSE], "lacks column.*gain"),
    bad("ensemble", "design", replace(values, 13, Inf), "Inf in row 3 of column \"gain\""),
    bad("ensemble", "outputs", o$ensemble$outputs[, -1], "needs its run"),
    bad("ensemble", "parameters", unname(o$ensemble$parameters[c(1, 1, 2)]), "offset.*twice"),
    bad("ensemble", "parameters", "gain"),
    bad("ensemble", "parameters", list("gain"), "got \"gain\""),
    bad("ensemble", "measurements", "record"),
    bad("ensemble", "measurements", linear_measurements(), "45 rows.*240"),
    bad("ensemble", "validation", "runs"),
    bad("ensemble", "validation", matrix(0, 3, 10), "validation.* 3"),
    bad("ensemble", "time", 1:3, "time.*3 values"),
    bad("ensemble", "time", 101:145, "lack 45 of the 45 rows"),
    bad("function_simulator", "f", function(values) 1, "values and drivers"),
    bad("glance", "nonsense", 1, "nonsense", "rlib_error_dots_nonempty"),
    bad("heat_loss_coefficient", "drivers", "warm"),
    bad("heat_loss_coefficient", "inside", 5, "inside is 5"),
    bad("heat_loss_coefficient", "values", cbind(ach = Inf), "Inf in row 1"),
    bad("heat_loss_coefficient", "values", c(other = 1), "ach"),
    bad("lognormal", "lower", 1e9, "no mass"), bad("normal", "lower", 50, "no mass"),
    bad("normal", "upper", -Inf, "lower < upper"), bad("measurements", "boundary", 1),
    bad("measurements", "boundary", character()),
    bad("measurements", "boundary", list(Te = "outdoor air"), "under the names of their columns"),
    bad("measurements", "boundary", ~ humidity, "humidity"),
    bad("measurements", "boundary", ~ Ti, "is the target or the time"),
    bad("measurements", "time", "Te", "Te"), bad("measurements", "noise_sd", -1, "noise_sd.*-1"),
    bad("measurements", "noise_sd", "much", "noise_sd.*much"),
    bad("measurements", "noise_sd", 1e-100, "noise_sd.*1e-100.*another unit"),
    bad("measurements", "noise_sd", NULL), bad("measurements", "average", 0.3, "average.*0.3"),
    bad("measurements", "average", "day"),
    bad("measurements", "calibrate", "hour <", "calibrate.*hour <"),
    bad("measurements", "calibrate", TRUE), bad("measurements", "validate", 1:60),
    bad("measurements", "validate", rep(TRUE, 60), "both calibrate"),
    bad("measurements", "data", cbind(o$record, Te = 1), "column \"Te\" more than once"),
    bad("measurements", "target", "hour", "both the column"),
    bad("measurements", "boundary", ~ Te + circular(Te), "Te\" stands twice in boundary"),
    bad("measurements", "average", 1e300),
    bad("calibrate", "measurements",
        replace(o$measurements, "y", list(rep(20, length(o$measurements$y)))),
        "Target \"Ti\" is 20 in all 45 rows"),
    bad("upgrade_model", "measurements",
        replace(o$measurements, "y", list(rep(20, length(o$measurements$y)))),
        "there is nothing to explain"),
    bad("measurements", "time_format", "%Q", "time_format"),
    bad("measurements", "time_zone", "Mars/Olympus", "time_zone"),
    bad("measurements", "time_zone", 1, "time_zone"),
    bad("measurements", "stamp", "middle", "stamp"),
    bad("measurements", "stamp", 1, "stamp"), bad("measurements", "label", "", "label"),
    bad("measurements", "label", 1, "label"),
    bad("read_calibro", "files", c(observed = "a.csv"), "files"), bad("read_calibro", "files", 1),
    bad("report_fragment", "parts", "nonsense", "belongs in a chunk"),
    bad("report_fragment", "level", 9, "level.*9"), bad("report_fragment", "level", "deep"),
    bad("bootstrap_noise", "replicates", 1e9),
    bad("measurements", "data", transform(o$record, Ti = ifelse(hour > 30, -9999, Ti)),
        "-9999 in rows 31 to 60"),
    bad("mechanism", "edit", function() 1),
    bad("predict", "newdata", "new"), bad("predict", "newdata", data.frame(Te = 1), "time"),
    bad("predict", "use", "tomorrow", "use has \"tomorrow\""), bad("fmu_simulator", "cache", 1),
    bad("fmu_simulator", "name", 1), bad("fmu_simulator", "fixed", identity),
    bad("fmu_simulator", "fixed", list(leak = c(1, 2)), "fixed\\$leak"),
    bad("fmu_simulator", "fixed", list(1)),
    bad("fmu_simulator", "fixed", list(leak = -1), "fixed\\$leak.*limits of the FMU"),
    bad("fmu_simulator", "file", "nowhere.fmu", "nowhere.fmu"),
    bad("fmu_simulator", "file", tempdir(), "no such file"),
    bad("fmu_simulator", "output", "Te", "\"Te\" of the FMU is no variable"),
    bad("fmu_simulator", "inputs", "C_air", "\"C_air\" of the FMU is no input"),
    bad("fmu_simulator", 2, free("Rout", uniform(0, 1)), "no variable \"Rout\".*R_out"),
    bad("fmu_simulator", 2, 5, "free"), bad("fmu_variables", "file", "nowhere.fmu", "nowhere.fmu"),
    bad("with_fmu", "fixed", list(R_out = 0.01), "R_out.*is free in the model"),
    bad("with_fmu", 2, free("k", uniform(0, 1)), "no variable \"k\""),
    bad("program_simulator", "output", "out.csv"),
    bad("program_simulator", "output", c(a = "b", c = "d")),
    bad("program_simulator", "templates", list("a")),
    bad("program_simulator", "templates", list(a = "nowhere"), "no file nowhere"),
    bad("program_simulator", "templates", list(a = I("{{k}}")), "\"k\".*no parameter"),
    bad("program_simulator", "command", ""),
    bad("program_simulator", "command", list("a", 1), "Number 2 of command"),
    bad("program_simulator", "files", "nowhere", "nowhere.*not there"),
    bad("program_simulator", "files", c(o$epw, o$folder), "a folder among files"),
    bad("program_simulator", "templates", "a.txt", "a.txt.*none of the 0 files"),
    bad("program_simulator", "templates", "/a.txt", "run's directory"),
    bad("program_simulator", "templates", list(a = o$folder), "a folder is no file"),
    bad("program_simulator", "templates", list(a = I("{{system(gain)}}")),
        "system.gain. is not evaluated"),
    bad("program_simulator", "templates", list(a = I("{{gain:%d}}")), "no whole number"),
    bad("program_simulator", "drivers", "../d.csv", "run's directory"),
    bad("program_simulator", "drivers", function(table) 1, "1 argument"),
    bad("program_simulator", "width", 5), bad("program_simulator", "width", 7.5),
    bad("program_step", "status", "x"), bad("program_step", "status", NA),
    bad("program_step", "time_limit", 0), bad("program_step", "time_limit", "long"),
    bad("program_output", "column", c("a", "b"), "combine"),
    bad("program_output", "time", 1, "column is not"), bad("program_output", "transform", "log"),
    bad("epw_weather", "template", o$folder, "it is a folder"),
    bad("epw_weather", "columns", c(sun = "G"), "no column"), bad("render_run", "values", c(a = 1)),
    bad("render_run", "folder", o$folder, "not empty"), bad("render_run", "values", c(gain = NaN)),
    bad("render_run", "measurements", 1), bad("render_run", "segment", 5, "needs .*measurements"),
    bad("read_calibro", "folder", "nowhere"), bad("read_calibro", "parameters", "gain", "obs.csv"),
    bad("read_study", "path", tempdir(), "."), bad("run_study", "out", 1),
    bad("run_study", "path", "nowhere.yml", "nowhere.yml"),
    bad("run_study", "out", c("a", "b")),
    bad("report", "file", "report.odt", "report.odt"),
    bad("report", "file", "nowhere/report.html", "nowhere"),
    bad("response_mechanism", "boundary", "humidity", "humidity"),
    bad("response_mechanism", "gain", "strong"), bad("response_mechanism", "time_constant", "slow"),
    bad("response_mechanism", "time_constant", normal(0, 1),
        "time_constant begins at -Inf, below zero"),
    bad("responses", "units", c(Gh = "W/m2")), bad("responses", "units", "K"),
    bad("rolbs", "lengths", 0.1, "lengths is 0.1"),
    bad("rolbs", "lengths", c(1, Inf), "lengths has Inf"),
    bad("rolbs", "n", 1e12, "n is 1e\\+12"),
    bad("rolbs", "lengths", date),
    bad("survey", "results", 1), bad("survey", "results", list(a = o$fit), "upgrade"),
    bad("survey", "results", list(o$upgrade), "name"), bad("survey", "results", list()),
    bad("survey", "results", "nowhere", "nowhere"), bad("survey", "results", character()),
    bad("simulate", "nsim", 1e9, "nsim = 1e\\+09 would take about .* GB of memory.*allow_large"),
    bad("simulate_design", "runs", 3, "3 runs are too few"),
    bad("simulate_design", "runs", 1e9, "runs = 1e\\+09 would take about"),
    bad("simulate_design", "simulator",
        function_simulator(o$function_simulator$f, o$gain, boundary = "Tx"), "Tx"),
    bad("simulate_runs", "hold", "warm"), bad("simulate_runs", "hold", 1:3),
    bad("simulate_runs", "hlod", 1, "hlod"), bad("simulate_runs", "time", 1:3),
    bad("simulate_runs", "values", cbind(other = 1), "values.*gain"),
    bad("simulate_runs", "values", cbind(gain = 1, gain = 2), "gain.*twice"),
    bad("simulate_runs", "drivers", o$drivers[, "P", drop = FALSE], "drivers.*Te"),
    bad("simulate_runs", "drivers", steps, "drivers.*Te.*twice"),
    bad("simulate_zone", "values", "warm"), bad("simulate_zone", "values", cbind(other = 1), "ach"),
    bad("simulate_zone", "values", cbind(ach = 1, ach = 2), "ach.*twice"),
    bad("simulate_zone", "values", cbind(ach = -1), "ach.*-1"),
    bad("simulate_zone", "drivers", steps),
    bad("simulate_zone", "drivers", replace(o$drivers, 2, NA), "missing or infinite.*Te"),
    bad("simulate_zone", "hold", "warm"), bad("simulate_zone", "hold", 1:3),
    bad("simulate_zone", "hold", rep(Inf, 10)), bad("simulate_zone", "control", list(cells = 1e9),
                                                    "control\\$cells = 1e\\+09 would take about"),
    bad("simulate_zone", "control", list(max_substep_s = 0), "max_substep_s is 0"),
    bad("simulate_zone", "step_s", 1e12,
        "step_s = 1e\\+12 has more than 1e8 steps of control\\$max_substep_s = 300"),
    bad("synthetic_weather", "latitude", 200, "latitude is 200"),
    bad("synthetic_weather", "day_of_year", 400, "day_of_year is 400"),
    bad("synthetic_weather", "step_h", 12, "step_h is 12"),
    bad("synthetic_weather", "cloudiness", 80, "cloudiness is 80"),
    bad("train_emulator", "noise_sd", linear_measurements(), "45 steps.*240"),
    bad("train_emulator", "control", list(searches = 9), "searches is 9"),
    bad("train_emulator", "control", list(max_vectors = 1), "max_vectors is 1"),
    bad("train_emulator", "control", list(explained = 0), "explained is 0"),
    bad("triangular", "mode", 3, "mode"), bad("uniform", "upper", 0, "lower < upper"),
    bad("uniform", "lower", -Inf, "finite limits"),
    bad("triangular", "upper", 1e309, "finite limits"), bad("upgrade_model", "checkpoint", ""),
    bad("upgrade_model", "runs", 0),
    bad("upgrade_model", "control", list(rounds = 0), "rounds is 0"),
    bad("upgrade_model", "control", list(screening = list()), "unknown option.*screening"),
    bad("upgrade_model", "control", list(runs_total = 0), "runs_total is 0"),
    bad("upgrade_model", "control", list(rounds = 1e9), "control\\$rounds = 1e\\+09 would take"),
    bad("with_parameters", "f", "base"),
    bad("with_parameters", "f", function(values, drivers, wind) 1, "wind"),
    bad("with_parameters", 2, free("gain", uniform(0, 3)), "in the model already"),
    bad("with_template", "templates", 1),
    bad("with_template", "templates", list(b.txt = 1), "b.txt"),
    bad("with_template", "templates", list(b.txt = function(lines) lines),
        "none that its function"),
    bad("zone", 1, zone_layer(1, 1, 1), "components"),
    bad("zone", "air_capacity_factor", 0.5, "0.5"), bad("zone_heater", "name", "zone", "zone"),
    bad("zone_resolve", "values", c(ach = -5), "ach.*-5"),
    bad("zone_resolve", "values", c(other = 1), "ach"), bad("zone_wall", 3, "brick", "layers"),
    bad("zone_wall", "wind_speed", NULL, "wind_speed"), bad("zone_wall", "azimuth", "south"),
    bad("zone_opening", "wind_speed", "Ws", "wind_direction"))
}

# The rows that were not refused as they should be.
faults <- function(rows) {
  told <- vapply(rows, row_outcome, "", valid_calls())
  paste(vapply(rows, row_name, ""), told)[nzchar(told)]
}

test_that("every argument refuses what is not of its kind, by its name", {
  skip_on_cran()
  expect_identical(faults(rows_by_kind()), character())
})

test_that("every option refuses what it cannot be, before anything is computed", {
  skip_on_cran()
  expect_identical(faults(rows_of_controls()), character())
})

test_that("what is of the right kind, and wrong all the same, is refused", {
  skip_on_cran()
  expect_identical(faults(rows_of_their_own()), character())
})

rows_of_study <- function() {
  c(study_rows("study", NULL, 1, list("a", "b")), study_rows("title", 2024, list("a", "b")),
    study_rows("unit", 1, list("a", "b")), study_rows("data", NULL, 1, "nowhere.csv", "model"),
    study_rows("time", NULL, 1, list("a", "b")), study_rows("target", NULL, 1, list("a", "b")),
    study_rows("boundary", NULL, list("Te", "Te")),
    study_rows("time", "Te", "none", pattern = "Te|none"),
    study_rows("target", "none", pattern = "none"),
    study_rows("boundary", "none", 1, pattern = "none|1"),
    study_rows("time_format", 1, "%Q", pattern = "time_format"),
    study_rows("time_zone", "Mars/Olympus", 1, pattern = "time_zone"),
    study_rows("stamp", "middle", 1, pattern = "stamp"), study_rows("label", 1, list("a", "b")),
    study_rows("fill_gaps_h", -1, "long", pattern = "fill_gaps"),
    study_rows("missing", "broken", TRUE, list("a")), study_rows("range", 1, "wide", list(2, 1)),
    study_rows("separator", 1, list(",", ";")), study_rows("decimal", ";", 1, list(".", ",")),
    study_rows("noise_sd", -1, "much", TRUE, list(1, 2), NULL),
    study_rows("average_h", -1, 0.3, "day", pattern = "average"),
    study_rows("calibrate", "hour <", "system('ls')", 1, TRUE, "humidity > 3"),
    study_rows("validate", "hour > 1e9", "stop()", list("a")),
    study_rows("warmup_h", -1, "day", pattern = "warmup"),
    study_rows("runs", 0, -1, 1.5, "many", 1e9, list(1, 2), TRUE),
    study_rows("seed", -1, 1.5, "one", 3e9, list(1, 2), TRUE),
    study_rows("model", NULL, "data.csv", "nowhere.R", 1),
    study_rows("catalogue", NULL, "nowhere.R", 1, "model.R"), study_rows("colour", "red"),
    study_rows("method", "paper"), study_rows("truth", "model.R"),
    study_rows("records", 1, "a", list("a", "b"), list(a = 1)),
    study_rows("records", list(a = list(colour = "red")), pattern = "colour"),
    study_rows("records", list(a = list(noise_sd = -1)), pattern = "noise_sd"),
    study_rows("control", "fast", 1, list(1)),
    study_rows("control", list(steps = 3), pattern = "steps"),
    study_rows("control", list(max_steps = -1), pattern = "control\\$max_steps is -1"),
    study_rows("control", list(emulator = list(starts = 0)),
               pattern = "control\\$emulator\\$starts is 0"),
    study_rows("control", list(calibration = list(inclusion = 2)),
               pattern = "control\\$calibration\\$inclusion is 2"),
    study_rows("control", list(calibration = list(ais = list(groups = 1))),
               pattern = "control\\$calibration\\$ais\\$groups is 1"),
    study_rows("control", list(calibration = 5), list(attribution = "no"),
               list(attribution = list(level = 5)), list(rounds = 0)))
}

expect_refused <- function(rows) {
  told <- vapply(rows, study_outcome, "")
  expect_identical(paste(vapply(rows, row_name, ""), told)[nzchar(told)], character())
}

test_that("every field of a study is checked before anything is computed", {
  rows <- rows_of_study()
  fields <- vapply(rows, `[[`, "", "arg")
  expect_identical(setdiff(unlist(study_fields), c(fields, "models")), character())
  expect_refused(rows[!duplicated(fields)])
})

test_that("every value that a field of a study cannot take is refused", {
  skip_on_cran()  # second tier: tools/test --quick
  expect_refused(rows_of_study())
})

test_that("the command refuses bad words with status 2, and bad studies with 1", {
  study <- bad_study(list())
  status <- function(...) {
    said <- NULL
    out <- withCallingHandlers(run_command(c(...)), message = function(m) {
      said <<- c(said, conditionMessage(m))
      invokeRestart("muffleMessage")
    })
    list(out, paste(said, collapse = " "))
  }
  refuses <- function(expected, pattern, ...) {
    told <- status(...)
    expect_identical(told[[1]], expected)
    expect_match(told[[2]], pattern)
  }
  run <- function(...)
    c("run", study, "--out", file.path(tempdir(), "never-made"), "--trust", "--quiet", ...)
  for (option in c("--seed", "--threads"))
    for (value in c("Inf", "NaN", "1.5", "-1", "x", "1e20", "NA", "''"))
      refuses(2, option, run(option, value))
  refuses(2, "from 1 to 1024", run("--threads", "0"))
  refuses(2, "from 0 to 2147483647", run("--seed", "2147483648"))
  refuses(2, "colour", run("--colour"))
  refuses(2, "one study file", run("more.yml"))
  refuses(2, "no command", character())
  refuses(2, "unknown command 'walk'", "walk")
  refuses(2, "'--out DIR' is needed", "run", study)
  refuses(2, "does not exist", "run", "nowhere.yml", "--out", "x")
  bad_study(list(runs = 1e9))
  refuses(1, "--large", run())
  expect_false(file.exists(file.path(tempdir(), "never-made")))
})

test_that("a study nested without end is refused at once", {
  path <- withr::local_tempfile(fileext = ".yml")
  for (text in c(strrep("[", 1e5), strrep("{a: ", 1e5), strrep("- ", 1e5), strrep("a", 2e6))) {
    writeLines(paste("study:", text), path)
    expect_error(read_study(path), "nested deeper|larger than 1 MB", class = "amiss_error_input")
  }
})

test_that("every argument of every exported function is in the table", {
  rows <- c(rows_by_kind(), rows_of_controls(), rows_of_their_own())
  expect_gt(length(rows), 1000)
  in_table <- split(vapply(rows, function(row) as.character(row$arg), ""),
                    vapply(rows, `[[`, "", "f"))
  for (f in getNamespaceExports("amiss")) {
    missed <- setdiff(names(formals(getExportedValue("amiss", f))),
                      c("...", in_table[[f]], takes_all[[f]]))
    expect(!length(missed), sprintf("%s() has no row for %s", f, paste(missed, collapse = ", ")))
  }
})

test_that("a size is refused with its estimate, and allowed where that is asked for", {
  o <- bad_input_objects()
  fine <- function() simulate_zone(o$room, cbind(ach = rep(0.5, 1e5)), o$drivers, 900,
                                   control = list(max_substep_s = 1e-3))
  expect_error(fine(), "max_substep_s` = 0.001 would take about .* hours of computing",
               class = "amiss_error_input")
  expect_silent(check_size("draws", 10, gb = 1, hours = 1))
  expect_error(check_size("draws", 1e9, gb = 5), "`draws` = 1e+09 would take about 5 GB of memory",
               class = "amiss_error_input", fixed = TRUE)
  withr::local_options(amiss.allow_large = TRUE)
  expect_true(check_size("draws", 1e9, gb = 5))
})

test_that("a boundary condition may have any name in backticks", {
  data <- linear_data(60)
  names(data)[2] <- "T e"
  expect_identical(linear_measurements(data, boundary = ~ `T e` + Gv)$conditions, c("T e", "Gv"))
})

test_that("a likelihood that is seldom undefined is told of", {
  seldom <- function(z) ifelse(z[, 1] > 0.97, NaN, -50 * (z[, 1] - 0.5)^2)
  expect_warning(ais(seldom, list(a = uniform(0, 1)), seed = 1),
                 "not a number at .* points, which count as impossible",
                 class = "amiss_warning_result")
})

# What is told if a function is called without one of its arguments.
told_without <- function(f, argument, call) {
  told <- tryCatch(do.call(getExportedValue("amiss", f), call[names(call) != argument],
                           quote = TRUE), error = identity)
  named <- inherits(told, "amiss_error_input") && grepl(argument, conditionMessage(told))
  if (!named) paste(f, argument, class(told)[1])
}

test_that("an argument that is missing is named", {
  skip_on_cran()
  # measurements(), and what dispatches on its first argument, stand apart.
  own <- setdiff(names(valid_calls()),
                 c("measurements", "tidy", "glance", "augment", "autoplot", "predict", "simulate",
                   "summary", "report_fragment", "attribute_discrepancy"))
  wrong <- lapply(own, function(f) {
    needed <- Filter(rlang::is_missing, formals(getExportedValue("amiss", f)))
    call <- unclass(valid_calls()[[f]])
    call <- call[nzchar(names(call))]  # what has no name would take the place of what is missing
    lapply(intersect(setdiff(names(needed), "..."), names(call)), told_without, f = f, call = call)
  })
  expect_null(unlist(wrong))
})

test_that("text of bytes is refused where a text is asked for", {
  bytes <- "a\xff"
  Encoding(bytes) <- "bytes"
  for (bad in list(bytes, "a\xff")) {
    expect_error(free(bad, uniform(0, 1)), "`name` .*no characters", class = "amiss_error_input")
    expect_error(calibrate_paper(bad), class = "amiss_error_input")
    expect_error(component(bad_input_objects()$room, bad), "no characters",
                 class = "amiss_error_input")
    expect_error(mechanism("a", identity, bad, "A."), "no characters", class = "amiss_error_input")
  }
  latin <- "\xe9"
  Encoding(latin) <- "latin1"
  expect_identical(free(latin, uniform(0, 1))$name, "\u00e9")
})

test_that("an object that only seems to be one is refused, and a real one is whole", {
  o <- bad_input_objects()
  for (fake in list(list(), list(format_version = 3L), 1)) {
    seems <- function(class) structure(fake, class = class)
    refused <- function(code) expect_error(code, "is not whole", class = "amiss_error_input")
    refused(calibrate(seems("amiss_emulator"), o$measurements))
    refused(train_emulator(seems("amiss_ensemble"), o$measurements))
    refused(attribute_discrepancy(seems("amiss_calibration")))
    refused(free("a", seems("amiss_prior")))
    refused(function_simulator(function(values, drivers) 1, seems("amiss_free")))
    refused(catalogue(seems("amiss_mechanism")))
    refused(free_parameters(seems("amiss_function_simulator")))
    refused(report(seems("amiss_upgrade"), tempfile(fileext = ".html")))
    refused(glance(seems("amiss_fit")))
  }
  for (object in o) expect_true(check_whole(object, "x"))
})
