# How cost grows: time against the sizes of a problem, the exponent fitted to its upper half, and
# the limit: the flops of the factorisations at the rate that this machine reaches for them or,
# against threads, the time of one shared by all. Where a stage is more than three times from it:
# small matrices do not reach the rate of large ones, and what is no factorisation counts (the
# emulator's exponentials and its gradient by each parameter, the gathering of the history model's
# matrix, the filter that whitens the record, a recursion in time); of many threads all but one wait
# while the basis is made, modes are sought, and the sampler draws, resamples and fits.

rate <- micro("micro_machine")
dpotrf <- stats::approxfun(log(c(50, 100, 200, 384, 1000, 2000)),
                           log(vapply(c(50, 100, 200, 384, 1000, 2000), function(n) {
  rate[[paste0("machine/dpotrf/", n)]]$flops
}, 0)), rule = 2)
potrf_rate <- function(n) exp(dpotrf(log(n)))
gemm_rate <- gflops * 1e9

power_of <- function(at, value) {
  upper <- length(at) < 3 | at >= stats::median(at)
  stats::coef(stats::lm(log(value[upper]) ~ log(at[upper])))[[2]]
}
series <- list()
against <- function(stage, size, of, at, seconds, limit = rep(NA_real_, length(at))) {
  exponent <- power_of(at, seconds)
  title <- sprintf("%s\nagainst %s (%s): as its power %.2f", stage, size, of, exponent)
  series[[length(series) + 1]] <<- data.frame(title = title, at = at, seconds = seconds,
                                              limit = limit)
  measured(sprintf("%s against %s: exponent", stage, size), exponent, "")
  last <- length(at)
  scaled(sprintf("%s, %s = %s", stage, size, format(at[last], big.mark = ",")), seconds[last],
         if (seconds[last] < 1e-3) "us" else "ms")
  if (!is.na(limit[last])) measured(sprintf("%s over its limit, %s = %s", stage, size,
                                            format(at[last], big.mark = ",")),
                                    seconds[last] / limit[last], "")
}
least_seconds <- function(at, job)
  vapply(at, function(x) min(replicate(3, system.time(job(x))[["elapsed"]])), 0)
seconds_of <- function(r, prefix, at, after = "")
  vapply(
    at,
    function(n) r[[paste0(prefix, "/", format(n, scientific = FALSE, trim = TRUE), after)]]$seconds,
    0)

# Per value and gradient of the emulator's density: a factor and an inverse, M^3 flops in all.
density_limit <- function(m) m^3 / 3 / potrf_rate(m) + 2 * m^3 / 3 / gemm_rate
emulator <- micro("micro_emulator")
m <- c(50, 100, 200, 500, 1000, 2000)
against("emulator, density and gradient", "runs M", "P = 8", m,
        seconds_of(emulator, "emulator/density", m, "/8"), density_limit(m))
p <- c(3, 5, 10, 20, 40)
against("emulator, density and gradient", "parameters P", "M = 200", p,
        seconds_of(emulator, "emulator/density/200", p), rep(density_limit(200), length(p)))
# A search for each coefficient: of one vector at least, and of the runs' means. The runs are waves
# whose number of coefficients has no end.
set.seed(1)
design <- matrix(stats::runif(200 * 8), 200, dimnames = list(NULL, paste0("p", 1:8)))
waves <- ensemble(design, sin(tcrossprod(matrix(stats::runif(100 * 8, 0, 3), 100), design)))
trained <- function(q, threads = 1)
  train_emulator(waves, 0, list(explained = 1, max_vectors = q), threads)
q <- c(2, 4, 8, 16, 32)
against("emulator, training", "coefficients Q", "M = 200, P = 8", q, least_seconds(q, trained),
        vapply(q, function(q) trained(q)$evaluations, 0) * density_limit(200))
at <- c(50, 200, 384, 1000, 2000)
against("emulator, prediction at 64 points", "runs M", "P = 8", at,
        seconds_of(emulator, "emulator/prediction", at), 64 * at^2 / gemm_rate)

history <- micro("micro_history", "setup/(384|1440|5760|52560)$|conditions|likelihood")
n <- c(384, 1440, 5760, 52560)
against("history model, set-up of one error", "time steps N", "p = 49", n,
        seconds_of(history, "history/setup", n), n * (55^2 + 2 * 6 * 55) / gemm_rate)
n <- c(384, 5760, 525600)
against("history model, likelihood and gradient", "time steps N", "p = 49", n,
        seconds_of(history, "history/likelihood", n))
s <- c(2, 4, 8, 16, 32, 40)
columns <- 7 * s
against("history model, likelihood and gradient", "conditions S", "7 columns each", s,
        seconds_of(history, "history/conditions", s),
        columns^3 / 3 / potrf_rate(columns) + columns^3 / 3 / gemm_rate)
