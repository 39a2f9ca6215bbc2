# What an FMU says of itself in its modelDescription.xml (FMI 2.0.4, section 2.2; FMI 3.0.1, section
# 2.4). Reading it runs nothing of the FMU.

#' Variables of an FMU
#'
#' What can be declared in [fmu_simulator()]. Reading the description runs nothing of the FMU.
#'
#' @param file Path of the FMU: FMI 2.0 or 3.0, for co-simulation.
#' @return A data frame with a row for each variable: `name`, `causality`, `variability`, `type`,
#'   `unit`, `start` (as text), `min`, `max`, `description`, and its `use` in [fmu_simulator()]:
#'   `"parameter"` (by [free()] or `fixed`), `"input"`, `"output"`, several of them, or `""` for
#'   none. A state whose start the FMU lets be set can be declared like a parameter, too.
#' @section Errors: `amiss_error_fmu` (and `amiss_error_input`) for a file that is no FMU, is
#'   damaged or unsafe to unpack, or has no co-simulation.
#' @examplesIf requireNamespace("xml2", quietly = TRUE) && nzchar(Sys.which("make"))
#' source(system.file("examples", "fmu", "build.R", package = "amiss"))
#' house <- build_house(tempfile(fileext = ".fmu"))  # yours is exported by your tool
#' fmu_variables(house)[c("name", "unit", "start", "use")]
#' @export
fmu_variables <- function(file) {
  check_arguments()
  check_input(checkmate::check_string(file, min.chars = 1), "file")
  variables <- read_fmu(file)$variables
  uses <- vapply(fmu_uses, function(use) has_use(variables, use), logical(nrow(variables)))
  uses <- matrix(uses, ncol = length(fmu_uses))
  variables$use <- apply(uses, 1, function(has) paste(fmu_uses[has], collapse = ", "))
  variables[c("name", "causality", "variability", "type", "unit", "start", "min", "max",
              "description", "use")]
}

fmu_uses <- c("parameter", "input", "output")

# Whether each variable can be a parameter, an input, an output or fixed; the start of a state is a
# parameter, too.
has_use <- function(v, use) {
  plain <- !is.na(v$code) & !v$array
  own <- v$causality %in% c("output", "local")
  start <- own & v$initial %in% c("exact", "approx") & v$variability == "continuous"
  parameter <- plain & v$variability != "constant" & (v$causality == "parameter" | start)
  input <- plain & v$causality == "input"
  switch(use, parameter = parameter, input = input & v$type != "String",
         output = plain & own & v$type != "String", fixed = parameter | input)
}

known_fmus <- new.env(parent = emptyenv())

# The description of a file, read once in a session as long as the file stays as it is: list(file,
# hash, version, model, identifier, token, once, fixed_step, variables, platforms).
read_fmu <- function(file, call = rlang::caller_env()) {
  if (!requireNamespace("xml2", quietly = TRUE)) {
    abort_input(c("The package {.pkg xml2} is needed to read the description of an FMU.",
                  i = "Install it by {.code install.packages(\"xml2\")}."), call = call)
  }
  if (!is_regular_file(file)) refuse_fmu(file, "There is no such file.", call)
  path <- normalizePath(file)
  seen <- paste(file.size(path), as.numeric(file.mtime(path)))
  known <- known_fmus[[path]]
  if (!identical(known$seen, seen)) {
    known <- list(seen = seen, fmu = described_fmu(path, call))
    known_fmus[[path]] <- known
  }
  known$fmu
}

described_fmu <- function(path, call) {
  entries <- fmu_entries(path, call)
  root <- description_root(fmu_part(path, fmu_description_name, fmu_most_text, entries, call),
                           path, call)
  version <- fmu_version(root, path, call)
  mode <- xml2::xml_find_first(root, "./CoSimulation")
  if (inherits(mode, "xml_missing")) refuse_modes(root, path, call)
  text <- function(name) xml2::xml_attr(mode, name)
  identifier <- text("modelIdentifier")
  if (is.na(identifier) || !grepl("^[A-Za-z_][A-Za-z0-9_]*$", identifier)) {
    refuse_fmu(path, "The name of its library, {.val {identifier}}, is no identifier.", call)
  }
  binaries <- grep("^binaries/[^/]+/[^/]+$", entries$name, value = TRUE)
  own <- tools::file_path_sans_ext(basename(binaries)) == identifier
  list(file = path, hash = unname(tools::md5sum(path)), version = version,
       model = or_empty(xml2::xml_attr(root, "modelName")), identifier = identifier,
       token = or_empty(xml2::xml_attr(root, if (version == 2) "guid" else "instantiationToken")),
       once = text("canBeInstantiatedOnlyOncePerProcess") %in% c("true", "1"),
       fixed_step = if (!text("canHandleVariableCommunicationStepSize") %in% c("true", "1"))
                      as_number(text("fixedInternalStepSize"))
                    else NA_real_,
       variables = described_variables(root, version, path, call),
       platforms = unique(basename(dirname(binaries[own]))))
}

