# The SQLite output of EnergyPlus (eplusout.sql), by package RSQLite.

check_sqlite <- function(column, call = rlang::caller_env()) {
  if (is.numeric(column)) {
    abort_input(c("{.arg column} = {.val {column}} names no variable of an SQLite output.",
                  i = "Write {.code \"KEY:Name of the variable\"}, as in EnergyPlus' CSV."),
                call = call)
  }
  absent <- Filter(function(package) !requireNamespace(package, quietly = TRUE),
                   c("DBI", "RSQLite"))
  if (length(absent)) {
    abort_input(c(paste("An SQLite output is read by the package{?s} {.pkg {absent}}, which",
                        "{?is/are} not installed."),
                  i = "Install {?it/them}, or let EnergyPlus write {.file eplusout.csv}."),
                call = call, class = "amiss_error_package")
  }
}

# list(value, month, day, seconds) of the run period, in the order of its time.
read_sqlite <- function(output, folder) {
  path <- file.path(folder, output$file)
  if (!is_regular_file(path)) stop("it wrote no ", output$file)
  database <- DBI::dbConnect(RSQLite::SQLite(), path, flags = RSQLite::SQLITE_RO)
  on.exit(DBI::dbDisconnect(database))
  series <- lapply(output$column, sqlite_series, database = database, file = output$file)
  index <- lapply(series, `[[`, "TimeIndex")
  if (length(unique(index)) > 1)
    stop("the variables in ", output$file, " are reported at different times")
  value <- Reduce(`+`, lapply(series, `[[`, "Value"))
  if (identical(output$combine, "mean")) value <- value / length(series)
  first <- series[[1]]
  list(value = value, month = first$Month, day = first$Day,
       seconds = 3600 * first$Hour + 60 * first$Minute)
}

# A variable as it was reported most often, of the weather's run period alone: no design days, no
# warm-up.
sqlite_series <- function(column, database, file) {
  known <- DBI::dbGetQuery(
    database, "SELECT ReportDataDictionaryIndex AS id, KeyValue AS key, Name AS name
                                      FROM ReportDataDictionary")
  keyed <- !is.na(known$key) & nzchar(known$key)  # meters have none
  names <- ifelse(keyed, paste0(known$key, ":", known$name), known$name)
  found <- known$id[tolower(names) == tolower(column)]
  if (!length(found)) {
    there <- paste(utils::head(unique(names), 5), collapse = ", ")
    stop("there is no variable ", column, " in ", file, "; there: ", shown(there))
  }
  series <- lapply(found, function(id)
    DBI::dbGetQuery(database, run_period_query, params = list(id)))
  series[[which.max(vapply(series, nrow, 0L))]]
}

run_period_query <- "SELECT d.TimeIndex, d.Value, t.Month, t.Day, t.Hour, t.Minute
  FROM ReportData AS d JOIN Time AS t ON d.TimeIndex = t.TimeIndex
  LEFT JOIN EnvironmentPeriods AS e ON t.EnvironmentPeriodIndex = e.EnvironmentPeriodIndex
  WHERE d.ReportDataDictionaryIndex = ? AND (t.WarmupFlag IS NULL OR t.WarmupFlag = 0)
    AND (e.EnvironmentType IS NULL OR e.EnvironmentType = 3)
  ORDER BY d.TimeIndex"
