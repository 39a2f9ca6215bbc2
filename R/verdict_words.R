# What is wrong with a value, in plain words: checkmate's sentences name its own types, and R's
# classes.

# What each check asks for.
wanted_words <- c(
  check_string = "one string", check_number = "one number", check_count = "one whole number",
  check_int = "one whole number", check_flag = "TRUE or FALSE", check_scalar = "one value",
  check_numeric = "numbers", check_character = "strings", check_logical = "TRUE or FALSE values",
  check_integerish = "whole numbers", check_list = "a list", check_data_frame = "a data frame",
  check_matrix = "a matrix of numbers", check_function = "a function", check_choice = "one string",
  check_subset = "strings")

# What the package's objects are, and what makes them.
class_words <- list(
  amiss_prior = c("a prior", "uniform(), normal() or another function of ?prior"),
  amiss_free = c("a free parameter", "free()"),
  amiss_measurements = c("a record", "measurements()"),
  amiss_mechanism = c("a mechanism", "mechanism()"),
  amiss_catalogue = c("a catalogue", "catalogue()"),
  amiss_function_simulator = c("a simulator", "function_simulator()"),
  amiss_program_simulator = c("a simulator", "program_simulator()"),
  amiss_fmu_simulator = c("a simulator", "fmu_simulator()"),
  amiss_zone = c("a zone", "zone()"),
  amiss_component = c("a component", "zone_wall() and the like"),
  amiss_network = c("a network", "network()"),
  amiss_network_part = c("a part of a network", "network_node() and the like"),
  amiss_ensemble = c("an ensemble of runs", "simulate_design() or ensemble()"),
  amiss_emulator = c("an emulator", "train_emulator()"),
  amiss_calibration = c("a calibration", "calibrate()"),
  amiss_paper_calibration = c("a calibration", "calibrate_paper()"),
  amiss_fit = c("a calibration", "calibrate()"),
  amiss_joint = c("a joint calibration", "calibrate_jointly()"),
  amiss_upgrade = c("an upgrade", "upgrade_model()"),
  amiss_comparison = c("a comparison", "compare_models()"),
  amiss_survey = c("a survey", "survey()"),
  amiss_attribution = c("an attribution", "attribute_discrepancy()"),
  amiss_discrepancy = c("a discrepancy", "discrepancy()"))

class_phrase <- function(class) {
  words <- class_words[[class]]
  if (is.null(words)) paste0("of class '", class, "'") else paste(words[1], "made by", words[2])
}

# What a value is, of any kind; a single one is shown.
got_words <- function(x) {
  known <- intersect(class(x), names(class_words))
  if (length(known)) return(class_words[[known[1]]][1])
  if (is.null(x)) return("NULL")
  if (is.function(x)) return("a function")
  if (is.data.frame(x)) return("a data frame")
  if (is.object(x)) return(paste0("an object of class '", class(x)[1], "'"))
  if (is.array(x)) return(if (is.matrix(x)) "a matrix" else "an array")
  if (is.list(x)) return("a list")
  if (!is.atomic(x)) return("R code")
  kind <- if (is.character(x)) "string" else if (is.numeric(x)) "number" else "value"
  if (length(x) != 1) paste0(length(x), " ", kind, "s")
  else if (is.na(x) || kind == "value") seen(x)
  else paste("the", kind, seen(x))
}

wrong_kind <- function(m, x, wanted)
  paste0(" must be ", wanted, if (any(grepl("(or 'NULL')", m, fixed = TRUE))) " or NULL", "; got ",
         got_words(x), ".")

# Checks of one value say no number of the element.
outside_limit <- function(m, x, wanted) {
  which <- if (nzchar(m[2])) as.integer(m[2]) else 1
  least <- m[3] == ">="
  limit <- if (least && as.numeric(m[4]) < 1e-300 && as.numeric(m[4]) > 0) "above 0"
           else paste(m[4], if (least) "or more" else "or less")
  if (length(x) == 1) paste0(" is ", seen(x), "; it must be ", limit, ".")
  else paste0(" has ", seen(x[which]), " as number ", which, "; each must be ", limit, ".")
}

in_set <- function(m, x, wanted) paste0(" must be ", listed(quoted_set(m[2]), "or"), "; got ",
                                        got_words(x), ".")

quoted_set <- function(text) gsub("'", "\"", strsplit(text, "(?<='),(?=')", perl = TRUE)[[1]])

