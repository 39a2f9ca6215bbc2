# The files of a model, copied into each run.
skip_on_os("windows")

# A folder of a model: a script, a template in a subfolder, a binary file, a hidden file.
model_folder <- function(frame = parent.frame()) {
  folder <- withr::local_tempdir(.local_envir = frame)
  dir.create(file.path(folder, "cfg"))
  writeLines(c("cat cfg/walls.con cfg/.hidden > all.txt",
               "echo Ti; tail -n 1 cfg/walls.con; cat cfg/.hidden"), file.path(folder, "run.sh"))
  Sys.chmod(file.path(folder, "run.sh"), "755")
  writeLines(c("# {{not a placeholder here", "{{k:%.3f}}"), file.path(folder, "cfg", "walls.con"))
  writeLines("7", file.path(folder, "cfg", ".hidden"))
  writeBin(as.raw(c(0:255, 13, 10, 0)), file.path(folder, "climate.bin"))
  folder
}

house <- function(folder, command = c("sh", "run.sh"), templates = "cfg/walls.con", ...,
                  frame = parent.frame()) {
  program_simulator(command, free("k", uniform(1, 2)), files = folder, templates = templates,
                    output = c(file = "stdout.txt", column = "Ti"),
                    cache = withr::local_tempdir(.local_envir = frame), ...)
}

two_rows <- matrix(0, 2, 0)

test_that("a folder is copied byte for byte, and only the templates named in it are filled in", {
  folder <- model_folder()
  dir.create(file.path(folder, "tmp", "deep"), recursive = TRUE)
  program <- house(folder, keep = 1)
  expect_equal(simulate_runs(program, cbind(k = 1.5), two_rows, 1)[, 1], c(1.5, 7))
  kept <- dir(program$cache, "^kept-", full.names = TRUE)
  expect_identical(file_bytes(file.path(kept, "climate.bin")),
                   file_bytes(file.path(folder, "climate.bin")))
  expect_identical(readLines(file.path(kept, "cfg", "walls.con"))[2], "1.500")
  expect_true(dir.exists(file.path(kept, "tmp", "deep")))
  expect_match(printed(program), "4 files of the model")
})

test_that("a program of the folder is started there", {
  folder <- model_folder()
  writeLines(c("#!/bin/sh", readLines(file.path(folder, "run.sh"))), file.path(folder, "run.sh"))
  for (word in c("./run.sh", "run.sh")) {
    expect_equal(simulate_runs(house(folder, word), cbind(k = 1.25), two_rows, 1)[, 1], c(1.25, 7))
  }
})

test_that("the contents of the files count, and a change of them is told", {
  folder <- model_folder()
  program <- house(folder)
  simulate_runs(program, cbind(k = 1.5), two_rows, 1)
  writeLines("8", file.path(folder, "cfg", ".hidden"))
  expect_error(simulate_runs(program, cbind(k = 1.5), two_rows, 1), ".hidden.*has changed.*again",
               class = "amiss_error_input")
  again <- house(folder)
  again$cache <- program$cache
  expect_equal(simulate_runs(again, cbind(k = 1.5), two_rows, 1)[, 1], c(1.5, 8))
  unlink(file.path(folder, "climate.bin"))
  expect_error(simulate_runs(again, cbind(k = 1.5), two_rows, 1), "climate.bin.*not there any more",
               class = "amiss_error_input")
})

test_that("single files are copied under their names or those given", {
  folder <- model_folder()
  files <- c(file.path(folder, "run.sh"), "cfg/walls.con" = file.path(folder, "cfg", "walls.con"),
             "cfg/.hidden" = file.path(folder, "cfg", ".hidden"))
  expect_equal(simulate_runs(house(files), cbind(k = 1.5), two_rows, 1)[, 1], c(1.5, 7))
})

test_that("a mechanism edits a file of the folder that was no template", {
  program <- house(model_folder())
  more <- with_template(program,
                        list(run.sh = function(lines) sub("cat cfg/.hidden$", "echo {{e}}", lines)),
                        free("e", uniform(3, 4)))
  expect_equal(simulate_runs(more, cbind(k = 1.5, e = 3.5), two_rows, 1)[, 1], c(1.5, 3.5))
})

test_that("files and templates that cannot be are refused before anything is executed", {
  folder <- model_folder()
  refused <- function(code, pattern) expect_error(code, pattern, class = "amiss_error_input")
  refused(house("nowhere"), "nowhere.*not there")
  refused(house(c(file.path(folder, "run.sh"), file.path(folder, "cfg"))),
          "cfg.*a folder among files")
  refused(house(withr::local_tempdir()), "holds no files")
  refused(house(c(file.path(folder, "run.sh"), file.path(folder, "run.sh"))), "two files for")
  refused(house(c("../run.sh" = file.path(folder, "run.sh"))), "run's directory")
  refused(house(folder, templates = "cfg/roof.con"), "cfg/roof.con.*none of the 4 files")
  refused(house(folder, templates = file.path(folder, "run.sh")), "run's directory")
  refused(house(folder, templates = "../run.sh"), "run's directory")
  refused(house(folder, templates = list(a.txt = file.path(folder, "cfg"))), "a folder is no file")
  refused(house(folder, templates = list("cfg/walls.con", "cfg/walls.con" = I("{{k}}"))), "twice")
  refused(house(folder, drivers = "run.sh"), "itself writes 'run.sh'")
  file.symlink("nowhere", file.path(folder, "broken"))
  refused(house(folder), "broken.*no regular file")
})

test_that("one run's folder is made to look at, and nothing runs", {
  program <- house(model_folder())
  folder <- file.path(withr::local_tempdir(), "look")
  expect_message(commands <- render_run(program, c(k = 1.75), folder), "sh run.sh",
                 class = "amiss_message_render")
  expect_identical(commands, "sh run.sh")
  expect_setequal(dir(folder, recursive = TRUE, all.files = TRUE),
                  c("run.sh", "climate.bin", "cfg/walls.con", "cfg/.hidden"))
  expect_identical(readLines(file.path(folder, "cfg", "walls.con"))[2], "1.750")
  expect_error(render_run(program, c(k = 1.75), folder), "not empty", class = "amiss_error_input")
  expect_error(render_run(program, c(j = 1), tempfile()), "value for each parameter",
               class = "amiss_error_input")
  m <- measurements(small_record(48), time = "time", target = "Ti", boundary = ~Te, noise_sd = 0.05)
  driven <- house(model_folder(), boundary = "Te")
  folder <- file.path(withr::local_tempdir(), "driven")
  suppressMessages(render_run(driven, folder = folder, measurements = m))
  expect_identical(dim(utils::read.csv(file.path(folder, "drivers.csv"))), c(48L, 3L))
  expect_identical(readLines(file.path(folder, "cfg", "walls.con"))[2], "1.500")
  expect_error(render_run(driven, folder = tempfile(), measurements = m, segment = 9), "segment",
               class = "amiss_error_input")
})
