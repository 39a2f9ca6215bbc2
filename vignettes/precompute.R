# Makes vignettes/twinhouse.rds: what vignettes/twinhouse.Rmd shows of the two studies that ship with the package.
# Usage, in a clone with the package installed: Rscript vignettes/precompute.R (five minutes of one core)
library(amiss)

# The tables behind the words, and measurements with the simulation of the first and of the last model.
kept <- function(upgrade) {
  said <- summary(upgrade)
  last <- upgrade$models[[length(upgrade$models)]]
  list(tag = said$tag, headline = said$headline, remains = said$remains, scores = said$scores,
       candidates = upgrade$candidates, attribution = upgrade$models[[1]]$attribution$table,
       adopted = unname(vapply(upgrade$models[-1], `[[`, "", "name")), parameters = tidy(upgrade),
       runs = upgrade$runs_total, decisive = upgrade$control$decisive,
       series = cbind(last$prediction[c("time", "use", "observed", "mean", "lower95", "upper95")],
                      first = upgrade$models[[1]]$prediction$mean))
}

study <- function(house) {
  run_study(system.file("studies", paste0("twinhouse_", house, ".yml"), package = "amiss"), quiet = TRUE)
}

saveRDS(lapply(c(O5 = "O5", N2 = "N2"), function(house) kept(study(house))), "vignettes/twinhouse.rds", version = 2)
