# What the parts of the package's objects are, so that one that was damaged, faked or edited is
# known from a good one.
#
# A part is written as its kind and, in brackets, its size: numbers, or letters that stand for the
# same number in all of the object. `?` before the kind: it may be absent or NULL. Kinds: text,
# flag, number (NA may be), real (finite), estimate (NA, but not NaN), numbers (a list of single
# ones), values (any vector), list, table, function, any, a class, `:shape`, which shares the
# letters of what it is part of, and `each:shape` or `some:shape`, a list of these, of one at least.
# The name `*` stands for the object itself.

object_shapes <- list(
  amiss_prior = c(family = "text[1]", parameters = "numbers", lower = "number[1]",
                  upper = "number[1]"),
  amiss_free = c(name = "text[1]", prior = "amiss_prior", unit = "text[1]", label = "text[1]"),
  amiss_component = c(type = "text[1]", name = "text[1]"),
  amiss_zone = c(components = "each:amiss_component"),
  amiss_mechanism = c(name = "text[1]", edit = "function|amiss_ensemble", boundary = "text",
                      sentence = "text[1]"),
  amiss_catalogue = c("*" = "each:amiss_mechanism"),
  amiss_function_simulator = c(name = "text[1]", f = "function", parameters = "some:amiss_free",
                               boundary = "text"),
  amiss_program_simulator = c(name = "text[1]", command = "any", parameters = "some:amiss_free",
                              boundary = "text", output = "any", templates = "list",
                              drivers = "any", lead_in = "real[1]", files = "?table"),
  amiss_fmu_simulator = c(name = "text[1]", file = "text[1]", hash = "text[1]",
                          parameters = "some:amiss_free", inputs = "text", fixed = "list",
                          output = "text[1]", averaged = "flag[1]", steps_per_row = "real[1]",
                          time_limit = "real[1]", size_limit = "real[1]", retries = "real[1]",
                          cache = "?text[1]", logging = "flag[1]"),
  amiss_network_part = c(type = "text[1]", name = "text[1]"),
  amiss_network = c(name = "text[1]", components = "some:amiss_network_part", output = "text[1]",
                    before = "list", hold = "flag[1]", interpolation = "text[1]",
                    output_at = "text[1]", start_hours = "real[1]"),
  amiss_measurements = c(
    name = "text[1]", target = "text[1]", unit = "text[1]", label = "?text[1]",
    noise_sd = "real[1]", noise = "list",
    raw = ":raw", per_step = "real[1]", step_h = "real[1]", time = "values[n]", hours = "real[n]",
    segment = "real[n]", use = "text[n]", y = "number[n]", standard_error = "number[n]",
    block = "number", boundary = "number[n,c]", condition = "real[c]", conditions = "text",
    labels = "?text",
    units = "?text", constant = "?text",
    time_format = "?text[1]", time_zone = "?text[1]", stamp = "?text[1]", findings = "?table",
    faulty = "?number", missing = "?number", range = "?number[2]"),
  raw = c(time = "values[m]", hours = "real[m]", step_h = "real[1]", segment = "real[m]",
          use = "text[m]", y = "number[m]", drivers = "number[m,d]"),
  amiss_ensemble = c(parameters = "some:amiss_free[p]", unit = "real[r,p]", values = "real[r,p]",
                     outputs = "real[n,r]", failed = "number[1]", hours = "?number[n]",
                     region = "?list", over_priors = "?amiss_emulator", held_out = "?list"),
  amiss_emulator = c(parameters = "some:amiss_free[p]", basis = ":basis", processes = ":processes",
                     unit = "real[r,p]", spread = "real[q,v]", control = "list", trust = ":trust",
                     noise_sd = "real[1]", target_unit = "?text[1]", diagnostics = "list",
                     selection = "table", left_out = "list", hours = "?number",
                     over_priors = "?amiss_emulator", given = "?amiss_ensemble",
                     moves = "?list"),
  basis = c(vectors = "real[n,q]", singular_values = "real", explained = "real[1]",
            discarded_rms = "real[1]", discarded_ss = "real[1]", discarded_sd = "real[n]"),
  processes = c(inputs = "real[r,p]", coefficients = "real[r,q]", hyperparameters = "number[q,h]",
                region = "?list", trend = "?real[q,z]"),
  check = c(passed = "flag[1]", verdict = "text[1]", ratio = "number[1]",
            mean = "?real[n]"),
  trust = c(trusted = "flag[1]", why = "?text", verdict = "text[1]"),
  amiss_fit = c(emulator = "amiss_emulator", measurements = "amiss_measurements", control = "list",
                rows = "real[n]", priors = "list", values = "values[k,u]", weights = "real[k]",
                posterior = ":posterior", log_evidence = "estimate[1]",
                standard_error = "estimate[1]", interval = "number[2]", trust = ":trust",
                seed = "number[1]", check = "?:check", best = "?list", failing = "?real[1]"),
  amiss_calibration = c(posterior = ":history_posterior", priors = ":history_priors",
                        control = ":history_control", kept = "real[d]", coefficients = "real[e,d]",
                        withheld = "real[w,d]", withheld_covariance = "real[y,d]",
                        withheld_of_condition = "real[w,c]",
                        centre = "real[e]", scale = "real[e]", reach = "number",
                        tangent = ":tangent"),
  history_posterior = c(unit = "real[k,p]", weights = "real[k]", setting = "real[k]",
                        variance = "number[k]", t = "real[k,c]", trusted = "flag[1]",
                        log_likelihood = "number[k]", log_evidence = "estimate[1]",
                        standard_error = "estimate[1]", ess = "number[1]"),
  history_priors = c(noise_sd = "real[1]", noise_shape = "real[1]", discarded_variance = "real[1]",
                     inclusion = "real[1]", amplitude = "real[1]", correlation_times = "real",
                     ratios = "real", reach = "number"),
  history_control = c(inclusion = "real[1]", amplitude = "real[1]", reach = "number",
                      time_constants = "real", error_times = "real", error_ratios = "real",
                      ais = "list"),
  tangent = c(mean = "real[q]", root = "real[q,v]"),
  amiss_paper_calibration = c(index = "table", evidence = "table", share = "real[s,b]",
                              lambda = "real[k,l]", hyperparameters = "list"),
  posterior = c(unit = "real[k,p]", weights = "real[k]", ess = "number[1]", ladder = "table",
                evaluations = "real[1]"),
  amiss_joint = c(records = "some:amiss_fit", parameters = "some:amiss_free[p]",
                  values = "real[k,p]", weights = "real[k]",
                  posterior = ":posterior", log_evidence = "estimate[1]",
                  standard_error = "estimate[1]", interval = "number[2]", trust = ":trust",
                  check = "?:check", failing = "?real[1]", seed = "number[1]"),
  amiss_upgrade = c(models = "some:model", candidates = "?table", responses = "?table",
                    catalogue = "amiss_catalogue",
                    measurements = "amiss_measurements|amiss_records",
                    gain = ":gain", stopped_because = "text[1]", stopped_id = "text[1]",
                    seed = "number[1]", runs_total = "real[1]", control = "list"),
  gain = c(log10_bf = "number[1]", interval = "number[2]", rmse_calibration = "number[2]",
           rmse_validation = "number[2]", coverage95_validation = "number[2]",
           crps_calibration = "number[2]", crps_validation = "number[2]"),
  model = c(name = "text[1]", fit = "amiss_fit|amiss_joint", prediction = "any", scores = "list"),
  amiss_comparison = c(method = "text[1]", models = "some:compared", tables = ":tables",
                       measurements = "amiss_measurements", control = "list", truth = "?list"),
  tables = c(evidence = "table", criteria = "table", ranking = "?table", attribution = "table",
             parameters = "?table"),
  compared = c(name = "text[1]", fit = "amiss_fit", prediction = "any", scores = "list"),
  amiss_ais = c(log_evidence = "estimate[1]", standard_error = "estimate[1]",
                interval = "number[2]", estimator = "text[1]", ladder = "table",
                trusted = "flag[1]", verdict = "text[1]", weights = "real[k]", draws = "real[k,p]",
                ess = "number[1]", second = "number[2]", annealed = "number[2]"),
  amiss_attribution = c(table = "table", groups = "list", surrogates = "real[1]", control = "list",
                        p_value_own = "?real", labels = "?text"),
  amiss_joint_attribution = c(records = "each:amiss_attribution", table = "table", groups = "list"),
  amiss_discrepancy = c(series = "table", responses = "?real[n,b]", record = "?table",
                        rows = "?real[n]", segment = "real[n]", target = "text[1]",
                        unit = "text[1]"),
  amiss_survey = c(studies = "table", trials = "table", conditions = "table",
                   parameters = "table"),
  amiss_study = c(study = "text[1]", title = "text[1]", measurements = "list", control = "?list"),
  amiss_sobol = c(table = "table", unexplained = "?number[1]", points = "?real[1]",
                  replicates = "?real[1]", by_time = "?any"))

