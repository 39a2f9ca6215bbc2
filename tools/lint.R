# Fails when lintr finds something in the R code (.lintr). Usage: Rscript tools/lint.R
folders <- c("R", "tests", "tools", "bench")
files <- setdiff(list.files(folders, "\\.R$", recursive = TRUE, full.names = TRUE),
                 "R/RcppExports.R")
lints <- do.call(rbind, lapply(files, function(file) as.data.frame(lintr::lint(file))))
writeLines(sprintf("%s:%d: %s", lints$filename, lints$line_number, lints$message))
if (nrow(lints)) stop(nrow(lints), " lints", call. = FALSE)
