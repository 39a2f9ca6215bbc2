# Prints, one a line, the R packages of DESCRIPTION that cannot be loaded or are too old.
# Usage: Rscript missing-packages.R DESCRIPTION runtime|all|bench|site|fuzz|valgrind|coverage
arguments <- commandArgs(trailingOnly = TRUE)
runtime <- arguments[2] == "runtime"
fields <- read.dcf(arguments[1], fields = c("Imports", "LinkingTo", "Suggests"))
wanted <- trimws(unlist(strsplit(fields[!is.na(fields)], ",")))
wanted <- wanted[nzchar(wanted)]
name <- sub("[[:space:]]*\\(.*", "", wanted)
minimum <- ifelse(grepl(">=", wanted), sub(".*>=[[:space:]]*([0-9.-]+).*", "\\1", wanted), "0")
if (runtime) {  # the package itself and its report
  imported <- trimws(sub("\\(.*", "", unlist(strsplit(fields[, c("Imports", "LinkingTo")], ","))))
  keep <- name %in% c(imported, "knitr", "rmarkdown")
  name <- name[keep]
  minimum <- minimum[keep]
} else {  # what tools/document and tools/format need besides
  name <- c(name, "roxygen2", "lintr")
  minimum <- c(minimum, "7.2.0", "3.0.0")
}
# Workers of the hidden-effect benchmark, a random forest among its rivals, sessions of
# bench/size.R.
if (arguments[2] == "bench") {
  extra <- c("future", "future.apply", "ranger", "callr")
  name <- c(name, extra)
  minimum <- c(minimum, rep("0", length(extra)))
}
if (arguments[2] == "coverage") {
  name <- c(name, "covr")
  minimum <- c(minimum, "0")
}
if (arguments[2] == "site") {
  name <- c(name, "pkgdown")
  minimum <- c(minimum, "0")
}
usable <- function(name, minimum) {
  suppressWarnings(suppressPackageStartupMessages(requireNamespace(name, quietly = TRUE))) &&
    utils::packageVersion(name) >= minimum
}
missing <- !mapply(usable, name, minimum)
writeLines(unique(name[missing]))