# Patterns of checkmate's sentences, and what is said instead: of what the pattern matched, `m`, the
# value `x` and what the check wants.
verdict_rules <- list(
  "^Must inherit from class ([^,]+), but.*" = function(m, x, wanted) {
    classes <- strsplit(gsub("'", "", m[2]), "/", fixed = TRUE)[[1]]
    wrong_kind(m, x, listed(unique(vapply(classes, class_phrase, "")), "or"))
  },
  "^Must be of type 'integerish', but element ([0-9]+) .*" = function(m, x, wanted)
    paste0(" must be whole numbers; number ", m[2], " is ", seen(x[[as.integer(m[2])]]), "."),
  # Whole, but larger than R's integers.
  "^Must be of type '(?:count|single integerish value)'.*" = function(m, x, wanted)
    if (is.numeric(x) && length(x) == 1 && isTRUE(x == round(x)))
      paste0(" is ", seen(x), "; it must be one whole number, at most 2147483647 in size.")
    else wrong_kind(m, x, wanted),
  "^Must be (of type|a function).*|^Must have length 1$|^Must store numerics$" = wrong_kind,
  "^May not be (NA|NaN)$|^Must be a plain number.*" = wrong_kind,
  "^Must be finite$" = function(m, x, wanted)
    if (length(x) == 1) paste0(" is ", seen(x), "; it must be finite.")
    else paste0(" must be finite; number ", which(is.infinite(x))[1], " is not."),
  "^(?:Element ([0-9]+) is not|Must be) ([<>]=) (.+)$" = outside_limit,
  "^Must be element of set \\{(.*)\\}, .*" = in_set,
  "^Must be a subset of \\{(.*)\\}, but has additional elements \\{(.*)\\}$" =
    function(m, x, wanted) paste0(" has ", listed(quoted_set(m[3])), "; it may have ",
                                  listed(quoted_set(m[2]), "or"), "."),
  "^Must be a subset of \\{(.*)\\}, .*" = in_set,
  "^All elements must have at least 1 characters, but element ([0-9]+) .*" =
    function(m, x, wanted) if (length(x) == 1) " must not be empty."
                           else paste0(" has an empty string as number ", m[2], "."),
  "^Contains missing values \\((?:element )?(.*)\\)$" = function(m, x, wanted)
    paste0(" has a missing value (", if (grepl("row", m[2])) sub("col ", "column ", m[2])
                                      else paste("number", m[2]), ")."),
  "^Contains duplicated values, position ([0-9]+)$" = function(m, x, wanted)
    paste0(" has number ", m[2], ", ", seen(x[[as.integer(m[2])]]), ", twice."),
  "^Must have length (>= |<= )?([0-9]+), but has length ([0-9]+)$" = function(m, x, wanted) {
    some <- c(">= " = "at least ", "<= " = "at most ")[m[2]]
    paste0(" must have ", if (!is.na(some)) some, m[3], if (m[3] == "1") " entry" else " entries",
           "; it has ", m[4], ".")
  },
  "^Must have (at least|exactly) ([0-9]+) (row|col)s, but has ([0-9]+) (?:row|col)s$" =
    function(m, x, wanted) paste0(" must have ", m[2], " ", m[3], " ",
                                  if (m[4] == "row") "row" else "column",
                                  if (m[3] != "1") "s", "; it has ", m[5], "."),
  "^Must have exactly ([0-9]+) formal arguments, but has ([0-9]+)$" = function(m, x, wanted)
    paste0(" must be a function of ", m[2], if (m[2] == "1") " argument" else " arguments",
           "; it has ", m[3], "."),
  "^Must have (?:unique )?(?:col)?names, but element ([0-9]+) is (duplicated|empty)$" =
    function(m, x, wanted) if (m[3] == "empty") paste0(" must have a name for number ", m[2], ".")
                           else paste0(" has the name of number ", m[2], " twice."),
  "^Must have names$" = function(m, x, wanted) " must have a name for each of its entries.",
  "^Names must .* (set|elements) \\{(.*)\\}, but .*" = function(m, x, wanted)
    paste0(" must have the names ", listed(quoted_set(m[3])), "."),
  "^May only contain the following types: \\{(.*)\\}, but element ([0-9]+) .*" =
    function(m, x, wanted) paste0(" must be a list whose entries are each ", class_phrase(m[2]),
                                  "; number ", m[3], " is ", got_words(x[[as.integer(m[3])]]), "."),
  "^File does not exist: .*" = function(m, x, wanted)
    paste0(" = ", seen(x), ": this file does not exist."),
  "^Directory .* does not exist$" = function(m, x, wanted)
    paste0(" = ", seen(x), ": this folder does not exist."),
  "^File expected, but directory .*" = function(m, x, wanted)
    paste0(" = ", seen(x), " must be a file; it is a folder."))

# What is said behind the argument's name, for the verdict of the check `kind` on `x`.
verdict_words <- function(verdict, x, kind) {
  wanted <- if (kind %in% names(wanted_words)) wanted_words[[kind]]
  for (pattern in names(verdict_rules)) {
    m <- regmatches(verdict, regexec(pattern, verdict, perl = TRUE))[[1]]
    if (length(m)) return(verdict_rules[[pattern]](m, x, wanted))
  }
  paste0(value_words(x), " cannot be used: ", verdict)
}
