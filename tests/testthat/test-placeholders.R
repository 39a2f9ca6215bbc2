# Arithmetic of parameters in templates, and how numbers are written.

fill <- function(text, ..., width = NULL) {
  values <- c(...)
  fill_text(compile_texts(list(text), names(values))[[1]], values, width, "a template")
}

why_not <- function(text, known = c("k", "C")) {
  tryCatch({
    read_placeholder(text, known)
    ""
  }, error = conditionMessage)
}

test_that("placeholders are arithmetic of parameters", {
  expect_identical(fill("a {{k}} b {{ k }}", k = 0.5), "a 0.5 b 0.5")
  expect_identical(fill("{{k * 2 + C / 1000}}", k = 1.5, C = 500), "3.5")
  expect_identical(fill("{{-k^2}} {{(k + 1)^2}} {{sqrt(C)}}", k = 3, C = 16), "-9 16 4")
  expect_identical(fill("{{min(k, C)}} {{max(k, C, 9)}} {{round(k, 1)}} {{abs(-k)}}", k = 2.26,
                        C = 4), "2.26 9 2.3 2.26")
  expect_equal(as.numeric(fill("{{exp(log(k)) + log10(C)}}", k = 2, C = 100)), 4)
  expect_identical(fill("{{k wall}} {{2 * `k wall`}} {{k wall:%.1f}}", `k wall` = 2), "2 4 2.0")
  expect_identical(fill("{{k}}{{k}}{{2*k}}", k = 1), "112")
})

test_that("nothing but arithmetic is evaluated", {
  touched <- tempfile()
  for (text in c("{{file.create(k)}}", "{{system(k)}}", "{{(function() k)()}}", "{{k[[1]]}}",
                 "{{base::exp(k)}}", "{{k <- 2}}", "{{if (k) 1}}", "{{'a'}}", "{{exp(k)(k)}}",
                 "{{quote(k)}}", "{{TRUE}}")) {
    expect_match(why_not(text), "no arithmetic|no parameter", info = text)
  }
  expect_match(why_not("{{j + k}}"), "j is none")
  expect_match(why_not("{{sqrt()}}"), "arguments of sqrt")
  expect_match(why_not("{{sqrt(k, C)}}"), "arguments of sqrt")
  expect_match(why_not("{{round(x = k)}}"), "arguments of round")
  expect_match(why_not("{{max(k, )}}"), "arguments of max")
  expect_match(why_not("{{k +}}"), "no arithmetic")
  expect_match(why_not(paste0("{{", strrep("(", 2000), "k", strrep(")", 2000), "}}")),
               "no arithmetic")
  expect_match(why_not("{{k:%s}}"), "format %s is not known")
  expect_match(why_not("{{k:%.4f m}}"), "not known")
  expect_match(why_not("{{k:%*d}}"), "not known")
  expect_match(why_not("{{k:0}}"), "not known")
})

test_that("numbers are as short as carries them, and read back", {
  expect_identical(shortest_number(-9.87654321098765e-05), "-9.87654321098765e-5")  # 20 characters
  expect_identical(shortest_number(0.1 + 0.2), "0.3")
  expect_identical(shortest_number(c(1e5, 1e20, -2.5e-9, 0)), c("100000", "1e20", "-2.5e-9", "0"))
  x <- withr::with_seed(1, stats::rnorm(200) * 10^stats::runif(200, -30, 30))
  expect_equal(as.numeric(shortest_number(x)), x, tolerance = 1e-14)
  expect_lte(max(nchar(shortest_number(x))), 21)
})

test_that("formats and widths are kept, or refused", {
  expect_identical(fill("{{k:%.4f}}|{{k:%10.3e}}|{{k:%8.2f}}", k = pi),
                   "3.1416| 3.142e+00|    3.14")
  expect_identical(fill("{{round(k):%d}}|{{round(k):%04d}}", k = 7.4), "7|0007")
  expect_identical(fill("{{k:8}}", k = 1 / 3), "0.333333")
  expect_identical(fill("{{k}} {{k:12}}", k = 1 / 3, width = 9), "0.3333333 0.3333333333")
  expect_identical(fill("{{k:13}}", k = -9.87654321098765e-05), "-9.8765432e-5")
  expect_error(fill("{{k:10}}", k = -9.87654321098765e-05), "6 digits of it do not fit in 10",
               class = "amiss_error_input")
  expect_identical(fill("{{k:6}}", k = -12.5), "-12.5")
  expect_error(fill("{{k:%5.1f}}", k = 123456), "longer than 5 characters",
               class = "amiss_error_input")
  expect_error(fill("{{k:%12.10f}}", k = 1, width = 8), "longer than 8 characters",
               class = "amiss_error_input")
  expect_error(fill("{{k:%d}}", k = 1.5), "no whole number", class = "amiss_error_input")
  expect_error(fill("{{log(k)}}", k = -1), "it is NaN", class = "amiss_error_input")
  expect_error(fill("{{1 / k}}", k = 0), "it is Inf", class = "amiss_error_input")
})

test_that("what a format writes reads back within its precision", {
  x <- withr::with_seed(2, stats::rnorm(100) * 10^stats::runif(100, -8, 8))
  for (format in c("%.3f", "%.6e", "%g", "%.12g", "%+.4e")) {
    for (one in x)
      expect_lte(abs(as.numeric(number_text(one, format)) - one), format_error(one, format))
  }
  expect_identical(format_error(2, "%.2f"), 0.005 + 2e-15)
})

test_that("a placeholder that cannot be written is refused when the simulator is made", {
  made <- function(text, prior = uniform(1, 2)) {
    program_simulator("cat", free("k", prior), output = c(file = "o.csv", column = "a"),
                      templates = list(a.txt = I(text)), cache = tempfile())
  }
  expect_s3_class(made("{{k * 2:%.4f}}"), "amiss_program_simulator")
  expect_error(made("{{k:%4.1f}}", uniform(0, 1e6)), "longer than 4", class = "amiss_error_input")
  expect_error(made("{{k:%d}}"), "no whole number", class = "amiss_error_input")
  expect_error(made("{{k; 1}}"), "a.txt.*no parameter and no arithmetic",
               class = "amiss_error_input")
  expect_error(made("{{unlink(k)}}"), "unlink.k. is not evaluated", class = "amiss_error_input")
  expect_error(made("{{2 * 3}}"), "\"k\" stands in no template", class = "amiss_error_input")
  expect_error(made("{{k + j}}"), "j is none", class = "amiss_error_input")
  expect_error(made("{{log(k)}}", normal(-5, 1)), "it is NaN", class = "amiss_error_input")
})
