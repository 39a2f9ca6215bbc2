# A working directory as ESP-r leaves it: names "what:where", values from -1 to 1, the base case
# first.
esp_directory <- function(env = parent.frame()) {
  folder <- withr::local_tempdir(.local_envir = env)
  withr::local_dir(folder, .local_envir = env)
  record <- linear_data(48)
  design <- rbind(0, withr::with_seed(2, lhs::randomLHS(19, 2) * 2 - 1))
  runs <- outer(rep(1, 48), 20 + 10 * design[, 1]) + outer(record$Te, (1 + design[, 2]) / 2)
  write <- function(x, file, names = FALSE) {
    utils::write.table(x, file, sep = ",", row.names = FALSE, col.names = names, quote = FALSE)
  }
  write(record$Ti, "living_DBTZNOBS_obs.csv")
  write(runs, "living_DBTZNOBS_sim.csv")
  write(record[c("Te", "Gv")], "bc.csv", TRUE)
  write(design, "calibro_input_living.csv", c("ins_cond:all_walls", "infil:living"))
  folder
}

esp_words <- c("-c", "house-living", "-b", "bc.csv", "-i", "calibro_input_living.csv", "-o",
               "living_DBTZNOBS_obs.csv", "-s", "living_DBTZNOBS_sim.csv")

called <- function(...) {
  told <- character()
  said <- utils::capture.output(
    status <- withCallingHandlers(run_calibrino(c(...)), message = function(m) {
      told <<- c(told, conditionMessage(m))
      rlang::cnd_muffle(m)
    }))
  list(status = status, said = paste(said, collapse = "\n"), told = paste(told, collapse = "\n"))
}

# Tags and values as ESP-r's project manager finds them: the first text in quotes of each line and
# what follows.
esp_tags <- function(file) {
  lines <- trimws(readLines(file))
  pairs <- regmatches(lines, regexec("^\"([^\"]+)\": *\"?([^\",]*)", lines))
  pairs <- do.call(rbind, pairs[lengths(pairs) > 0])
  data.frame(tag = pairs[, 2], value = pairs[, 3])
}

test_that("ESP-r's call writes what ESP-r reads", {
  esp_directory()
  result <- called(esp_words, "--fmt", "json", "--res", "cal,sa,train,ds", "--noise", "0.1",
                   "--seed", "1")
  expect_equal(result$status, 0)
  expect_match(result$said, "Calibration on 48 rows")
  written <- jsonlite::read_json("calibro_report.json", simplifyVector = TRUE)
  statistics <- written$CALIBRATION_RESULTS$theta.stats
  expect_named(statistics, c("PARAMETER", "ESTIMATE", "LOWER", "UPPER"))
  expect_equal(statistics$PARAMETER, c("ins_cond.all_walls", "infil.living"))
  expect_equal(statistics$ESTIMATE, c(0, -0.2), tolerance = 0.05)
  expect_true(all(statistics$LOWER < c(0, -0.2) & statistics$UPPER > c(0, -0.2)))
  fitness <- written$CALIBRATED_MODEL_GOF
  record <- linear_data(48)
  expect_equal(fitness[1:2], data.frame(DATASET = "living_DBTZNOBS_obs",
                                        BEFORE = sqrt(mean((record$Ti - 20 - 0.5 * record$Te)^2))),
               tolerance = 1e-6)
  expect_lt(fitness$AFTER, 0.15)  # the noise is 0.1
  expect_equal(written$SENSITIVITY_ANALYSIS$sobol$total,
               c(400, mean(record$Te^2)) / (400 + mean(record$Te^2)), tolerance = 0.05)
  expect_equal(written$TRAINING$runs, 20)
  expect_equal(written$DATA$boundary, c("Te", "Gv"))

  tags <- esp_tags("calibro_report.json")
  read <- grepl("^(calibro|CALIBRO|error|PARAMETER|ESTIMATE|LOWER|UPPER|DATASET|BEFORE|AFTER)",
                tags$tag)
  expect_equal(tags$tag[read], c("CALIBRO", rep(c("PARAMETER", "ESTIMATE", "LOWER", "UPPER"), 2),
                                 "DATASET", "BEFORE", "AFTER"))
  numbers <- tags$value[tags$tag %in% c("ESTIMATE", "LOWER", "UPPER", "BEFORE", "AFTER")]
  expect_false(anyNA(suppressWarnings(as.numeric(numbers))))
  expect_lt(max(which(tags$tag == "UPPER")), which(tags$tag == "DATASET"))
})

test_that(
  "what cannot be calibrated is an error that ESP-r reads, not the report of an earlier call", {
  esp_directory()
  failed <- function(what, ...) {
    writeLines("{}", "calibro_report.json")
    result <- called(...)
    expect_equal(result$status, 1)
    expect_match(gsub("\\s+", " ", result$told), what)
    expect_match(gsub("\\s+", " ", jsonlite::read_json("calibro_report.json")$error), what)
  }
  failed("2 records are given; one is calibrated at a time.*once for each of.*a.csv.*b.csv",
         "-c", "x", "-b", "bc.csv", "-i", "i.csv", "-o", "a.csv,b.csv", "-s", "c.csv,d.csv")
  failed("nowhere.csv.* does not exist", replace(esp_words, 4, "nowhere.csv"))
  writeLines("{}", "calibro_report.json")
  expect_equal(called(replace(esp_words, 4, "nowhere.csv"), "--fmt", "html")$status, 1)
  expect_false(file.exists("calibro_report.json"))
})

test_that("long options are the short ones, and bad usage is told", {
  long <- esp_words
  long[c(1, 3, 5, 7, 9)] <- c("--cal", "--bc", "--input", "--obs", "--sim")
  options <- c("--res", "cal, sa", "--step", "0.5")
  read <- function(...) read_calibrino(c(...), calibrino_parser())
  expect_identical(read(long, options), read(esp_words, options))
  expect_equal(read(long, options)[c("res", "step", "fmt")],
               list(res = c("cal", "sa"), step = 0.5, fmt = "json"))
  refused <- function(what, ...) {
    result <- called(...)
    expect_equal(result$status, 2)
    expect_match(result$told, paste0(what, ".*[Uu]sage: calibrino"))
  }
  refused("'--bc' is needed", "-c", "x")
  refused("names 2 files and '--sim' 1", replace(esp_words, 8, "a,b"))
  refused("'--fmt' does not know 'tex'; it knows json, html and pdf", esp_words, "--fmt",
          "json,tex")
  refused("'--res' does not know 'all'", esp_words, "--res", "all")
  refused("'--step' needs a positive number, not '0'", esp_words, "--step", "0")
  refused("'--noise' needs a positive number, not 'loud'", esp_words, "--noise", "loud")
  refused("'more' belongs to no option", esp_words, "more")
  help <- called("--help")
  expect_equal(help$status, 0)
  expect_match(help$said, "--cal=NAME")
})

test_that("the command runs", {
  command <- system.file("exec", "calibrino", package = "amiss")
  result <- processx::run(file.path(R.home("bin"), "Rscript"), c(command, "-c", "x"),
                          error_on_status = FALSE)
  expect_equal(result$status, 2)
  expect_match(result$stderr, "calibrino: '--bc' is needed")
})
