#' @export
report_content.amiss_upgrade <- function(x) {
  x <- labelled(x)
  list(upgrade = x, told = summary(x), one = length(x$models) < 2,
       several = is_several(x$measurements))
}

# Figures of the record or, of several, of each under its name.
record_figures <- function(upgrade, which) {
  if (!is_several(upgrade$measurements)) for (one in which) report_figure(upgrade, one)
  for (name in names(upgrade$measurements$records)) {
    cat("\n\n### ", markdown_text(name), "\n\n", sep = "")
    for (one in which) report_figure(upgrade, paste(one, "of", name))
  }
}

# Runs behind the first model, and of what length each record is.
first_runs_made <- function(upgrade) {
  max(vapply(record_fits(upgrade$models[[1]]$fit),
             function(fit) nrow(fit$emulator$processes$inputs), 0L))
}

record_words <- function(measurements) {
  told <- vapply(each_record(measurements), function(m) {
    sprintf("%s, %d steps of %s h", m$name, length(m$y), format(m$step_h))
  }, "")
  paste(told, collapse = "; ")
}

# The errors and the band before and after, for tiles.
score_tiles <- function(upgrade) {
  number <- function(x) sub("\\.$", "", formatC(x, digits = 2, format = "fg", flag = "#"))
  arrow <- function(x) paste(x, collapse = " \u2192 ")
  held <- has_validation(upgrade)
  rmse <- function(use)
    with_unit(arrow(number(score_of(upgrade, use, "rmse"))), upgrade$measurements$unit)
  inside <- round(100 * score_of(upgrade, if (held) "validate" else "calibrate", "coverage95"))
  list(value = c(if (held) rmse("validate"), rmse("calibrate"), paste(arrow(inside), "%")),
       words = c(if (held) "typical error, held-out data", "typical error, calibration",
                 paste("in the 95 % band,", if (held) "held-out" else "calibration")))
}

conditions_words <- function(table) {
  if (!is.null(table$records)) {
    return(
      data.frame("boundary condition" = table$boundary,
                 "log10 Bayes factor lost without it" = sprintf("%+.1f", table$log10_bf_dropped),
                 "p-value" = format(round(table$p_value, 3)),
                 significant = ifelse(table$significant, "yes", "no"), "in records" = table$records,
                 estimate = ifelse(table$trusted, "sound", "rough"), check.names = FALSE))
  }
  data.frame("boundary condition" = table$boundary,
             "log10 Bayes factor lost without it" = sprintf("%+.1f", table$log10_bf_dropped),
             "share of the error" = sprintf("%.0f %%", 100 * table$share),
             "p-value" = format(round(table$p_value, 3)),
             significant = ifelse(table$significant, "yes", "no"),
             estimate = ifelse(table$trusted, "sound", "rough"), check.names = FALSE)
}
