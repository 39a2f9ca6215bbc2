# What must hold for every input, tried on many drawn at random.

each_of <- function(n, property) withr::with_seed(1, for (i in seq_len(n)) property(i))

# Anything that somebody could give for an argument.
random_object <- function() {
  n <- sample(0:6, 1)
  draws <- list(
    function() NULL, function() stats::rnorm(n), function() sample(c(TRUE, FALSE, NA), n, TRUE),
    function() c(-Inf, NaN, NA)[sample(3, 1)],
    function() intToUtf8(sample(c(33:126, 0x20ac, 0x1f600), n, TRUE)),
    function() replicate(n, random_object(), simplify = FALSE),
    function() factor(letters[seq_len(n)]), function() Sys.time(),
    function() as.Date("2024-03-01") + n, function() identity, function() globalenv(),
    function() quote(a + b), function() ~ a, function() matrix(0, n, 2),
    function() data.frame(a = seq_len(n)), function() complex(n), function() as.raw(n),
    function() 10^stats::runif(1, -300, 300),
    function() stats::setNames(seq_len(n), letters[seq_len(n)]))
  draws[[sample(length(draws), 1)]]()
}

random_prior <- function() {
  x <- sort(stats::runif(3, -5, 5))
  k <- stats::runif(2, 0.5, 5)
  priors <- list(
    function() uniform(x[1], x[3]), function() normal(x[2], k[1]),
    function() normal(x[2], k[1], lower = x[1], upper = x[3]),
    function() lognormal(x[2] / 5, k[1] / 5),
    function() lognormal(x[2] / 5, k[1], upper = exp(x[3])),
    function() beta_prior(k[1], k[2], x[1], x[3]), function() triangular(x[1], x[2], x[3]))
  priors[[sample(length(priors), 1)]]()
}

test_that("quantiles of a prior are the inverse of its probabilities, within its limits", {
  each_of(50, function(i) {
    prior <- random_prior()
    u <- sort(stats::runif(20, 0.001, 0.999))
    x <- prior_quantile(prior, u)
    expect_equal(prior_cdf(prior, x), u, tolerance = 1e-6)
    expect_false(is.unsorted(x))
    expect_true(all(x >= prior$lower & x <= prior$upper))
    inside <- prior_quantile(prior, c(0.2, 0.7))
    mass <- stats::integrate(function(v) prior_density(prior, v), inside[1], inside[2],
                             rel.tol = 1e-8)$value
    expect_equal(mass, 0.5, tolerance = 1e-5)
  })
})

test_that("any object is told in a few words, and refused in the package's own", {
  skip_on_cran()
  each_of(60, function(i) {
    x <- random_object()
    expect_true(checkmate::test_string(seen(x), min.chars = 1))
    expect_lt(nchar(seen(x)), 100)
    for (make in list(function() uniform(x, 1e9), function() merge_control(list(a = 1), x),
                      function() free(x, uniform(0, 1)), function() zone_layer(0.1, x, 1),
                      function() check_simulator(x), function() ensemble(x, x),
                      function() catalogue(x))) {
      made <- tryCatch(make(), error = identity)
      expect_true(!inherits(made, "error") || inherits(made, "amiss_error_input"),
                  info = deparse1(x))
    }
  })
})

test_that("options that are not given stay as they were", {
  each_of(20, function(i) {
    given <- ais_defaults_()[sample(length(ais_defaults_()), sample(0:5, 1))]
    merged <- merge_control(ais_defaults_(), given)
    expect_identical(merged, ais_defaults_())
    expect_identical(merge_control(ais_defaults_(), merged), merged)
  })
})

test_that("a seed decides, other seeds differ, and R's own generator goes on as it was", {
  seeds <- c(0, 1, 2, .Machine$integer.max - 1, .Machine$integer.max)
  drawn <- vapply(seeds, function(seed) with_seed(seed, stats::runif(1)), 0)
  expect_identical(anyDuplicated(drawn), 0L)
  expect_identical(drawn, vapply(seeds, function(seed) with_seed(seed, stats::runif(1)), 0))
  set.seed(3)
  first <- stats::runif(1)
  set.seed(3)
  with_seed(5, stats::runif(10))
  expect_identical(stats::runif(1), first)
})

test_that("averages keep the mean of what they hold, wherever time begins", {
  each_of(20, function(i) {
    data <- linear_data(240)
    start <- 24 * sample(0:1000, 1)
    width <- sample(c(2, 3, 4, 6), 1)
    data$hour <- data$hour + start
    m <- linear_measurements(data, average = width)
    moved <- linear_measurements(linear_data(240), average = width)
    expect_equal(mean(m$y), mean(data$Ti[seq_len(width * length(m$y))]))
    expect_equal(m$y, moved$y)
    expect_equal(m$hours - start, moved$hours)
  })
})

test_that("the order of a design's columns and runs makes no difference to an ensemble", {
  world <- simulate_design(linear_simulator(), linear_measurements(linear_data(60)), runs = 20,
                           seed = 1)
  each_of(20, function(i) {
    runs <- sample(20)
    columns <- sample(2)
    parameters <- unname(world$parameters)
    made <- ensemble(world$values[runs, columns], world$outputs[, runs], parameters)
    expect_equal(made$values[order(runs), ], world$values)
    expect_equal(made$unit[order(runs), ], world$unit, ignore_attr = TRUE)
    expect_equal(made$outputs[, order(runs)], world$outputs)
  })
})

test_that("no text of a study file or of a condition gets past the checks", {
  path <- withr::local_tempfile(fileext = ".yml")
  alphabet <- c(letters[1:4], "study", "data", ":", " ", "\n", "-", "[", "]", "{", "}", "!", "&a",
                "*a", "#", "'", "\"", "|", "%", "~", "1e9", "yes")
  data <- data.frame(hour = 1:6, a = 1)
  each_of(60, function(i) {
    text <- paste(sample(alphabet, 30, TRUE), collapse = "")
    writeLines(text, path)
    read <- tryCatch(read_study_file(path), error = identity)
    expect_true(!inherits(read, "error") || inherits(read, "amiss_error_input"), info = text)
    words <- c("hour", "a", "<", "==", "(", ")", "&", "|", "c", ",", "1", "'x'", "system", "{", "}",
               "%in%", "!", "-", "<-", "::", "function")
    condition <- paste(sample(words, 6, TRUE), collapse = " ")
    rows <- tryCatch(row_condition(condition, data, "calibrate"), error = identity)
    expect_true(is.logical(rows) && length(rows) == 6 || inherits(rows, "amiss_error_input"),
                info = condition)
  })
})
