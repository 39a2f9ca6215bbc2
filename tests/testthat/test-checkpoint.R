test_that("a kept value is read again, and another key's is not", {
  folder <- withr::local_tempdir()
  made <- 0
  make <- function() {
    made <<- made + 1
    list(made, 1:3)
  }
  keep <- checkpoint_keeper(folder, list(seed = 1))
  expect_identical(keep("a", make()), list(1, 1:3))
  expect_identical(keep("a", make()), list(1, 1:3))
  expect_identical(checkpoint_keeper(folder, list(seed = 1))("a", make()), list(1, 1:3))
  expect_equal(made, 1)
  keep("b", make())
  checkpoint_keeper(folder, list(seed = 2))("a", make())
  expect_equal(made, 3)
  expect_identical(checkpoint_keeper(NULL)("a", 3), 3)
})

test_that("nothing is made before something is kept", {
  folder <- file.path(withr::local_tempdir(), "stages")
  keep <- checkpoint_keeper(folder, list())
  expect_error(keep("a", stop("refused")), "refused")
  expect_false(dir.exists(folder))
})

test_that("a damaged or foreign file counts as absent and is told", {
  folder <- withr::local_tempdir()
  keep <- checkpoint_keeper(folder, list())
  keep("a", as.numeric(1:1000))
  file <- dir(folder, full.names = TRUE)
  whole <- readBin(file, "raw", file.size(file))
  flipped <- readRDS(file)
  flipped$bytes[500] <- xor(flipped$bytes[500], as.raw(1))
  damages <- list(function() writeBin(whole[seq_len(length(whole) / 2)], file),
                  function() writeBin(raw(), file), function() writeLines("mine", file),
                  function() saveRDS(3, file), function() saveRDS(flipped, file),
                  function() saveRDS(pack(4, "another"), file))
  for (damage in damages) {
    damage()
    expect_message(expect_identical(keep("a", 7), 7), "damaged or not from this package",
                   class = "amiss_message_kept")
    expect_silent(expect_identical(keep("a", 8), 7))
  }
})

test_that("what cannot be written is told and does not stop the run", {
  folder <- withr::local_tempdir()
  file <- file.path(folder, "amiss-x.rds")
  short <- function(object, file) writeBin(as.raw(1:9), file)
  full <- function(object, file) stop("no space left")
  for (write in list(short, full)) {
    expect_message(keep_value(1, file, "x", write), "could not be kept",
                   class = "amiss_message_kept")
    expect_length(dir(folder), 0)
  }
  blocked <- file.path(folder, "afile")
  writeLines("", blocked)
  expect_error(checkpoint_keeper(blocked, list()), "is a file", class = "amiss_error_input")
  expect_error(checkpoint_keeper(file.path(blocked, "sub"), list()), "is a file, not a folder",
               class = "amiss_error_input")
  later <- file.path(folder, "later")
  keep <- checkpoint_keeper(later, list())
  writeLines("", later)  # in its place since the run began
  expect_message(expect_equal(keep("a", 5), 5), "could not be kept")
})

test_that("a process killed while it writes leaves nothing that is taken for whole", {
  skip_on_cran()  # second tier: tools/test --quick
  skip_on_os("windows")
  folder <- withr::local_tempdir()
  kill <- paste("function(object, file) { writeBin(as.raw(1:99), file);",
                "tools::pskill(Sys.getpid(), 9); Sys.sleep(9) }")
  code <- sprintf("amiss:::keep_value(1, '%s', 'x', %s)", file.path(folder, "amiss-x.rds"), kill)
  withr::with_envvar(c(R_LIBS = paste(.libPaths(), collapse = ":")), {
    suppressWarnings(system2(file.path(R.home("bin"), "Rscript"), c("-e", shQuote(code)),
                             stdout = FALSE, stderr = FALSE))
  })
  expect_match(dir(folder), "^amiss-part-")
  expect_null(read_kept(file.path(folder, "amiss-x.rds"), "x"))
  writeLines("mine", file.path(folder, "mine.rds"))
  remove_kept(folder)
  expect_equal(dir(folder), "mine.rds")
  unlink(file.path(folder, "mine.rds"))
  remove_kept(folder)
  expect_false(dir.exists(folder))
})

