#' @export
report_content.amiss_survey <- function(x) list(survey = x, told = summary(x))

#' @export
result_list.amiss_survey <- function(x) {
  told <- summary(x)
  list(schema = 1L, headline = told$headline, causes = as.list(told$causes),
       studies = table_rows(tidy(x)), mechanisms = table_rows(tidy(x, "mechanisms")),
       conditions = table_rows(tidy(x, "conditions")), trials = table_rows(tidy(x, "trials")),
       parameters = table_rows(tidy(x, "parameters")))
}

# Reads the studies and writes the results into a folder, as run_study() does.
write_survey <- function(folders, out, quiet = FALSE) {
  result <- survey(folders)
  check_report_tools()
  held <- hold_folder(out)
  on.exit(release_folder(held))
  pieces <- c(result_pieces(result), list(studies.csv = function(path) {
    utils::write.csv(tidy(result), path, row.names = FALSE)
  }))
  write_study(result, out, quiet, pieces)
  invisible(result)
}
