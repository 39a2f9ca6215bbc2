# Several records beside one another, as they stand in the place of one: what concerns all of them
# is told in units of each record's noise.

noise_unit <- "times the noise"

# `measurements`: a named list. The other fields are those of measurements() that sentences and
# tables ask for.
new_records <- function(measurements) {
  of <- function(field) unique(unlist(lapply(measurements, `[[`, field)))
  structure(list(records = measurements, name = listed(names(measurements)),
                 target = listed(of("target")), unit = noise_unit, noise_sd = 1,
                 conditions = of("conditions")), class = "amiss_records")
}

is_several <- function(measurements) inherits(measurements, "amiss_records")

# The measurements of each record, also of a bare list of them; of one a list without a name.
each_record <- function(measurements)
  if (is_several(measurements)) measurements$records else in_list(measurements)

# What there is of each record: one alone is an object, several are a bare list.
in_list <- function(x) if (is.object(x)) list(x) else x

#' @export
print.amiss_records <- function(x, ...) on_stdout(x, {
  cli::cli_text("{.strong Measurements} of {length(x$records)} records")
  for (name in names(x$records)) {
    m <- x$records[[name]]
    count <- function(use) sum(m$use == use & !is.na(m$y))
    cli::cli_bullets(c("*" = paste("{name}: {.field {target_label(m)}}, {count('calibrate')}",
                                   "steps to calibrate, {count('validate')} held out, noise",
                                   "{signif(m$noise_sd, 3)} {pretty_unit(m$unit)}")))
  }
})
