# Five days of spring on the coast of Almeria, the heater on and off in a random sequence. White noise has 1 % of the
# variance of the output after the first day, which warms up. `Ti_clean` is the output without it.
truth <- source("paper_synthetic_truth.R", local = TRUE)$value
record <- synthetic_weather(days = 5, seed = 1)
record$RHP <- rolbs(nrow(record), power = 100, seed = 1)
record$Ti_clean <- simulate_zone(truth$simulator, t(truth$values), as.matrix(record[-1]), step_s = 900)[, 1]
noise <- with_seed(1, rnorm(nrow(record)))
record$Ti <- record$Ti_clean + sqrt(0.01 * var(record$Ti_clean[record$hour > 24])) * noise
record