# Objects with a format_version; the others are written by the package's functions in a session, and
# not kept.
versioned_classes <- c("amiss_measurements", "amiss_ensemble", "amiss_emulator", "amiss_fit",
                       "amiss_joint", "amiss_upgrade", "amiss_comparison", "amiss_survey",
                       "amiss_ais", "amiss_attribution", "amiss_joint_attribution",
                       "amiss_discrepancy", "amiss_sobol", "amiss_function_simulator",
                       "amiss_program_simulator", "amiss_fmu_simulator", "amiss_network")

shapes_of <- function(x) intersect(class(x), names(object_shapes))

shape_words <- c(text = "text", flag = "TRUE or FALSE", number = "numbers", real = "finite numbers",
                 estimate = "a number or NA", numbers = "a list of numbers", values = "a vector",
                 list = "a list", table = "a data frame", "function" = "a function",
                 match = "what fits the others")

# What a part should be, in words.
kind_words <- function(kind) {
  if (kind %in% names(shape_words)) return(shape_words[[kind]])
  if (grepl("^(each|some):", kind)) return("a list of what it should hold")
  paste("of class", kind)
}

# What sizes alone do not say.
object_rules <- list(
  amiss_measurements = function(x) all(x$condition %in% seq_along(x$conditions)),
  amiss_fit = function(x) {
    !anyNA(x$measurements$y[x$rows]) && length(x$rows) == nrow(x$emulator$basis$vectors)
  },
  amiss_calibration = function(x) {
    length(x$centre) == length(x$control$time_constants) * ncol(x$measurements$boundary)
  },
  amiss_comparison = function(x) {
    needed <- c("model", "boundary", "significant",
                if (x$method == "paper") c("difference", "lower95", "upper95", "rank")
                else c("log10_bf_dropped", "p_value"))
    all(needed %in% names(x$tables$attribution))
  })

