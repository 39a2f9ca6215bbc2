# A river by GR4J, a rainfall-runoff model in awk, which believes that no snow falls, on a catchment whose winters store
# snow (model.R). The loop asks what is missing in it.
# Usage: Rscript river.R
source(system.file("examples", "catchment", "model.R", package = "amiss"), local = TRUE)

# ---- Few checks, and a fast sampler.
quick <- list(max_steps = 1, rounds = 3, attribution = list(surrogates = 19),
              calibration = list(ais = list(pilot_chains = 48, groups = 4)))
upgrade <- upgrade_model(runoff, river, ideas, control = quick, seed = 1, quiet = TRUE)
print(upgrade)
print(tail(tidy(upgrade), 3))