test_that("the key knows what a function captures, and nothing of how it was made", {
  key <- function(x) content_hash(plain(x))
  scaled <- function(by, of = new.env()) {
    helper <- function(x) by * x
    function(x) helper(x) + length(of)
  }
  environment(scaled) <- asNamespace("amiss")  # not the environment of this test, which changes
  expect_equal(key(scaled(2)), key(scaled(2)))
  expect_false(key(scaled(2)) == key(scaled(3)))
  box <- new.env()
  before <- key(list(f = scaled(2, box)))
  box$inside <- 1
  expect_false(key(list(f = scaled(2, box))) == before)
  fast <- scaled(2)
  for (i in 1:3) fast(1)
  expect_equal(key(compiler::cmpfun(fast)), key(scaled(2)))
  expect_equal(key(unserialize(serialize(fast, NULL))), key(fast))
  sourced <- function(text, keep)
    eval(parse(text = text, keep.source = keep), new.env(parent = asNamespace("amiss")))
  expect_equal(key(sourced("a <- 1; function(x) a", TRUE)),
               key(sourced("a <- 1; function(x)   a # note", FALSE)))
  expect_false(key(sourced("a <- 1; function(x) a", TRUE)) ==
               key(sourced("a <- 1 + 1e-15; function(x) a", TRUE)))
  expect_equal(key(1:10), key(c(1L, 2L, 3L, 4L, 5L, 6L, 7L, 8L, 9L, 10L)))
  formula <- function(a) y ~ a
  expect_false(key(formula(1)) == key(formula(2)))
})

test_that("the key knows the globals that a function names", {
  withr::defer(rm(list = c("amiss_test_f", "amiss_test_g"), envir = globalenv()))
  made <- function(by) {
    assign("amiss_test_g", by, globalenv())
    assign("amiss_test_f",
           eval(quote(function(x) if (x > 9) amiss_test_f(x - 1) else amiss_test_g), globalenv()),
           globalenv())
    content_hash(plain(list(eval(quote(function(x) amiss_test_f(x)), globalenv()))))
  }
  expect_equal(made(1), made(1))
  expect_false(made(1) == made(2))
})

test_that("a seed that was drawn is kept with the work, one that was given is not", {
  folder <- file.path(withr::local_tempdir(), "kept")
  expect_identical(kept_seed(7, folder), 7)
  expect_false(dir.exists(folder))
  set.seed(1)
  drawn <- kept_seed(NULL, folder)
  set.seed(1)
  expect_identical(drawn, pick_seed(NULL))
  expect_identical(kept_seed(NULL, folder), drawn)
  expect_identical(kept_seed(8, folder), 8)
  expect_false(kept_seed(NULL, NULL) == drawn)
  remove_kept(folder)
  expect_false(dir.exists(folder))
  expect_error(kept_seed(NULL, file.path(system.file("DESCRIPTION", package = "amiss"), "in")),
               "checkpoint", class = "amiss_error_input")
})

test_that("an edited model does not go on with the old one's work", {
  folder <- withr::local_tempdir()
  m <- linear_measurements(linear_data(60))
  kept <- function(slope) {
    model <- function_simulator(
      function(values, drivers) values[["offset"]] + slope * drivers[, "Te"],
      free("offset", uniform(10, 30)), boundary = "Te")
    checkpoint_keeper(folder, list(m))(list("fit", "base", plain(model)), slope)
  }
  expect_equal(kept(0.4), 0.4)
  expect_equal(kept(0.5), 0.5)
  expect_length(dir(folder), 2)
})

