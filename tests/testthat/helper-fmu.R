# FMUs of a small house, built from the sources in inst/examples/fmu once in a session; what they
# should give.

fmu_sources <- system.file("examples", "fmu", package = "amiss")
source(file.path(fmu_sources, "build.R"), local = TRUE)

skip_without_fmus <- function() {
  skip_if_not_installed("xml2")
  built <- try(compiled(file.path(fmu_sources, "house2.c"), file.path(fmu_sources, "house.h")),
               silent = TRUE)
  skip_if(inherits(built, "try-error"), "no compiler")
}

house_file <- function(version = 2, ..., frame = parent.frame()) {
  build_house(withr::local_tempfile(fileext = ".fmu", .local_envir = frame), version, ...,
              sources = fmu_sources)
}

house_fmu <- function(file, ..., output = "T_air", inputs = c(To = "Te", "P")) {
  fmu_simulator(file, free("R_out", uniform(0.005, 0.02), "K/W"), ..., output = output,
                inputs = inputs, name = "house")
}

house_drivers <- function(rows = 48) {
  hour <- seq_len(rows)
  cbind(To = 5 + 6 * sin(hour / 4), P = ifelse(hour %% 24 < 8, 2000, 0),
        Gv = pmax(0, 300 * cos(hour / 3.8)))
}

# The house as a linear system, dT/dt = A T + B u, whose steps are exact for inputs that are
# constant in a row: the air's temperature at `steps` points in each row, after that at the start.
house_exact <- function(drivers, step_h, steps = 1, start = rep(20, 3), ...) {
  p <- list(C_air = 2e6, C_wall = 3e7, C_heater = 1e5, R_in = 0.005, R_out = 0.01, R_heater = 0.01,
            R_air = 0.02, leak = 0, aperture = 2)
  changed <- list(...)
  p[names(changed)] <- changed
  air <- 1 / p$R_air + p$leak
  capacity <- c(p$C_air, p$C_wall, p$C_heater)
  a <- rbind(c(-1 / p$R_in - 1 / p$R_heater - air, 1 / p$R_in, 1 / p$R_heater),
             c(1 / p$R_in, -1 / p$R_in - 1 / p$R_out, 0), c(1 / p$R_heater, 0, -1 / p$R_heater)) /
    capacity
  b <- rbind(c(air, p$aperture, 0), c(1 / p$R_out, 0, 0), c(0, 0, 1)) / capacity
  by <- eigen(a)
  exponential <- by$vectors %*% diag(exp(by$values * 3600 * step_h / steps)) %*% solve(by$vectors)
  u <- cbind(drivers[, "To"], if ("Gv" %in% colnames(drivers)) drivers[, "Gv"] else 0,
             drivers[, "P"])
  state <- start
  out <- state[1]
  for (row in seq_len(nrow(u))) {
    rest <- solve(a, -b %*% u[row, ])
    for (k in seq_len(steps)) {
      state <- rest + exponential %*% (state - rest)
      out <- c(out, state[1])
    }
  }
  out
}

# Of points, the first of which is the start: means of rows by the trapezoidal rule.
row_means <- function(points, steps) {
  between <- (points[-1] + points[-length(points)]) / 2
  colMeans(matrix(between, steps))
}

# Sessions of FMUs that this session, or the one of this number, has started and that live.
fmu_processes <- function(session = Sys.getpid()) {
  ids <- suppressWarnings(system2("pgrep", c("-f", shQuote(sprintf("serve_fmu[(]%d[)]", session))),
                                  stdout = TRUE))
  as.integer(ids)
}

wait_until <- function(done)
  for (i in 1:600) if (done()) return(invisible(TRUE)) else Sys.sleep(0.1)

# An FMU with a variable of every type (fmu/types.c). `mark`: the file that its library writes when
# it is loaded.
types_fmu <- function(version, frame = parent.frame()) {
  library <- compiled(test_path("fmu", "types.c"), flags = sprintf("-DMARK='\"%s\"'", types_mark()))
  file <- withr::local_tempfile(fileext = ".fmu", .local_envir = frame)
  write_zip(file, fmu_parts("types", library, version, types_description(version)))
}

types_mark <- function() file.path(normalizePath(tempdir(), "/"), "loaded")

types_description <- function(version) {
  types <- c(real = "Float64", sum = "Float64", sizes = "Float64", whole = "Int32", count = "Int32",
             choice = "Enumeration", flag = "Boolean", text = "String", f32 = "Float32",
             i8 = "Int8", u8 = "UInt8", i16 = "Int16", u16 = "UInt16", u32 = "UInt32",
             i64 = "Int64", u64 = "UInt64")
  if (version == 2) types <- types[seq_len(8)]
  reference <- c(0:2, 0, 2, 1, 30, 40, 50:57)[seq_along(types)]
  causality <- rep("parameter", length(types))
  causality[names(types) %in% c("sum", "sizes")] <- "output"
  causality[names(types) == "count"] <- "input"
  head <- sprintf("name=\"%s\" valueReference=\"%d\" causality=\"%s\"", names(types), reference,
                  causality)
  old <- c(Float64 = "Real", Int32 = "Integer", Enumeration = "Enumeration", Boolean = "Boolean",
           String = "String")
  variables <- if (version == 3) sprintf("<%s %s/>", types, head)
               else sprintf("<ScalarVariable %s><%s/></ScalarVariable>", head, old[types])
  c(sprintf("<fmiModelDescription fmiVersion=\"%d.0\" modelName=\"types\">", version),
    "<CoSimulation modelIdentifier=\"types\" canHandleVariableCommunicationStepSize=\"true\"/>",
    "<ModelVariables>", variables, "</ModelVariables>", "</fmiModelDescription>")
}
