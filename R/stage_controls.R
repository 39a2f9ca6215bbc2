# The options of the stages, checked before anything is computed.

check_stage_controls <- function(control, measurements, method = "history",
                                 call = rlang::caller_env()) {
  for (m in each_record(measurements)) check_controls_of(control, m, method, call)
}

check_controls_of <- function(control, measurements, method, call, attribution = TRUE) {
  fill_emulator_control(control$emulator, "control$emulator", call)
  n <- length(used_rows(measurements, "calibrate"))
  if (method == "paper") {
    return(fill_paper_control(control$calibration, n, "control$calibration", call))
  }
  calibration <- fill_calibration_control(control$calibration, measurements, n,
                                          "control$calibration", call)
  if (!attribution) return(invisible())
  fill_attribution_control(control$attribution, calibration$ais, length(measurements$conditions),
                           "control$attribution", call)
}
