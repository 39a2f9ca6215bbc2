# Ensembles of runs that were made elsewhere, where others run their simulator: runs at held-out
# rows have another emulator, of the same design.

#' @export
free_parameters.amiss_ensemble <- function(simulator) simulator$parameters

#' @export
driver_names.amiss_ensemble <- function(simulator) character()

# What a fit is a fit of: its simulator or, where that is not known, the ensemble of its runs. Of
# several records a list.
model_of <- function(fit) {
  if (inherits(fit, "amiss_joint")) return(lapply(fit$records, model_of))
  fit$emulator$simulator %||% fit$emulator$given
}

# Whether a model, or that of each record, is runs that were made elsewhere.
is_given <- function(model) inherits(in_list(model)[[1]], "amiss_ensemble")

# The uses whose rows a fit can predict.
predictable <- function(fit) {
  given <- fit$emulator$given
  c("calibrate", if (is.null(given) || !is.null(given$held_out)) "validate")
}

held_out_runs <- function(fit, call = rlang::caller_env()) {
  held <- fit$emulator$given$held_out
  if (is.null(held)) {
    abort_input(c(paste("The runs of this ensemble were made elsewhere, and none at the validation",
                        "rows, so that these cannot be predicted."),
                  i = paste("Give them to {.fun ensemble} with the {.arg measurements}, or ask for",
                            "{.code use = \"calibrate\"}.")), call = call)
  }
  check_same_rows(held$hours, fit$measurements, "validate", call)
  held
}

held_out_emulator <- function(fit, call = rlang::caller_env()) {
  given <- fit$emulator$given
  given[c("outputs", "hours")] <- held_out_runs(fit, call)[c("outputs", "hours")]
  without_basis_warnings(train_emulator(given, fit$measurements$noise_sd, fit$emulator$control))
}

# The runs themselves at all rows of these uses.
runs_given <- function(fit, use) {
  m <- fit$measurements
  given <- fit$emulator$given
  runs <- matrix(NaN, length(m$y), ncol(given$outputs))
  runs[fit$rows, ] <- given$outputs
  if ("validate" %in% use) runs[used_rows(m, "validate"), ] <- held_out_runs(fit)$outputs
  runs[m$use %in% use & !is.na(m$y), , drop = FALSE]
}

# Ensembles among the models of a loop: of runs given, at the rows of the measurements.
check_given <- function(models, measurements, call = rlang::caller_env()) {
  for (name in names(models)) {
    model <- models[[name]]
    if (!inherits(model, "amiss_ensemble")) next
    if (!is.null(model$simulator)) {
      abort_input(c("The ensemble {.val {name}} knows its simulator.",
                    i = "Give the simulator itself: it is run where the loop needs it."),
                  call = call)
    }
    rows <- length(used_rows(measurements, "calibrate"))
    if (nrow(model$outputs) != rows) {
      abort_input(c(paste("The runs of {.val {name}} have {nrow(model$outputs)} steps and the",
                          "measurements {rows} calibration rows."),
                    i = "Make the ensemble with these {.arg measurements}."), call = call)
    }
    check_same_rows(model$hours, measurements, call = call)
    if (!is.null(model$held_out))
      check_same_rows(model$held_out$hours, measurements, "validate", call)
  }
}