# Of an environment of their own: what a function captures is part of the key.
counted_world <- local({
  run <- function(values, drivers) {
    cat(".", file = getOption("amiss_test_runs"), append = TRUE)
    if (file.size(getOption("amiss_test_runs")) > getOption("amiss_test_alive")) rlang::interrupt()
    values[["offset"]] + values[["gain"]] * drivers[, "Te"]
  }
  sunny <- function(values, drivers, base) base(values) + values[["s"]] * drivers[, "Gv"]
  shine <- function(model) amiss::with_parameters(model, amiss::free("s", amiss::uniform(0, 0.02)),
                                                  boundary = "Gv", f = sunny)
  environment()
}, envir = new.env(parent = globalenv()))

# A loop each of whose runs leaves a byte in `file`; `alive`: runs after which it is interrupted.
counted_upgrade <- function(file, folder, alive = Inf, control = list()) {
  table <- linear_data(60)
  table$Ti <- table$Ti + 0.01 * table$Gv
  m <- linear_measurements(table, calibrate = table$hour <= 42, validate = table$hour > 42)
  base <- function_simulator(counted_world$run, free("offset", uniform(10, 30)),
                             free("gain", uniform(0, 1)), boundary = "Te")
  sun <- mechanism("sun", counted_world$shine, "Gv", "Sun enters.")
  control <- utils::modifyList(list(max_steps = 1, calibration = quick_ais,
                                    attribution = list(surrogates = 19)), control)
  withr::with_options(list(amiss_test_runs = file, amiss_test_alive = alive), {
    upgrade_model(base, m, catalogue(sun), seed = 1, quiet = TRUE, checkpoint = folder,
                  control = control)
  })
}

runs_made <- function(file) sum(file.size(file), na.rm = TRUE)

test_that("a loop that is done is read again: no run is made, and the result is the same", {
  folder <- withr::local_tempdir()
  first <- counted_upgrade(made <- withr::local_tempfile(), folder)
  again <- counted_upgrade(repeated <- withr::local_tempfile(), folder)
  # The simulator is called once where it is checked, and an effect of its steps is looked for.
  expect_lte(abs(runs_made(made) - first$runs_total), 3)
  expect_lte(runs_made(repeated), 3)
  for (part in c("candidates", "gain", "named_cause", "runs_total", "stopped_id")) {
    expect_identical(again[[part]], first[[part]])
  }
  expect_identical(coef(again), coef(first))
})

test_that("a loop that was interrupted makes the runs that are missing, and none twice", {
  whole <- counted_upgrade(withr::local_tempfile(), withr::local_tempdir())
  folder <- withr::local_tempdir()
  dead <- withr::local_tempfile()
  stopped <- tryCatch(counted_upgrade(dead, folder, alive = 40),
                      interrupt = function(e) "interrupted")
  expect_identical(stopped, "interrupted")
  rest <- withr::local_tempfile()
  resumed <- counted_upgrade(rest, folder)
  expect_identical(resumed$candidates, whole$candidates)
  expect_identical(resumed$runs_total, whole$runs_total)
  # The set of runs in which it died is made again: at most twenty-five in the region of a mode.
  expect_lte(runs_made(dead) + runs_made(rest) - whole$runs_total, 25 + 3)
  expect_gt(runs_made(rest), 0)
})

test_that("kept runs count towards the budget as when they were made", {
  folder <- withr::local_tempdir()
  budget <- list(runs_total = 70)
  first <- counted_upgrade(withr::local_tempfile(), folder, control = budget)
  again <- counted_upgrade(withr::local_tempfile(), folder, control = budget)
  expect_lte(first$runs_total, 70)
  expect_gt(first$runs_total, 60)
  expect_identical(again$runs_total, first$runs_total)
  expect_identical(again$stopped_because, first$stopped_because)
})

test_that("a path that no system takes is refused", {
  expect_error(amiss:::check_folder_possible(strrep("a", 1e4), "checkpoint"), "10000",
               class = "amiss_error_input")
})
