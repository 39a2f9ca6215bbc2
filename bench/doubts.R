#!/usr/bin/env Rscript
# What each doubt about an adopted mechanism costs and what it saves, over worlds that
# bench/hidden_effects.R has kept: adopted mechanisms that the worlds hid (right) and others
# (wrong), those with the doubt, and those that would be named without it.
# Usage: Rscript bench/doubts.R --worlds DIR,DIR [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
folders <- strsplit(option("worlds", ""), ",", fixed = TRUE)[[1]]
out <- option("out", "doubts.json")
missing <- folders[!dir.exists(folders)]
if (length(missing)) stop("--worlds: there is no folder ", toString(missing))
files <- list.files(folders, "[.]rds$", full.names = TRUE)
if (!length(files)) stop("--worlds names no folder with worlds of bench/hidden_effects.R")
doubt_ids <- names(getFromNamespace("doubts", "amiss"))

adopted_rows <- function(file) {
  world <- readRDS(file)
  mechanisms <- unlist(world$adopted)
  of_each <- rep_len(world$doubts, length(mechanisms))
  found <- t(vapply(of_each, function(ids) doubt_ids %in% unlist(ids), logical(length(doubt_ids))))
  colnames(found) <- doubt_ids
  of_all <- function(x) rep_len(x, length(mechanisms))
  data.frame(family = of_all(world$family), seed = of_all(world$seed),
             mechanism = as.character(mechanisms),
             right = mechanisms %in% unlist(world$true_mechanism), found, check.names = FALSE)
}
rows <- do.call(rbind, lapply(files, adopted_rows))
of_doubts <- as.matrix(rows[doubt_ids])
alone <- rowSums(of_doubts) == 1
count <- function(which) c(right = sum(rows$right[which]), wrong = sum(!rows$right[which]))
table <- do.call(rbind, lapply(doubt_ids, function(id) {
  has <- count(of_doubts[, id])
  would <- count(of_doubts[, id] & alone)
  data.frame(doubt = id, right = has[["right"]], wrong = has[["wrong"]],
             named_without_right = would[["right"]], named_without_wrong = would[["wrong"]])
}))
none <- count(rowSums(of_doubts) == 0)
message(sprintf("%d worlds, %d mechanisms adopted, %d of them right", length(files), nrow(rows),
                sum(rows$right)))
message(sprintf("without a doubt: %d right, %d wrong", none[["right"]], none[["wrong"]]))
print(table, row.names = FALSE)
jsonlite::write_json(list(worlds = length(files), adopted = count(TRUE), no_doubt = as.list(none),
                          table = table), out, auto_unbox = TRUE, digits = NA, pretty = TRUE)
