# Whatever is given to an exported function is refused by a condition of the package, or gives a
# right result: see helper-generated-input.R. AMISS_EXTENDED_TESTS=true tries all of it.
skip_on_cran()  # second tier: tools/test --quick

wrong_outcomes <- function(rows, calls) {
  withr::local_dir(withr::local_tempdir())  # some values name files
  stand_in(render_report = no_report)
  outcomes <- vapply(rows, generated_outcome, "", calls)
  paste(vapply(rows, row_words, "", calls), outcomes)[nzchar(outcomes)]
}

test_that("every exported function has a good call, which is accepted", {
  calls <- generated_calls()
  exports <- setdiff(getNamespaceExports("amiss"), c("circular", "decision_rules", "slopes"))
  expect_identical(setdiff(exports, names(calls)), character())
  stand_in(render_report = no_report)
  refused <- Filter(function(f) !is.null(called(f, unclass(calls[[f]]))$refused),
                    setdiff(names(calls), "report_fragment"))
  expect_identical(refused, character())
})

test_that("hostile values are refused by a condition of the package, or change nothing", {
  calls <- generated_calls()
  rows <- generated_rows(calls)
  expect_gt(length(rows), 40000)
  if (!nzchar(Sys.getenv("AMISS_EXTENDED_TESTS"))) rows <- spread_rows(rows, 600)
  expect_gt(length(unique(vapply(rows, row_words, "", calls))), 550)
  expect_identical(wrong_outcomes(rows, calls), character())
})

# ---- files and the command

# What YAML can write of the hostile values, and some that only it has.
hostile_fields <- function() {
  writable <- function(x) {
    plain <- is.null(x) ||
      (is.numeric(x) || is.logical(x) || is.character(x)) && !is.object(x) && is.null(dim(x))
    plain && (!is.character(x) || all(validEnc(x) & Encoding(x) != "bytes"))
  }
  c(Filter(writable, hostile_values),
    list(mapping = list(a = 1, b = "x"), nested = list(list(list(1))), empty = list(),
         date = "2024-02-30", octal = "017"))
}

test_that(
  "a study file with any field replaced is refused by a condition of the package, or done", {
  stand_in(upgrade_model = function(...) structure(list(models = list()), class = "no_upgrade"))
  fields <- setdiff(unlist(study_fields, use.names = FALSE), c("models", "method", "truth"))
  rows <- expand.grid(field = fields, value = seq_along(hostile_fields()), stringsAsFactors = FALSE)
  expect_gt(nrow(rows), 700)
  rows <- spread_rows(unname(split(rows, seq_len(nrow(rows)))),
                      if (nzchar(Sys.getenv("AMISS_EXTENDED_TESTS"))) Inf else 80)
  wrong <- vapply(rows, function(row) {
    path <- bad_study(stats::setNames(hostile_fields()[row$value], row$field))
    told <- called("run_study", list(path = path, quiet = TRUE, trust = TRUE))$refused
    if (is.null(told) || inherits(told, "amiss_error")) return("")
    paste(row$field, names(hostile_fields())[row$value], class(told)[1], conditionMessage(told))
  }, "")
  expect_identical(wrong[nzchar(wrong)], character())
})

test_that("the command ends any words with a status, and says why", {
  words <- c("", " ", "run", "walk", "-", "--", "--out", "--out=", "--seed", "--seed=x",
             "--seed=1e99", "--threads=-1", "--help=1", "-h", "--version", "{x}", "a\nb", "\u00e9",
             strrep("a", 1e4), "--trust", "--nonsense", "/dev/null", tempdir(), "--out=/dev/null/x",
             bad_study(list(runs = -1)))
  withr::local_dir(withr::local_tempdir())
  statuses <- withr::with_seed(1, vapply(1:80, function(i) {
    given <- c(if (i %% 2) "run", sample(words, sample(0:4, 1), replace = TRUE))
    suppressWarnings(suppressMessages(utils::capture.output(status <- run_command(given))))
    as.numeric(status)
  }, 0))
  expect_true(all(statuses %in% 0:2) && all(c(0, 2) %in% statuses))
})

