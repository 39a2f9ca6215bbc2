# Results as people read them: boundary conditions under their labels. What programs read keeps the
# names of columns.

labelled <- function(x) {
  several <- each_record(x$measurements)
  if (!length(unlist(lapply(unname(several), `[[`, "labels")))) return(x)
  told <- function(names) condition_label(x$measurements, names)
  x$models <- lapply(x$models, labelled_model, told)
  x$catalogue[] <- lapply(unclass(x$catalogue), labelled_entry, told)
  x$named_cause <- labelled_entry(x$named_cause, told)
  if (!is.null(x$responses)) x$responses$condition <- told(x$responses$condition)
  # Only a comparison has it.
  if (!is.null(x$tables$attribution))
    x$tables$attribution <- labelled_conditions(x$tables$attribution, told)
  x$measurements <- labelled_measurements(x$measurements, told)
  x
}

labelled_model <- function(model, told) {
  model$attribution <- labelled_attribution(model$attribution, told)
  model$fit <- labelled_fit(model$fit, told)
  model$records <- lapply(model$records, labelled_model, told)
  model
}

labelled_fit <- function(fit, told) {
  if (is.null(fit)) return(NULL)
  if (!is.null(fit$measurements)) fit$measurements <- labelled_measurements(fit$measurements, told)
  fit$records <- lapply(fit$records, labelled_fit, told)
  fit
}

labelled_measurements <- function(measurements, told) {
  if (is_several(measurements)) {
    measurements$records <- lapply(measurements$records, labelled_measurements, told)
  } else {
    # Under both: columns of drivers keep their names.
    for (field in c("labels", "units")) {
      known <- measurements[[field]]
      again <- stats::setNames(known, told(names(known)))
      measurements[[field]] <- c(known, again[setdiff(names(again), names(known))])
    }
    if (length(measurements$constant)) measurements$constant <- told(measurements$constant)
    if (NROW(measurements$findings))
      measurements$findings$column <- told(measurements$findings$column)
  }
  measurements$conditions <- told(measurements$conditions)
  measurements
}

# The attribution of a compared model is a table alone.
labelled_attribution <- function(attribution, told) {
  if (is.null(attribution)) return(NULL)
  if (is.data.frame(attribution)) return(labelled_conditions(attribution, told))
  table <- attribution$table
  table$boundary <- told(table$boundary)
  attribution$groups <- lapply(attribution$groups, function(group) {
    group$conditions <- told(group$conditions)
    group
  })
  for (group in attribution$groups) {
    told_by_group <- !is.na(table$group) & table$boundary %in% group$conditions
    table$group[told_by_group] <- listed(group$conditions, "or")
  }
  attribution$table <- table
  attribution$records <- lapply(attribution$records, labelled_attribution, told)
  attribution
}

# A table of conditions, in which groups stand as listed() names them.
labelled_conditions <- function(table, told) {
  table$boundary <- told(table$boundary)
  if (is.null(table$group)) return(table)
  grouped <- which(!is.na(table$group))
  table$group[grouped] <- vapply(strsplit(table$group[grouped], ", | or "),
                                 function(names) listed(told(names), "or"), "")
  table
}

# One that stands alone knows the labels of its record, or of each of several.
told_attribution <- function(attribution) {
  each <- attribution$records %||% list(attribution)
  labelled_attribution(attribution, function(names) condition_label(each, names))
}

# That of a model, under the labels of its records.
told_by_model <- function(model) {
  records <- lapply(record_fits(model$fit), `[[`, "measurements")
  labelled_attribution(model$attribution, function(names) condition_label(records, names))
}

labelled_entry <- function(entry, told) {
  if (length(entry$boundary)) entry$boundary <- told(entry$boundary)
  if (!is.null(entry$response)) entry$response$boundary <- told(entry$response$boundary)
  entry
}
