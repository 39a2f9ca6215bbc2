# A day to warm up and four with a random heating sequence, then three without heating. The truth is computed on a finer
# grid, in space and time, than the models that are calibrated. `Ti_clean` is the output without noise.
truth <- source("paper_real_like_truth.R", local = TRUE)$value
record <- synthetic_weather(days = 8, seed = 7)
record$phase <- ifelse(record$hour <= 120, "rolbs", "freefloat")
record$RHP <- ifelse(record$phase == "rolbs", rolbs(nrow(record), power = 100, seed = 7), 0)
drivers <- as.matrix(record[c("Te", "Gv", "Ws", "Wd", "RHP")])
record$Ti_clean <- simulate_zone(truth$simulator, t(truth$values), drivers, step_s = 900, control = list(max_substep_s = 150, cells = 2))[, 1]
record$Ti <- record$Ti_clean + with_seed(7, rnorm(nrow(record), sd = 0.1))
record