kernel <- micro("micro_kernel", "dense/(96|384|1536)$|skeleton|low_rank")
n <- c(96, 384, 1536)
against("equation (6), dense value", "time steps N", "S = 5", n,
        seconds_of(kernel, "kernel/dense", n), n^3 / 3 / potrf_rate(n))
n <- c(384, 1536, 5760)
against("equation (6), value at low rank", "time steps N", "S = 5", n,
        seconds_of(kernel, "kernel/low_rank", n))

weather <- as.matrix(
  cbind(synthetic_weather(days = 14, step_h = 0.25, seed = 1)[c("Te", "Gv", "Ws", "Wd")], RHP = 50))
box <- paper_box("M3")
middle <- vapply(zone_parameters(box), function(p) (p$prior$lower + p$prior$upper) / 2, 0)
runs <- c(25, 50, 100, 200)
simulated <- function(n, threads = 1) {
  values <- matrix(middle, n, length(middle), byrow = TRUE, dimnames = list(NULL, names(middle)))
  simulate_zone(box, values, weather, step_s = 900, threads = threads)
}
against("zone simulator, 14 days of quarters", "runs", "one thread", runs,
        least_seconds(runs, simulated))

# Chains alone: no second estimator, and no more groups for the sake of precision.
record <- read_study(system.file("studies", "paper_synthetic.yml", package = "amiss"))$measurements
six <- train_emulator(simulate_design(box, record, 150, seed = 1), record)
calibrated <- function(threads = 1, ais = list())
  calibrate(six, record, list(ais = ais), seed = 1, threads = threads)
in_group <- 32 * 2^(0:5)
against("calibrate()", "chains", "8 groups", 8 * in_group,
        least_seconds(in_group, function(chains) {
          calibrated(ais = list(chains = chains, max_groups = 8, importance_draws = 0))
        }))

# What is independent goes to the threads: coefficients, groups of chains, runs of the simulator.
cores <- parallel::detectCores()
threads <- unique(c(2^seq(0, log2(cores)), cores))
shared <- function(stage, of, job) {
  seconds <- least_seconds(threads, job)
  against(stage, "threads", of, threads, seconds, seconds[1] / threads)
}
if (cores > 1) {
  shared("emulator, training", "M = 200, Q = 32", function(threads) trained(32, threads))
  shared("calibrate()", "as by default", calibrated)
  shared("zone simulator, 14 days of quarters", "200 runs",
         function(threads) simulated(200, threads))
}

# Memory of the history model's set-up: one process for each length, as only a process knows the
# most it held.
n <- c(5760, 52560, 525600)
peak <- vapply(n, function(n) {
  micro("micro_history", sprintf("setup/%s$", format(n, scientific = FALSE)))[[1]]$peak_memory
}, 0)
for (i in seq_along(n)) {
  measured(sprintf("history model, most memory held (data included), N = %s",
                   format(n[i], big.mark = ",")),
           peak[i], "MB", if (n[i] == 525600) 1000 else NA)
}
measured("history model, most memory held against time steps N: exponent", power_of(n, peak), "")

table <- do.call(rbind, series)
what_limits <- paste("limit: flops of the factorisations at this machine's rate;",
                     "for threads, the time of one shared by all")
table$title <- factor(table$title, unique(table$title))
figure <- ggplot2::ggplot(table, ggplot2::aes(.data$at, 1e3 * .data$seconds)) +
  ggplot2::geom_line(ggplot2::aes(y = 1e3 * .data$limit, colour = what_limits), linetype = 2,
                     na.rm = TRUE) +
  ggplot2::geom_line(ggplot2::aes(colour = "measured")) +
  ggplot2::geom_point(ggplot2::aes(colour = "measured"), size = 2) +
  # so that what hardly changes looks like it
  ggplot2::geom_blank(ggplot2::aes(y = 3e3 * .data$seconds)) +
  ggplot2::geom_blank(ggplot2::aes(y = 3e2 * .data$seconds)) +
  ggplot2::facet_wrap("title", scales = "free", ncol = 3) +
  ggplot2::scale_x_log10(
    breaks = function(x) Filter(function(b) b == round(b), scales::breaks_log()(x)),
    labels = function(x) format(x, big.mark = ",", scientific = FALSE, trim = TRUE)) +
  ggplot2::scale_y_log10(labels = function(x) format(x, big.mark = ",", scientific = FALSE,
                                                     trim = TRUE, drop0trailing = TRUE)) +
  ggplot2::scale_colour_manual(NULL, values = stats::setNames(c("#08519C", "grey45"),
                                                              c("measured", what_limits))) +
  ggplot2::labs(x = NULL, y = "milliseconds", title = "How the cost of each stage grows") +
  ggplot2::theme_minimal(base_size = 11) +
  ggplot2::theme(legend.position = "top", panel.grid.minor = ggplot2::element_blank(),
                 plot.title.position = "plot")
ggplot2::ggsave(sub("\\.json$", "-growth.png", out), figure, width = 12, height = 16, dpi = 110,
                bg = "white")
