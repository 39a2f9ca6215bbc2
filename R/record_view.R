# One of several records of an upgrade, as if it were the only one: what is said or drawn of it.

record_model <- function(model, name) {
  model[c("fit", "attribution", "prediction", "scores")] <- list(
    model$fit$records[[name]], model$attribution$records[[name]], model$records[[name]]$prediction,
    model$records[[name]]$scores)
  model$records <- NULL
  model
}

record_upgrade <- function(upgrade, name) {
  upgrade$models <- lapply(upgrade$models, record_model, name)
  upgrade$measurements <- upgrade$measurements$records[[name]]
  upgrade
}

# list(models, measurements) of each record; of one record those that there are.
each_view <- function(model, measurements) {
  if (!is_several(measurements)) return(list(list(model = model, measurements = measurements)))
  lapply(stats::setNames(nm = names(measurements$records)), function(name) {
    list(model = record_model(model, name), measurements = measurements$records[[name]])
  })
}

# What `inspect` says of several records, one after the other under one id; NULL if that is nothing.
each_inspection <- function(id, inspect, model, measurements) {
  told <- unlist(lapply(each_view(model, measurements),
                        function(view) unname(inspect(view$model, view$measurements))))
  if (length(told))
    stats::setNames(paste(names(told), told, sep = ": ", collapse = " "), id)
}
