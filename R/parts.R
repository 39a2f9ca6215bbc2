# Whether something acts in one part of a record alone: from some moment on the error changes from
# one reading to the next by much more, or much less, than before. Changes do not see a drift.

# The moment after which the changes of the errors r are likeliest of another size: list(row,
# before, after), the root mean squares of the changes; NULL if they are not far apart.
changed_size <- function(r, hours, step_h) {
  rows <- which(diff(hours) < rules$unbroken * step_h & is.finite(diff(r)))
  squares <- diff(r)[rows]^2
  n <- length(squares)
  first <- seq_len(n)
  first <- first[first >= rules$least_part * n & n - first >= rules$least_part * n]
  if (!length(first)) return(NULL)
  before <- cumsum(squares)[first] / first
  after <- (sum(squares) - cumsum(squares)[first]) / (n - first)
  best <- which.min(first * log(before) + (n - first) * log(after))
  size <- sqrt(c(before[best], after[best]))
  if (!isTRUE(max(size) > rules$part_size * min(size))) return(NULL)
  list(row = rows[first[best]] + 1, before = size[1], after = size[2])
}

part_inspection <- function(model, measurements) {
  if (is_several(measurements)) {
    told <- lapply(each_view(model, measurements),
                   function(view) part_inspection(view$model, view$measurements))
    if (length(unlist(told)))
      return(c(parts = paste(names(unlist(told)), unlist(told), sep = ": ", collapse = " ")))
    return(NULL)
  }
  p <- model$prediction
  rows <- match(p$time, measurements$time)
  found <- changed_size(p$observed - p$mean, measurements$hours[rows], measurements$step_h)
  if (is.null(found)) return(NULL)
  at <- p$time[found$row]
  sizes <- with_unit(short(c(found$before, found$after)), measurements$unit)
  c(parts = sprintf(paste("Ask what %s at %s: from one reading to the next the error changes by %s",
                          "before, and by %s after. What acts in one part of a record alone is no",
                          "property of the model. Judge the parts one by one."),
                    if (found$before < found$after) "began" else "ended",
                    paste0(if (is.numeric(at)) "hour ", format(at)), sizes[1], sizes[2]))
}
