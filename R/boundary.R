# Boundary conditions: which columns they are, how the engine takes them, and what they are called.

#' A boundary condition by a label and a unit
#'
#' What people read (sentences, tables, figures, the report) shows the label and the unit. Results
#' that programs read keep the name of the column.
#'
#' @param label What the condition is, in a few words: `"sun from the south"`.
#' @param unit Its unit: `"W/m2"`.
#' @param circular Whether it is a direction in degrees, which enters as sine and cosine.
#' @return An object of class `amiss_condition`, for the list `boundary` of [measurements()].
#' @examples
#' table <- data.frame(hour = 1:48, Ti = 20 + sin(1:48 / 4), Te = 5 + 3 * sin(1:48 / 4))
#' measurements(table, time = "hour", target = "Ti", noise_sd = 0.1, unit = "degC",
#'              boundary = list(Te = condition("outdoor air", "degC")))
#' @export
condition <- function(label, unit = "", circular = FALSE) {
  check_input(checkmate::check_string(label, min.chars = 1), "label",
              "Say in a few words what the condition is.")
  check_input(checkmate::check_string(unit), "unit")
  check_input(checkmate::check_flag(circular), "circular")
  structure(list(label = label, unit = unit, circular = circular), class = "amiss_condition")
}

#' @export
print.amiss_condition <- function(x, ...) on_stdout(x, {
  cli::cli_text(paste("{.strong Boundary condition} {.val {x$label}}",
                      "{if (nzchar(x$unit)) paste0('in ', x$unit)}"))
  cli::cli_bullets(c(">" = "next: {.arg boundary} of {.fun measurements}"))
})

#' @rdname measurements
#' @param x,... Used in a formula only: `circular(Wd)` marks a quantity in degrees.
#' @export
circular <- function(x, ...) x

# Data frame: name, circular, label and unit of the boundary conditions that were asked for.
boundary_terms <- function(boundary, call = rlang::caller_env()) {
  if (is.list(boundary)) return(listed_terms(boundary, call))
  labels <- if (inherits(boundary, "formula")) formula_labels(boundary, call) else boundary
  check_input(checkmate::check_character(labels, min.len = 1, any.missing = FALSE, unique = TRUE),
              "boundary", "Give a formula such as {.code ~ Te + circular(Wd)}.", call = call)
  is_circular <- grepl("^circular\\(.*\\)$", labels)
  names <- trimws(sub("^circular\\((.*)\\)$", "\\1", labels))
  if (inherits(boundary, "formula")) {
    computed <- names[grepl("[^`]", gsub("`[^`]*`", "", names)) & !names == make.names(names)]
    if (length(computed)) {
      abort_input(
        c("{.arg boundary} names columns of the data; {.code {computed[1]}} is computed from them.",
          i = "Make it a column first. Only {.code circular()} marks a column, of degrees."),
        call = call)
    }
    names <- gsub("^`|`$", "", names)
  }
  data.frame(name = names, circular = is_circular, label = names, unit = rep("", length(names)))
}

# Of a list whose elements are condition()s under the names of their columns, or names.
listed_terms <- function(boundary, call) {
  is_named <- nzchar(rlang::names2(boundary))
  is_known <- vapply(boundary, inherits, NA, "amiss_condition")
  if (!length(boundary) || any(is_named != is_known)) {
    abort_input(c("{.arg boundary} is a list of conditions under the names of their columns.",
                  i = paste("For example {.code list(Te = condition(\"outdoor air\", \"degC\"),",
                            "\"Gv\")}.")), call = call)
  }
  rows <- Map(function(one, name) {
    if (!inherits(one, "amiss_condition")) return(boundary_terms(one, call))
    check_whole(one, "boundary", call = call)
    data.frame(name, circular = one$circular, label = one$label, unit = one$unit)
  }, boundary, rlang::names2(boundary))
  terms <- do.call(rbind, unname(rows))
  for (what in c("name", "label")) {
    twice <- terms[[what]][duplicated(terms[[what]])]
    if (length(twice)) {
      abort_input("Two conditions in {.arg boundary} have the {what} {.val {twice[1]}}.",
                  call = call)
    }
  }
  terms
}

# The terms of a formula with one side. One that R cannot take apart, as with a dot, names no
# columns.
formula_labels <- function(boundary, call) {
  terms <- tryCatch(stats::terms(boundary), error = function(e) NULL)
  if (is.null(terms) || attr(terms, "response") || !is.null(attr(terms, "offset"))) {
    abort_input(c(paste("{.arg boundary} = {.code {deparse1(boundary)}} does not name columns of",
                        "the data."), i = "Give a formula such as {.code ~ Te + circular(Wd)}."),
                call = call)
  }
  attr(terms, "term.labels")
}

boundary_columns <- function(drivers, terms) {
  columns <- lapply(seq_along(terms$name), function(i) {
    v <- drivers[, terms$name[i]]
    if (!terms$circular[i]) return(matrix(v, ncol = 1))
    cbind(sin(v * pi / 180), cos(v * pi / 180))
  })
  list(values = do.call(cbind, columns), names = terms$name,
       condition = rep(seq_along(columns), vapply(columns, ncol, 1L)))
}

constant_conditions <- function(x, rows) {
  spread <- apply(x$values[rows, , drop = FALSE], 2, function(v) diff(range(v)))
  # Beside the rounding of values as large as the condition has anywhere.
  size <- tapply(apply(abs(x$values), 2, max), x$condition, max)[x$condition]
  x$names[!tapply(spread > 1e-9 * size, x$condition, any)]
}

x_keep <- function(x, names, call = rlang::caller_env()) {
  if (!length(names))
    abort_input("No boundary condition varies; there is nothing to attribute a discrepancy to.",
                call = call)
  columns <- x$names[x$condition] %in% names
  list(values = x$values[, columns, drop = FALSE], names = names,
       condition = match(x$names[x$condition][columns], names))
}

condition_values <- function(measurements, name) {
  columns <- measurements$boundary[, measurements$condition == match(name, measurements$conditions),
                                   drop = FALSE]
  if (ncol(columns) == 1) columns[, 1] else (atan2(columns[, 1], columns[, 2]) * 180 / pi) %% 360
}

# ---- what they are called

# Labels of boundary conditions, of a record or of several; of those without one the name.
condition_label <- function(measurements, names) {
  told_condition(record_labels(measurements), names)
}

record_labels <- function(measurements) {
  unlist(lapply(unname(each_record(measurements)), function(m) {
    c(m$labels, if (!is.null(m[["label"]])) stats::setNames(m[["label"]], m$target))
  }))
}

target_label <- function(measurements) measurements[["label"]] %||% measurements$target

told_condition <- function(labels, names) {
  at <- match(names, names(labels))
  unname(ifelse(is.na(at), names, labels[at]))
}

# The same with units.
condition_titles <- function(measurements, names = measurements$conditions) {
  units <- unlist(lapply(unname(each_record(measurements)), `[[`, "units"))
  at <- match(names, names(units))
  axis_label(condition_label(measurements, names), ifelse(is.na(at), "", units[at]))
}
