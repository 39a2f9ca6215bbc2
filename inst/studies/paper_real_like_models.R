sapply(paste0("M", 1:6), paper_box, simplify = FALSE)
