#' @export
report_content.amiss_upgrade <- function(x) {
  list(upgrade = x, told = summary(x), one = length(x$models) < 2)
}

# The errors and the band before and after, for tiles.
score_tiles <- function(upgrade) {
  number <- function(x) sub("\\.$", "", formatC(x, digits = 2, format = "fg", flag = "#"))
  arrow <- function(x) paste(x, collapse = " \u2192 ")
  held <- has_validation(upgrade)
  rmse <- function(use) with_unit(arrow(number(score_of(upgrade, use, "rmse"))), upgrade$measurements$unit)
  inside <- round(100 * score_of(upgrade, if (held) "validate" else "calibrate", "coverage95"))
  list(value = c(if (held) rmse("validate"), rmse("calibrate"), paste(arrow(inside), "%")),
       words = c(if (held) "typical error, held-out data", "typical error, calibration",
                 paste("in the 95 % band,", if (held) "held-out" else "calibration")))
}

conditions_words <- function(table) {
  data.frame("boundary condition" = table$boundary,
             "log10 Bayes factor lost without it" = sprintf("%+.1f", table$log10_bf_dropped),
             "share of the error" = sprintf("%.0f %%", 100 * table$share), "p-value" = format(round(table$p_value, 3)),
             significant = ifelse(table$significant, "yes", "no"), estimate = ifelse(table$trusted, "sound", "rough"),
             check.names = FALSE)
}
