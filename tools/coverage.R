# Line coverage of R by the tests of tools/coverage-tests.R, with that of C++ as gcovr told it. The
# compiled code is not instrumented anew: it is that of build/library.
# Usage: Rscript tools/coverage.R CPP.csv OUT LEAST
arguments <- commandArgs(trailingOnly = TRUE)
cpp <- utils::read.csv(arguments[1])
cpp <- data.frame(language = "C++", file = cpp$filename, lines = cpp$line_total,
                  covered = cpp$line_covered)

# Functions of the installed package are traced in place; processes that tests start are not
# counted.
suppressPackageStartupMessages({
  library(testthat)
  library(amiss)
})
traced <- covr::environment_coverage(asNamespace("amiss"), test_files = "tools/coverage-tests.R")
r <- as.data.frame(covr::tally_coverage(traced, by = "line"))
r$filename <- file.path("R", basename(r$filename))
r <- r[r$filename != "R/RcppExports.R", ]  # made by a machine
r <- do.call(rbind, lapply(split(r, r$filename), function(x) {
  data.frame(language = "R", file = x$filename[1], lines = nrow(x), covered = sum(x$value > 0))
}))
table <- rbind(cpp, r)
table$percent <- round(100 * table$covered / table$lines, 1)
table <- table[order(table$language, table$percent), ]
utils::write.table(table, arguments[2], row.names = FALSE, quote = FALSE, sep = "\t")
total <- stats::aggregate(cbind(lines, covered) ~ language, table, sum)
total$percent <- round(100 * total$covered / total$lines, 1)
print(total, row.names = FALSE)
low <- total$language[total$percent < as.numeric(arguments[3])]
if (length(low)) stop("less than ", arguments[3], " % of the lines of ",
                      paste(low, collapse = " and "), call. = FALSE)
