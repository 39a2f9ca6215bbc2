# Evidence against closed forms and quadrature, on the cases of bench/evidence.R: a few repeats of
# each here, the whole table where AMISS_EXTENDED_TESTS is "true". The cases lie in the source tree,
# not in the package.
skip_on_cran()  # second tier: tools/test --quick
extended <- identical(Sys.getenv("AMISS_EXTENDED_TESTS"), "true")
cases_file <- testthat::test_path("..", "..", "bench", "evidence", "cases.R")

test_that("the evidence of every known case is as required, and the stated interval holds it", {
  skip_if_not(file.exists(cases_file), "the benchmark's cases are not here")
  bench <- new.env(parent = globalenv())
  sys.source(cases_file, bench)
  repeats <- if (extended) 23 else 4
  runs <- lapply(bench$evidence_cases(), function(case) {
    own <- do.call(rbind, lapply(seq_len(repeats), function(seed) bench$evidence_run(case, seed)))
    row <- bench$evidence_row(case, own)
    # The bound is one on the bias; the mean of few repeats strays from it by chance, here by two
    # standard errors.
    chance <- if (extended) 0 else 2 * row$sd / sqrt(repeats)
    expect_lt(abs(row$bias), row$required + chance,
              label = sprintf("bias of %s in %d dimensions", case$name, case$d))
    expect_true(all(own$trusted),
                label = sprintf("%s in %d dimensions is trusted", case$name, case$d))
    own
  })
  covered <- do.call(rbind, runs)$inside
  # Binomial(36, 0.95) falls below 30 with probability 0.004.
  if (extended) expect_true(mean(covered) >= 0.90 && mean(covered) <= 0.98)
  else expect_gte(sum(covered), 30)
})
