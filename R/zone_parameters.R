# The free parameters of a zone: where they stand, and what has their place in a run.

#' @export
Ops.amiss_free <- function(e1, e2) scale_free(.Generic, e1, e2)

#' @export
Ops.amiss_scaled_free <- function(e1, e2) scale_free(.Generic, e1, e2)

scale_free <- function(operator, e1, e2) {
  left <- is_free(e1)
  parameter <- if (left) e1 else e2
  number <- if (left) e2 else e1
  allowed <- operator == "*" || operator == "/" && left
  if (!allowed || !checkmate::test_number(number, finite = TRUE) || number == 0) {
    abort_input(
      c("A free parameter can only be multiplied or divided by a number that is not zero.",
        i = paste("It serves to change units:",
                  "{.code free(\"crack\", uniform(700, 1300), \"mm2\") * 1e-6}.")))
  }
  factor <- if (operator == "*") number else 1 / number
  if (inherits(parameter, "amiss_scaled_free")) {
    parameter$factor <- parameter$factor * factor
    return(parameter)
  }
  structure(list(free = parameter, factor = factor), class = "amiss_scaled_free")
}

#' @export
format.amiss_scaled_free <- function(x, ...) paste(format(x$free), "*", format(x$factor))

#' @export
print.amiss_scaled_free <- function(x, ...) {
  cat(format(x), "\n", sep = "")
  invisible(x)
}

# Where the free parameters stand in a nested description, in order: each with its path, and the
# factor that scales it.
free_fields <- function(x, path = integer()) {
  if (is_free(x)) {
    scaled <- inherits(x, "amiss_scaled_free")
    return(list(list(path = path, free = if (scaled) x$free else x,
                     factor = if (scaled) x$factor else 1)))
  }
  if (!is.list(x)) return(list())
  do.call(c, lapply(seq_along(x), function(i) free_fields(x[[i]], c(path, i))))
}

# Values of the fields at each row of parameter values: runs x fields.
field_values <- function(fields, values) {
  columns <- lapply(fields, function(field) field$factor * values[, field$free$name])
  matrix(as.numeric(unlist(columns)), nrow(values), length(fields))
}

fill_free <- function(x, fields, values) {
  for (field in fields) x[[field$path]] <- field$factor * values[[field$free$name]]
  x
}

#' What a zone needs
#'
#' @param zone A [zone()].
#' @param values Named numeric vector: a value for every free parameter.
#' @return `zone_parameters()`: a named list of the free parameters, each once. `zone_boundary()`:
#'   the names of the columns of data that the zone uses. `zone_resolve()`: the zone with numbers in
#'   place of free parameters.
#' @examples
#' box <- paper_box("M2")
#' names(zone_parameters(box))
#' zone_boundary(box)
#' zone_resolve(box, c(outer_k = 1.05, outer_c = 3361, insulation_k = 0.048, insulation_c = 179,
#'                     heater_radiant = 0.79))
#' @export
zone_parameters <- function(zone) {
  check_zone(zone)
  collect_parameters(free_fields(unclass(zone)))
}

# The parameters of free fields, each once, under their names.
collect_parameters <- function(fields, call = rlang::caller_env()) {
  found <- list()
  for (field in fields) {
    x <- field$free
    known <- found[[x$name]]
    if (!is.null(known) && !identical(known$prior, x$prior)) {
      abort_input(c("The free parameter {.val {x$name}} stands with two different priors:",
                    "*" = "{format(known$prior)}", "*" = "{format(x$prior)}",
                    i = "Use one prior, or two names."), call = call)
    }
    if (is.null(known)) found[[x$name]] <- x
  }
  found
}

#' @rdname zone_parameters
#' @export
zone_boundary <- function(zone) {
  check_zone(zone)
  columns <- lapply(unname(zone$components),
                    function(x) unlist(x[column_fields(x)], use.names = FALSE))
  unique(as.character(unlist(columns)))
}

#' @rdname zone_parameters
#' @export
zone_resolve <- function(zone, values = numeric()) {
  parameters <- names(zone_parameters(zone))
  check_input(checkmate::check_numeric(values, any.missing = FALSE, finite = TRUE), "values")
  check_values(names(values), parameters, rlang::current_env())
  resolve_zone(zone, free_fields(unclass(zone)), values, rlang::current_env())
}

check_values <- function(given, parameters, call) {
  absent <- setdiff(parameters, given)
  if (length(absent) > 0) {
    abort_input(c("{.arg values} has no value for {.val {absent}}.",
                  i = "The zone's free parameters: {.val {parameters}}."), call = call)
  }
}

# `fields`: the free ones; components without any were checked when they were made.
resolve_zone <- function(zone, fields, values, call) {
  resolved <- fill_free(zone, fields, values)
  at <- match("components", names(zone))
  paths <- Filter(function(path) path[1] == at, lapply(fields, `[[`, "path"))
  for (i in unique(vapply(paths, `[[`, 0L, 2L))) check_component(resolved$components[[i]], call)
  check_fields(resolved, zone_fields$zone, "zone", call)
}
