# A mechanism is an edit of a network.

#' @export
add_component.amiss_network <- function(model, ...) {
  model$components <- named_parts(c(unname(model$components), list(...)))
  new_network(unclass(model))
}

#' @export
component.amiss_network <- function(model, name) find_part(model, name, rlang::current_env())

#' @export
drop_component.amiss_network <- function(model, name) {
  find_part(model, name, rlang::current_env())
  model$components[[name]] <- NULL
  new_network(unclass(model))
}

#' @export
change_component.amiss_network <- function(model, name, ...) {
  call <- rlang::current_env()
  changes <- list(...)
  if (identical(name, "network")) {
    known <- c("output", "before", "hold", "interpolation", "output_at", "start_hours", "name")
    check_field_names(changes, known, "network", call)
    return(
      do.call(network, c(unname(model$components), replace_fields(unclass(model)[known], changes))))
  }
  old <- find_part(model, name, call)
  check_field_names(changes, names(network_fields[[old$type]]), describe_part(old), call)
  if ("conductance" %in% names(changes)) old["resistance"] <- list(NULL)
  if ("resistance" %in% names(changes)) old["conductance"] <- list(NULL)
  model$components[[name]] <- check_part(replace_fields(old, changes), call)
  new_network(unclass(model))
}

find_part <- function(network, name, call) {
  known <- names(network$components)
  if (is.character(name)) check_readable(name, "name", call)
  if (!checkmate::test_choice(name, known)) {
    abort_input(c("The network has no part {.arg name} = {seen(name)}.",
                  i = "Its parts: {.val {known}}."), call = call)
  }
  network$components[[name]]
}
