# Equation (6): single values, and posterior with evidence; each case of the latter in a process of
# its own, as only a process knows the most memory it held. That of 384 steps is run with eight
# seeds: the mean time, and the worst of the rest.

r <- micro("micro_kernel", "dense|cholesky|skeleton|low_rank")
scaled("equation (6), dense value, N = 384", r[["kernel/dense/384"]]$seconds, "ms")
measured("the same over one Cholesky factor (with kernel fill)",
         r[["kernel/dense/384"]]$seconds / r[["kernel/cholesky/384"]]$seconds, "")
scaled("equation (6), value from a skeleton, N = 384", r[["kernel/skeleton/384"]]$seconds, "ms",
       0.5)
scaled("equation (6), value from a skeleton, N = 5760", r[["kernel/skeleton/5760"]]$seconds, "ms",
       0.5)
scaled("equation (6), value at low rank, N = 5760", r[["kernel/low_rank/5760"]]$seconds, "ms")
required <- c("384/3" = 1, "5760/3" = 10, "5760/5" = 180, "8760/3" = 30, "11520/3" = 30)
for (case in names(required)) {
  s <- micro("micro_kernel", paste0("sampling/", case, "/"))[[1]]
  n <- as.numeric(sub("/.*", "", case))
  told <- sprintf("posterior and evidence, N = %d, %s conditions act", n, sub(".*/", "", case))
  scaled(told, s$seconds, "s", required[[case]])
  measured(paste0(told, ": standard error"), s$standard_error, "nat", 0.05)
  measured(paste0(told, ": effective draws"), s$effective_draws, "", 400, above = TRUE)
  measured(paste0(told, ": likelihood values"), s$values, "", 10000)
  measured(paste0(told, ": largest error of a certified draw"), s$largest_error, "nat", 0.05)
  measured(paste0(told, ": estimate and frozen run apart, over the latter's error"),
           s$annealed_apart, "", 3)
  if (!is.null(s$spread))
    measured(paste0(told, ": spread of the estimates over the stated error"), s$spread, "")
  measured(paste0(told, ": most memory held"), s$peak_memory, "MB", if (n >= 8760) 200 else NA)
}
