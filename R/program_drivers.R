# What drives a program's run, as the files that it reads: CSV, a weather file, or what a function
# writes.

# A list of file names, epw_weather() and functions.
check_program_drivers <- function(drivers, call = rlang::caller_env()) {
  if (!is.list(drivers) || is.object(drivers)) drivers <- list(drivers)
  for (one in drivers) {
    if (inherits(one, "amiss_epw")) next
    if (is.function(one)) {
      if (length(formals(args(one))) >= 2) next
      abort_input(c("The function in {.arg drivers} has {length(formals(args(one)))} argument{?s}.",
                    i = "Write {.code function(table, folder)}: it writes files into the folder."),
                  call = call)
    }
    check_input(checkmate::check_string(one, min.chars = 1), "drivers",
                paste("Give the name of a CSV file, {.fun epw_weather} or a function of table and",
                      "folder."), call = call)
    check_inside(c(drivers = one), call)
  }
  names <- drivers_files(drivers)
  twice <- names[duplicated(names)]
  if (length(twice))
    abort_input("{.arg drivers} has the file {.file {twice[1]}} twice.", call = call)
  drivers
}

# Names of the files that are known before a function has run.
drivers_files <- function(drivers) {
  unlist(lapply(drivers, function(one)
    if (is.character(one)) one else if (inherits(one, "amiss_epw")) one$file))
}

# The columns that weather files need.
drivers_columns <- function(drivers) {
  unlist(lapply(drivers, function(one) if (inherits(one, "amiss_epw")) unname(one$columns)))
}

# The clock of the weather file, for times that say no zone.
drivers_offset <- function(drivers) {
  for (one in drivers) if (inherits(one, "amiss_epw")) return(one$utc_offset)
  0
}

# Bytes of each file, under its name in the run's folder. Written once for all runs.
drivers_bytes <- function(drivers, table, step_h, call = rlang::caller_env()) {
  files <- lapply(drivers, function(one) {
    if (is.character(one)) return(stats::setNames(list(csv_bytes(csv_times(table))), one))
    if (inherits(one, "amiss_epw"))
      return(stats::setNames(list(epw_bytes(one, table, step_h, call)), one$file))
    written_by(one, table, call)
  })
  files <- do.call(c, files)
  twice <- names(files)[duplicated(names(files))]
  if (length(twice))
    abort_input("Two of {.arg drivers} write the file {.file {twice[1]}}.", call = call)
  files
}

# What a function of the user writes into a folder.
written_by <- function(f, table, call) {
  folder <- tempfile("drivers-")
  dir.create(folder)
  on.exit(unlink(folder, recursive = TRUE))
  tryCatch(f(table, folder), error = function(e) {
    abort_input(c("The function in {.arg drivers} stopped: {conditionMessage(e)}",
                  i = paste("It is given a data frame of the columns {.val {names(table)}}, and a",
                            "folder.")), call = call)
  })
  names <- dir(folder, recursive = TRUE, all.files = TRUE, no.. = TRUE)
  if (!length(names)) {
    abort_input(c("The function in {.arg drivers} wrote no file.",
                  i = paste("Let it write into its second argument:",
                            "{.code file.path(folder, \"weather.txt\")}.")), call = call)
  }
  stats::setNames(lapply(file.path(folder, names), file_bytes), names)
}

drivers_table <- function(drivers, step_h, time) {
  data.frame(time = time, hours = step_h * seq_len(nrow(drivers)), drivers, check.names = FALSE)
}

# Times that are no numbers as ISO 8601 in UTC.
csv_times <- function(table) {
  if (!is.numeric(table$time)) {
    table$time <- format(utc(round(as.numeric(table$time))), "%Y-%m-%dT%H:%M:%SZ")
  }
  table
}

# Names that hold a comma stand in quotes.
csv_bytes <- function(table) {
  file <- tempfile()
  on.exit(unlink(file))
  utils::write.table(table, file, sep = ",", row.names = FALSE, col.names = FALSE, quote = FALSE)
  names <- enc2utf8(names(table))
  apart <- grepl("[\",\r\n]", names)
  names[apart] <- paste0("\"", gsub("\"", "\"\"", names[apart], fixed = TRUE), "\"")
  c(charToRaw(paste0(paste(names, collapse = ","), "\n")), file_bytes(file))
}
