# Says in plain words what the result.json of each folder given holds: the cause named and the gain
# measured.
`%||%` <- function(x, y) if (is.null(x) || length(x) == 0) y else x

odds <- function(log10_bf) {
  size <- if (is.finite(log10_bf) && abs(log10_bf) < 6) {
    format(signif(10^abs(log10_bf), 2), big.mark = ",", scientific = FALSE)
  } else "over a million"
  sprintf("odds of %s to 1 %s it (log10 Bayes factor %.1f)", size,
          if (log10_bf >= 0) "for" else "against", log10_bf)
}

from_to <- function(what, pair, unit = "") {
  if (length(pair) != 2 || anyNA(pair)) return(NULL)
  change <- 100 * (pair[2] / pair[1] - 1)
  sprintf("%s: %.2f%s before, %.2f%s after (%+.0f %%)", what, pair[1], unit, pair[2], unit, change)
}

numbers <- function(x) suppressWarnings(as.numeric(unlist(x)))

describe_cause <- function(cause, diagnosis) {
  if (length(cause) == 0) return(diagnosis$headline)
  bayes_factor <- numbers(cause$log10_bf)
  c(paste0(diagnosis$tag, "."), diagnosis$headline,
    sprintf("Mechanism: %s; boundary condition: %s", cause$mechanism %||% "none",
            paste(unlist(cause$boundary) %||% "none", collapse = ", ")),
    if (length(bayes_factor) == 1 && !is.na(bayes_factor)) paste("Evidence:", odds(bayes_factor)))
}

describe_gain <- function(gain) {
  if (length(gain) == 0) return("No gain: the model was not extended.")
  bayes_factor <- numbers(gain$log10_bf)
  coverage <- numbers(gain$coverage95_validation)
  known <- length(bayes_factor) == 1 && !is.na(bayes_factor)
  c(if (known) paste("Extended model, beside unknown responses:", odds(bayes_factor)),
    from_to("Error (RMSE) on the calibration data", numbers(gain$rmse_calibration)),
    from_to("Error (RMSE) on data held out", numbers(gain$rmse_validation)),
    if (length(coverage) %in% 1:2 && !anyNA(coverage)) {
      sprintf("Share of data held out within the 95 %% band: %s",
              paste0(sprintf("%.0f %%", 100 * coverage),
                     if (length(coverage) == 2) c(" before", " after"), collapse = ", "))
    })
}

for (folder in commandArgs(trailingOnly = TRUE)) {
  result <- jsonlite::read_json(file.path(folder, "result.json"), simplifyVector = TRUE)
  cat(basename(folder), "\n", sep = "")
  lines <- c(describe_cause(result$named_cause, result$diagnosis), describe_gain(result$gain))
  writeLines(c(strwrap(lines, width = 100, indent = 2, exdent = 4),
               paste0("  Report: ", folder, "/report.html"), ""))
}
