write_folder <- function(inputs, sims, obs = 20 + 0.5 * te, bc = cbind(Te = te), header = FALSE) {
  folder <- withr::local_tempdir(.local_envir = parent.frame())
  tables <- list(obs = obs, bc = bc, inputs = inputs, sims = sims)
  for (name in names(tables)) {
    utils::write.table(as.data.frame(tables[[name]]), file.path(folder, paste0(name, ".csv")),
                       sep = ",", row.names = FALSE, col.names = header)
  }
  folder
}

te <- 5 + sin(1:48 / 4)
relative <- cbind(gain = c(0, -1, -0.5, 0.2, 0.6, 1), offset = c(0, 0.3, -1, 1, 0.1, -0.4))
parameters <- list(free("gain", uniform(0, 1)), free("offset", uniform(10, 30)))
run <- function(x) outer(te, (1 + x[, 1]) / 2) + rep(20 + 10 * x[, 2], each = 48)

test_that("a folder of four tables becomes data, design and runs", {
  files <- read_calibro(write_folder(relative, run(relative)), parameters, relative = TRUE,
                        step_h = 0.5)
  expect_equal(files$design,
               cbind(gain = (1 + relative[, 1]) / 2, offset = 20 + 10 * relative[, 2]))
  expect_equal(files$outputs, run(relative))
  expect_equal(files$data, data.frame(hour = 1:48 / 2, target = 20 + 0.5 * te, bc1 = te))
  m <- measurements(files$data, "hour", "target", files$boundary, noise_sd = 0.1)
  expect_s3_class(ensemble(files$design, files$outputs, parameters, measurements = m),
                  "amiss_ensemble")
  named <- read_calibro(write_folder(relative[-1, ], run(relative)[, -1], header = TRUE))
  expect_equal(named$boundary, "Te")
  expect_equal(named$design, relative[-1, ])
})

test_that("the base case is left out where it is no run of the design", {
  expect_message(files <- read_calibro(write_folder(relative, run(relative)[, -1]), parameters,
                                       relative = TRUE), "base case")
  expect_equal(dim(files$design), c(5, 2))
  expect_equal(files$outputs, run(relative)[, -1])
  absolute <- rbind(0, cbind((1 + relative[, 1]) / 2, 20 + 10 * relative[, 2])[-1, ])
  expect_message(files <- read_calibro(write_folder(absolute, run(relative)), parameters),
                 "base case")
  expect_equal(unname(files$design), absolute[-1, ])
  expect_equal(files$outputs, run(relative)[, -1])
  expect_no_message(files <- read_calibro(write_folder(relative, run(relative))))
  expect_equal(unname(files$design), unname(relative))
})

test_that("the files may have other names", {
  folder <- write_folder(relative, run(relative))
  file.rename(file.path(folder, "obs.csv"), file.path(folder, "room_obs.csv"))
  elsewhere <- withr::local_tempfile(fileext = ".csv")
  file.rename(file.path(folder, "sims.csv"), elsewhere)
  files <- read_calibro(folder, files = list(obs = "room_obs.csv", sims = elsewhere))
  expect_equal(files$outputs, run(relative))
  expect_error(read_calibro(folder, files = list(observed = "obs.csv")), "unknown option.*observed",
               class = "amiss_error_input")
  expect_error(read_calibro(folder, files = list(obs = c("a", "b"))), "files\\$obs",
               class = "amiss_error_input")
})

test_that("tables that do not fit are refused", {
  refused <- function(folder, what, ...)
    expect_error(read_calibro(folder, ...), what, class = "amiss_error_input")
  refused(write_folder(relative, run(relative)[-1, ]),
          "unequal length.*48 rows, bc.csv 48 and sims.csv 47")
  refused(write_folder(relative, run(relative)[, 1:3]), "6 rows and sims.csv 3 columns")
  refused(write_folder(relative, run(relative), obs = cbind(te, te)), "2 columns; one is expected")
  refused(write_folder(relative[-1, ], run(relative)[, -1]), "2 columns, `parameters` 1",
          parameters = parameters[1])
  refused(write_folder(relative, run(relative)), "relative.*need", relative = TRUE)
  refused(write_folder(3 * relative, run(relative)), "between -1 and 1", parameters = parameters,
          relative = TRUE)
  refused(write_folder(relative, run(relative)), "finite limits", relative = TRUE,
          parameters = list(free("gain", normal(0, 1)), parameters[[2]]))
  refused(tempfile(), "folder")
  folder <- write_folder(relative, run(relative))
  writeLines(c("1", "two", "3"), file.path(folder, "obs.csv"))
  refused(folder, "obs.csv.*holds \"two\" in row 2")
  unlink(file.path(folder, "obs.csv"))
  refused(folder, "obs.csv.*does not exist")
})

test_that("a row with more fields than the line of names is refused", {
  folder <- write_folder(seq(-1, 1, 0.5), matrix(0, 48, 5))
  for (lines in list(c("Te,Gv", paste(1:48, 1:48, 1:48, sep = ",")),
                     c("Te,Gv", rep("1,2", 46), "1", "1,2"))) {
    writeLines(lines, file.path(folder, "bc.csv"))
    expect_error(read_calibro(folder), "bc.csv.* in line .* in line 1", class = "amiss_error_input")
  }
})