test_that(
  "a table whose bytes or lines are changed is read, or refused by a condition of the package", {
  changes <- testthat::test_path("..", "..", "bench", "fuzz_files", "changes.R")
  skip_if_not(file.exists(changes), "the package's sources")
  changed <- new.env()
  sys.source(changes, changed)
  path <- withr::local_tempfile(fileext = ".csv")
  utils::write.csv(bad_input_objects()$record, path, row.names = FALSE)
  good <- readBin(path, "raw", file.size(path))
  wrong <- withr::with_seed(1, vapply(1:80, function(i) {
    writeBin(changed$changed_bytes(good, list(good)), path)
    tryCatch({
      suppressWarnings(
        suppressMessages(linear_measurements(read_table_file(path, c("hour", "Ti", "Te", "Gv")))))
      ""
    }, amiss_error = function(e) "", error = function(e) paste(i, class(e)[1], conditionMessage(e)))
  }, ""))
  expect_identical(wrong[nzchar(wrong)], character())
})

# ---- objects of another version, damaged and faked

read_objects <- function() {
  o <- bad_input_objects()
  quietly <- function(x) suppressWarnings(suppressMessages(x))
  calls <- generated_calls()
  result <- function(f, ...)
    quietly(do.call(exported_function(f), utils::modifyList(calls[[f]], list(...))))
  c(o[c("measurements", "ensemble", "emulator", "fit", "paper", "upgrade", "function_simulator",
        "program")],
    list(joint = result("calibrate_jointly", control = list(calibration = o$calibration)),
         comparison = result("compare_models"), sampled = result("ais"),
         indices = result("sobol_indices"),
         attribution = result("attribute_discrepancy", control = list(surrogates = 19)),
         discrepancy = discrepancy(o$fit)))
}

# Generics for the package's own use, whose callers have looked already.
inner_generics <- c("calibrated_record", "calibrator", "condition_table", "default_control",
                    "figures_of", "free_parameters", "driver_names", "simulate_runs", "result_list",
                    "report_content")

# The methods that read an object of these classes, by name.
readers_of <- function(classes) {
  methods <- getNamespaceInfo("amiss", "S3methods")
  methods <- methods[methods[, 2] %in% classes & !methods[, 1] %in% inner_generics, , drop = FALSE]
  # others were registered by tests
  methods <- methods[vapply(methods[, 3], is.character, NA), , drop = FALSE]
  mget(as.character(methods[, 3]), asNamespace("amiss"))
}

reader_outcome <- function(reader, object, class) {
  told <- tryCatch({
    utils::capture.output(reader(object))
    "accepted"
  }, error = function(e)
    if (inherits(e, class)) "" else paste0("<", class(e)[1], "> ", conditionMessage(e)))
  told
}

test_that("every reader of an object says that it was made by another version, and what to do", {
  objects <- read_objects()
  readers <- lapply(objects, function(object) readers_of(class(object)))
  expect_gt(sum(lengths(readers)), 80)
  for (name in names(objects)) for (reader in names(readers[[name]])) {
    old <- objects[[name]]
    old$format_version <- 2L
    expect_identical(reader_outcome(readers[[name]][[reader]], old, "amiss_error_version"), "",
                     label = reader)
  }
  old <- objects$upgrade
  for (version in list(4, "3", list(), NA)) {
    old$format_version <- version
    expect_identical(reader_outcome(print, old, "amiss_error_version"), "")
  }
  old$format_version <- 2L
  expect_error(print(old),
               "made by another version.*Its format is 2; this version reads 3.*Make it again",
               class = "amiss_error_input")
})

test_that("every reader refuses what is damaged, and no reader stops raw", {
  withr::local_options(cli.progress_show_after = Inf)
  withr::local_pdf(NULL)
  objects <- read_objects()
  rows <- unlist(lapply(names(objects), function(name) {
    damaged <- near_lists(objects[[name]])
    unlist(lapply(names(readers_of(class(objects[[name]]))), function(reader) {
      Map(function(value, what) list(object = name, reader = reader, value = value, what = what),
          damaged, names(damaged))
    }), recursive = FALSE)
  }), recursive = FALSE)
  if (!nzchar(Sys.getenv("AMISS_EXTENDED_TESTS"))) rows <- spread_rows(rows, 150)
  raw <- vapply(rows, function(row) {
    reader <- readers_of(class(objects[[row$object]]))[[row$reader]]
    if (row$reader %in% c("update.amiss_fit", "predict.amiss_emulator")) return("")
    told <- reader_outcome(function(x) suppressWarnings(reader(x)), row$value, "amiss_error")
    if (told %in% c("", "accepted")) "" else paste(row$reader, row$object, row$what, told)
  }, "")
  expect_identical(unname(raw[nzchar(raw)]), character())
})
