# Command line of a benchmark: --name value, and --smoke for the smallest work that goes through all
# of it (tools/smoke). Sourced by the commands of this folder.
arguments <- commandArgs(trailingOnly = TRUE)
smoke <- "--smoke" %in% arguments
arguments <- arguments[arguments != "--smoke"]

option <- function(name, default = NULL, smallest = default) {
  at <- match(paste0("--", name), arguments)
  if (is.na(at)) return(if (smoke) smallest else default)
  if (at == length(arguments)) stop("--", name, " needs a value", call. = FALSE)
  arguments[at + 1]
}

write_rows <- function(rows, out) {
  part <- paste0(out, ".part")
  jsonlite::write_json(rows, part, auto_unbox = TRUE, na = "null", null = "null", digits = NA,
                       pretty = TRUE, dataframe = "rows")
  if (!file.rename(part, out)) stop(out, " cannot be written", call. = FALSE)
  message("written to ", out)
}

# The functions of bench/hidden_effects that draw worlds.
worlds_scope <- function(here, parts = c("worlds", "least_squares", "network", "runoff", "wrong",
                                         "families")) {
  scope <- new.env(parent = globalenv())
  for (part in parts) sys.source(file.path(here, "hidden_effects", paste0(part, ".R")), scope)
  scope
}