rule_parts <- c(amiss_measurements = "conditions", amiss_fit = "rows",
                amiss_calibration = "coefficients", amiss_comparison = "tables")

# NULL for an object that has all its parts, or list(absent) or list(part, value, expected) of the
# first that is wrong.
object_fault <- function(x, shapes = shapes_of(x), within = "", sizes = new.env()) {
  if (!length(shapes)) return(NULL)
  if (!is.list(x)) return(list(absent = paste0(within, names(object_shapes[[shapes[1]]]))))
  for (shape in shapes) {
    fault <- shape_fault(x, object_shapes[[shape]], sizes, within)
    if (!is.null(fault)) return(fault)
  }
  for (shape in intersect(shapes, names(object_rules))) {
    if (!object_rules[[shape]](x))
      return(list(part = paste0(within, rule_parts[[shape]]), value = x, expected = "match"))
  }
  if (within == "" && any(shapes %in% versioned_classes) && is.null(x[["format_version"]])) {
    list(absent = "format_version")
  }
}

shape_fault <- function(x, parts, sizes, within) {
  x <- unclass(x)
  absent <- setdiff(names(parts)[!startsWith(parts, "?")], c(names(x), "*"))
  if (length(absent)) return(list(absent = paste0(within, absent)))
  for (name in names(parts)) {
    fault <- part_fault(if (name == "*") x else x[[name]], parts[[name]], sizes,
                        paste0(within, name))
    if (!is.null(fault)) return(fault)
  }
}

