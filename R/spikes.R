# Readings that stand apart from those before and after them: errors of a sensor, or events of a
# single step. Errors count as normal, so that a few such readings weigh like many good ones.

# Rows of the errors r that stand apart, beside rows of the same unbroken part.
spikes <- function(r, hours, step_h) {
  change <- ifelse(diff(hours) < rules$unbroken * step_h, diff(r), NA)
  usual <- stats::mad(change, na.rm = TRUE)
  before <- c(NA, change)
  after <- c(-change, NA)
  if (is.na(usual) || usual == 0) return(integer())
  which(before * after > 0 & pmin(abs(before), abs(after)) > rules$spike_size * usual)
}

spike_inspection <- function(model, measurements) {
  if (is_several(measurements))
    return(each_inspection("spikes", spike_inspection, model, measurements))
  p <- model$prediction[model$prediction$use == "calibrate", ]
  rows <- model$fit$rows
  r <- p$observed - p$mean
  apart <- spikes(r, measurements$hours[rows], measurements$step_h)
  apart <- apart[!rows[apart] %in% measurements$faulty]
  if (!length(apart)) return(NULL)
  at <- measurements$time[rows][apart[1]]
  c(spikes = sprintf(paste("%d of %d readings, the first at %s, %s apart from those before and",
                           "after: a sensor that fails now and then, or something that lasts a",
                           "single step. Mark readings that the sensor got wrong as NA: a few",
                           "of them weigh as much as many good ones."),
                     length(apart), length(r), paste0(if (is.numeric(at)) "hour ", format(at)),
                     if (length(apart) > 1) "stand" else "stands"))
}
