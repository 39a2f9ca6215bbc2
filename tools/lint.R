# Fails when lintr finds something in the R code (.lintr). Usage: Rscript tools/lint.R
long_lines_stay <- "^(R|bench|tests)/"  # not wrapped yet: tools/wrap-lines.R

folders <- c("R", "tests", "tools", "bench")
files <- setdiff(list.files(folders, "\\.R$", recursive = TRUE, full.names = TRUE), "R/RcppExports.R")
lints <- do.call(rbind, lapply(files, function(file) {
  found <- as.data.frame(lintr::lint(file))
  found[!(found$linter == "line_length_linter" & grepl(long_lines_stay, file)), ]
}))
writeLines(sprintf("%s:%d: %s", lints$filename, lints$line_number, lints$message))
if (nrow(lints)) stop(nrow(lints), " lints", call. = FALSE)