part_fault <- function(value, expected, sizes, name) {
  part <- part_read(expected)
  if (part$optional && is.null(value)) return(NULL)
  kind <- part$kind
  if (part$form == "shape") return(object_fault(value, part$shape, paste0(name, "$"), sizes))
  many <- part$form %in% c("each", "some")
  right <- if (many) is.list(value) && (length(value) || part$form == "each")
           else is_kind(value, kind)
  if (!right || !has_size(value, part$size, sizes))
    return(list(part = name, value = value, expected = kind))
  if (many) return(each_fault(value, part$shape, name))
  if (part$form == "class") object_fault(value, shapes_of(value), paste0(name, "$"))
}

# A part as it is written above, read: whether it is optional, its kind, what is of this shape, and
# its size. Each is read once in a session.
part_read <- function(expected) {
  known <- parts_read[[expected]]
  if (!is.null(known)) return(known)
  written <- sub("^[?]", "", expected)
  kind <- sub("\\[.*", "", written)
  form <- if (startsWith(kind, "amiss_")) "class" else if (!grepl(":", kind)) "plain"
          else if (startsWith(kind, ":")) "shape" else sub(":.*", "", kind)
  size <- gsub("^[^[]*|[][]", "", written)
  part <- list(optional = startsWith(expected, "?"), kind = kind, form = form,
               shape = sub(".*:", "", kind), size = strsplit(size, ",", fixed = TRUE)[[1]])
  parts_read[[expected]] <- part
  part
}

parts_read <- new.env(parent = emptyenv())

each_fault <- function(values, shape, name) {
  for (i in seq_along(values)) {
    within <- sprintf("%s[[%d]]", name, i)
    one <- values[[i]]
    of_class <- startsWith(shape, "amiss_")
    if (of_class && !inherits(one, shape))
      return(list(part = within, value = one, expected = shape))
    fault <- object_fault(one, if (of_class) shapes_of(one) else shape, paste0(within, "$"))
    if (!is.null(fault)) return(fault)
  }
}

is_kind <- function(value, kind) {
  number <- function() is.numeric(value) && !is.object(value)
  switch(kind, any = TRUE, text = is.character(value) && !anyNA(value) && all(validEnc(value)),
         flag = is.logical(value),
         number = number() || is.logical(value) && all(is.na(value)),
         real = number() && all(is.finite(value)),
         estimate = is.double(value) && !any(is.nan(value)),
         numbers = is.list(value) && all(vapply(value, is_kind, NA, "real") & lengths(value) == 1),
         values = is.atomic(value) && !is.null(value), list = is.list(value),
         table = is.data.frame(value), "function" = is.function(value),
         inherits(value, strsplit(kind, "|", fixed = TRUE)[[1]]))
}

# `size` as c("n", "2"). A letter is bound by the first part that has it.
has_size <- function(value, size, sizes) {
  if (!length(size)) return(TRUE)
  own <- if (length(size) > 1) dim(value) else length(value)
  if (length(own) != length(size)) return(FALSE)
  for (i in seq_along(size)) {
    wanted <- if (grepl("^[0-9]", size[i])) as.integer(size[i]) else sizes[[size[i]]]
    if (is.null(wanted)) sizes[[size[i]]] <- own[i]
    else if (own[i] != wanted) return(FALSE)
  }
  TRUE
}
