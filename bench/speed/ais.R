# Annealed importance sampling beside its plain form (no resampling, no second estimator, 64 chains)
# on posteriors whose evidence is known; the same cases as bench/evidence.R.

cases <- new.env(parent = globalenv())
sys.source(file.path(here, "evidence", "cases.R"), cases)
plain <- list(resample = FALSE, importance_draws = 0, groups = 8, max_groups = 8, chains = 8)
repeats <- 10

sampled <- function(case, control) {
  runs <- lapply(seq_len(repeats),
                 function(seed) amiss::ais(case$f, case$priors, seed = seed, control = control))
  field <- function(name) vapply(runs, `[[`, 0, name)
  effective <- vapply(runs, function(r) 1 / sum(r$weights^2), 0)
  c(error = sqrt(mean((field("log_evidence") - case$exact)^2)),
    effective = stats::median(effective), values = mean(field("evaluations")))
}

for (case in list(cases$linear_gaussian(10), cases$shells(5), cases$egg_box())) {
  own <- sampled(case, NULL)
  simple <- sampled(case, plain)
  told <- sprintf("%s, d = %d: ", case$name, case$d)
  measured(paste0(told, "error of the log evidence (RMS of 10)"), own[["error"]], "nat",
           simple[["error"]])
  measured(paste0(told, "the same, plain AIS"), simple[["error"]], "nat")
  measured(paste0(told, "likelihood values for an effective draw"),
           own[["values"]] / own[["effective"]], "", simple[["values"]] / simple[["effective"]])
  measured(paste0(told, "the same, plain AIS"), simple[["values"]] / simple[["effective"]], "")
  measured(paste0(told, "effective draws of plain AIS, of 64"), simple[["effective"]], "")
}
