# Whether something acts in one part of a record alone: from some moment on the error changes from
# one reading to the next by much more, or much less, than before. Changes do not see a drift.

# The moment after which the changes of the errors r are likeliest of another size, if they have
# heavy tails (Laplace): list(row, before, after), the usual sizes, by their medians; NULL if these
# are not far apart, or if either part is short.
changed_size <- function(r, hours, step_h) {
  rows <- which(diff(hours) < rules$unbroken * step_h & is.finite(diff(r))) + 1
  change <- abs(diff(r)[rows - 1])
  n <- length(change)
  if (n < 2 * rules$suspect_rows || !any(change > 0)) return(NULL)
  first <- seq(2, n - 2)
  least <- 1e-3 * mean(change)
  before <- pmax(least, cumsum(change)[first] / first)
  after <- pmax(least, rev(cumsum(rev(change)))[first + 1] / (n - first))
  k <- first[which.min(first * log(before) + (n - first) * log(after))]
  lasts <- c(hours[rows[k]] - hours[1], hours[length(hours)] - hours[rows[k]])
  is_short <- min(k, n - k) < max(rules$suspect_rows, rules$least_part * n) ||
    min(lasts) < 24 * rules$part_days
  size <- c(stats::mad(change[seq_len(k)], 0), stats::mad(change[-seq_len(k)], 0))
  if (is_short || max(size) <= rules$part_size * min(size)) return(NULL)
  # A change of another size leads to the first reading that is; the last is as before.
  list(row = rows[k + 1], before = size[1], after = size[2])
}

part_inspection <- function(model, measurements) {
  if (is_several(measurements))
    return(each_inspection("parts", part_inspection, model, measurements))
  p <- model$prediction
  rows <- match(p$time, measurements$time)
  r <- ifelse(rows %in% measurements$faulty, NA, p$observed - p$mean)
  found <- changed_size(r, measurements$hours[rows], measurements$step_h)
  if (is.null(found)) return(NULL)
  at <- p$time[found$row]
  sizes <- with_unit(short(c(found$before, found$after)), measurements$unit)
  answers <- significant_conditions(model$attribution$table)
  c(parts = sprintf(paste("Ask what %s at %s: from one reading to the next the error usually",
                          "changes by %s before, and by %s after. %s"),
                    if (found$before < found$after) "began" else "ended",
                    paste0(if (is.numeric(at)) "hour ", format(at)), sizes[1], sizes[2],
                    if (length(answers))
                      sprintf("It may be %s, to which the error responds.", listed(answers, "or"))
                    else paste("What acts in one part of a record alone may be no property of the",
                               "model.")))
}