# The XML of strangers: without a document type there are no entities to expand, and nothing is
# fetched.
description_root <- function(bytes, path, call) {
  refuse <- function(why) refuse_fmu(path, "Its {.file {fmu_description_name}} {why}", call)
  encoding <- "<[?]xml[^>]*encoding *= *[\"'](utf-8|us-ascii|iso-8859-1|windows-1252)[\"']"
  if (any(bytes == as.raw(0))) refuse("is not UTF-8.")
  head <- rawToChar(utils::head(bytes, 1000))
  named <- grepl("encoding *=", sub("[?]>.*", "", head, useBytes = TRUE), useBytes = TRUE)
  if (named && !grepl(encoding, head, ignore.case = TRUE, useBytes = TRUE)) refuse("is not UTF-8.")
  if (length(grepRaw("<!(DOCTYPE|ENTITY)", bytes, ignore.case = TRUE)))
    refuse("declares a document type.")
  document <- tryCatch(xml2::read_xml(bytes, options = c("NONET", "NOBLANKS")),
                       error = function(e) {
                         refuse(paste("is no XML:", shown_name(conditionMessage(e))))
                       })
  root <- xml2::xml_root(document)
  if (xml2::xml_name(root) != "fmiModelDescription") refuse("is no description of a model.")
  root
}

fmu_version <- function(root, path, call) {
  version <- xml2::xml_attr(root, "fmiVersion")
  if (grepl("^[23][.]0([.][0-9]+)?$", version)) return(as.integer(substr(version, 1, 1)))
  refuse_fmu(path, "It is of FMI {.val {version}}.", call,
             "Export it again as FMI 2.0 or 3.0, for co-simulation.")
}

refuse_modes <- function(root, path, call) {
  only <- intersect(c("ModelExchange", "ScheduledExecution"),
                    xml2::xml_name(xml2::xml_children(root)))
  words <- c(ModelExchange = "model exchange", ScheduledExecution = "scheduled execution")[only]
  refuse_fmu(path, if (length(only)) "It has {words} only, which brings no solver of its own."
                   else "It has no co-simulation.",
             call, paste("Export it for co-simulation: in Modelica tools the FMU type {.val cs}",
                         "(or {.val me_cs}), in Simulink {.val CS}."))
}

# ---- variables

# Types that the functions of an FMU know, in the order of the engine's; others, such as Binary and
# Clock, are none.
fmu_types <- c("Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64",
               "UInt64", "Boolean", "String")

fmu_type_codes <- function(type, version) {
  known <- if (version == 2) c(Real = "Float64", Integer = "Int32", Enumeration = "Int32",
                               Boolean = "Boolean", String = "String")
           else c(stats::setNames(nm = fmu_types), Enumeration = "Int64")
  match(known[type], fmu_types) - 1L
}

or_empty <- function(x) ifelse(is.na(x), "", x)

as_number <- function(x)
  suppressWarnings(as.numeric(ifelse(x %in% c("true", "false"), x == "true", x)))

# Data frame: name, reference, type, code (of the type, NA for those that cannot be used),
# causality, variability, initial, unit, start, min, max, description, array.
described_variables <- function(root, version, path, call) {
  nodes <- xml2::xml_find_all(root, "./ModelVariables/*")
  if (!length(nodes)) refuse_fmu(path, "It has no variables.", call)
  typed <- if (version == 2)
             xml2::xml_find_all(root, paste0("./ModelVariables/ScalarVariable/*[self::Real or ",
                                             "self::Integer or self::Boolean or self::String or ",
                                             "self::Enumeration]"))
           else nodes
  reference <- as_number(xml2::xml_attr(nodes, "valueReference"))
  name <- xml2::xml_attr(nodes, "name")
  if (length(typed) != length(nodes) || anyNA(name) || anyNA(reference) ||
      any(reference < 0 | reference >= 2^32)) {
    refuse_fmu(path, paste("Its {.file {fmu_description_name}} describes a variable without a",
                           "name, reference or type."), call)
  }
  type <- xml2::xml_name(typed)
  declared <- declared_types(root, version)[xml2::xml_attr(typed, "declaredType"), , drop = FALSE]
  detail <- function(name) {
    own <- xml2::xml_attr(typed, name)
    ifelse(is.na(own), declared[[name]] %||% NA, own)
  }
  causality <- xml2::xml_attr(nodes, "causality")
  causality[is.na(causality)] <- "local"
  variability <- xml2::xml_attr(nodes, "variability")
  variability <- ifelse(is.na(variability), default_variability(causality, type), variability)
  variables <- data.frame(
    name = name, reference = reference, type = type, code = fmu_type_codes(type, version),
    causality = causality, variability = variability, initial = xml2::xml_attr(nodes, "initial"),
    unit = or_empty(detail("unit")), start = xml2::xml_attr(typed, "start"),
    min = as_number(detail("min")), max = as_number(detail("max")),
    description = or_empty(xml2::xml_attr(nodes, "description")),
    array = nodes_with(nodes, "Dimension", version))
  with_aliases(variables, nodes, version)
}

default_variability <- function(causality, type) {
  ifelse(causality %in% c("parameter", "calculatedParameter", "structuralParameter"), "fixed",
         ifelse(type %in% c("Real", "Float64", "Float32"), "continuous", "discrete"))
}

# Whether each node has children of a name, which variables of FMI 2.0 do not have.
nodes_with <- function(nodes, child, version) {
  none <- version == 2 || !length(xml2::xml_find_first(nodes[[1]], paste0("../*/", child)))
  if (none) return(rep(FALSE, length(nodes)))
  xml2::xml_find_lgl(nodes, paste0("boolean(./", child, ")"))
}

# Other names of a variable, each a row of its own (FMI 3.0).
with_aliases <- function(variables, nodes, version) {
  rows <- which(nodes_with(nodes, "Alias", version))
  names <- lapply(rows,
                  function(row) xml2::xml_attr(xml2::xml_find_all(nodes[[row]], "./Alias"), "name"))
  others <- variables[rep(rows, lengths(names)), ]
  others$name <- as.character(unlist(names))
  others <- others[!is.na(others$name), ]
  variables <- rbind(variables, others)
  rownames(variables) <- NULL
  variables[!duplicated(variables$name), ]
}

# Data frame of unit, min and max of declared types, by their names.
declared_types <- function(root, version) {
  nodes <- xml2::xml_find_all(
    root, if (version == 2) "./TypeDefinitions/SimpleType[*]" else "./TypeDefinitions/*")
  details <- if (version == 2) xml2::xml_find_first(nodes, "./*") else nodes
  types <- data.frame(unit = xml2::xml_attr(details, "unit"), min = xml2::xml_attr(details, "min"),
                      max = xml2::xml_attr(details, "max"))
  name <- xml2::xml_attr(nodes, "name")
  keep <- !is.na(name) & !duplicated(name)
  types <- types[keep, ]
  rownames(types) <- name[keep]
  types
}

# ---- the library for this platform

# Folders of `binaries` that this session can load from, in the order of preference.
own_platforms <- function(version) {
  arch <- c(`x86-64` = "x86_64", arm64 = "aarch64", i386 = "x86", i686 = "x86")
  arch <- if (R.version$arch %in% names(arch)) arch[[R.version$arch]] else R.version$arch
  system <- switch(Sys.info()[["sysname"]], Darwin = "darwin", Windows = "windows", "linux")
  tuple <- paste0(arch, "-", system)
  if (version == 3) return(tuple)
  short <- paste0(sub("windows", "win", system), 8 * .Machine$sizeof.pointer)
  # FMI 2.0 has names for Intel's processors only.
  if (arch == "aarch64" && system != "darwin") tuple else c(short, tuple)
}

fmu_platform <- function(fmu, call = rlang::caller_env()) {
  wanted <- own_platforms(fmu$version)
  there <- intersect(wanted, fmu$platforms)
  if (length(there)) return(there[1])
  refuse_fmu(fmu$file, "It has no library for this platform, {.val {wanted}}.", call,
             if (length(fmu$platforms))
               "It has those for {.val {fmu$platforms}}: export it for this one, too."
             else "It has none for any: export it with binaries, not as sources only.")
}
