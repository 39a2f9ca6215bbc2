# What strangers may put into an FMU is refused before anything of it is written or run.
skip_without_fmus()

archive <- function(entries, ..., frame = parent.frame()) {
  write_zip(withr::local_tempfile(fileext = ".fmu", .local_envir = frame), entries, ...)
}

description <- function(...) as_bytes(c(...))

house_xml <- function(version = 2)
  readLines(file.path(fmu_sources, paste0("house", version, ".xml")))

refused <- function(file, pattern)
  expect_error(fmu_variables(file), pattern, class = "amiss_error_fmu")

test_that("a file that is no archive, is cut off or holds no description is refused", {
  file <- withr::local_tempfile()
  refused(file, "no such file")
  refused(tempdir(), "no such file")
  for (bytes in list(raw(), charToRaw("no archive"), charToRaw("PK\005\006"),
                     as.raw(sample(0:255, 5000, TRUE)))) {
    writeBin(bytes, file)
    refused(file, "no zip archive")
  }
  whole <- readBin(house_file(), "raw", 1e6)
  for (part in c(0.1, 0.5, 0.9, 0.999)) {
    writeBin(whole[seq_len(part * length(whole))], file)
    refused(file, "no zip archive|not whole|damaged")
  }
  refused(archive(list(a.txt = charToRaw("a"))), "no .*modelDescription.xml.*no FMU")
})

test_that("names that leave the folder, links, twins and what is encrypted are refused", {
  with <- function(name, ..., frame = parent.frame()) {
    entries <- list(modelDescription.xml = description(house_xml()))
    entries[[name]] <- charToRaw("/etc/passwd")
    archive(entries, ..., frame = frame)
  }
  for (name in c("../x", "resources/../../x", "/tmp/x", "C:/x", "..\\x", "resources/a\nb", "~/x",
                 "{stop()}/../x")) {
    refused(with(name), "outside of its folder")
  }
  # 0120777
  refused(with("resources/link", modes = list("resources/link" = 41471)),
          "symbolic link.*resources/link")
  refused(with("MODELDESCRIPTION.xml"), "twice")
  secret <- with("resources/a")
  bytes <- readBin(secret, "raw", 1e6)
  at <- grepRaw(as.raw(c(0x50, 0x4b, 1, 2)), bytes, fixed = TRUE)
  bytes[at + 8] <- as.raw(1)
  writeBin(bytes, secret)
  refused(secret, "encrypted")
  expect_s3_class(fmu_variables(with("resources/a..b")), "data.frame")
})

test_that("a bomb is refused, and one that lies about its size is cut off", {
  bomb <- list(modelDescription.xml = description(house_xml()), "resources/zeros" = raw(2e7))
  refused(archive(bomb, sizes = list("resources/zeros" = 3e9)), "would unpack 3000 MB")
  refused(archive(bomb, sizes = list("resources/zeros" = 4294967295)), "would unpack")
  large <- archive(list(modelDescription.xml = raw(1.5e8)))
  stand_in(fmu_most_packed = 1e6)
  refused(large, "larger than 100 MB")
  lying <- archive(bomb, sizes = list("resources/zeros" = 10))
  folder <- amiss:::unpack_fmu(lying, "linux64")
  withr::defer(unlink(folder, recursive = TRUE))
  expect_identical(file.size(file.path(folder, "resources", "zeros")), 10)
  stand_in(fmu_most_files = 2)
  refused(house_file(), "more than 2 files")
})

test_that("only the platform's library and the resources are unpacked", {
  entries <- list(modelDescription.xml = description(house_xml()),
                  "binaries/linux64/house.so" = charToRaw("a"),
                  "binaries/win64/house.dll" = charToRaw("b"), "sources/house.c" = charToRaw("c"),
                  "resources/deep/start.txt" = charToRaw("d"))
  folder <- amiss:::unpack_fmu(archive(entries), "linux64")
  withr::defer(unlink(folder, recursive = TRUE))
  expect_setequal(dir(folder, recursive = TRUE), names(entries)[c(2, 5)])
})

test_that("entities, other encodings and what is no description are refused", {
  of <- function(..., frame = parent.frame())
    archive(list(modelDescription.xml = description(...)), frame = frame)
  laughs <- c("<?xml version=\"1.0\"?>",
              "<!DOCTYPE x [<!ENTITY a \"ha\"> <!ENTITY b \"&a;&a;&a;\">]>",
              "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"&b;\"/>")
  refused(of(laughs), "document type")
  refused(of("<!doctype x SYSTEM 'file:///etc/passwd'>"), "document type")
  refused(archive(list(modelDescription.xml = iconv(paste(laughs, collapse = ""), to = "UTF-16LE",
                                                    toRaw = TRUE)[[1]])), "not UTF-8")
  refused(of("<?xml version=\"1.0\" encoding=\"UTF-7\"?>", "<a/>"), "not UTF-8")
  refused(of("<html/>"), "no description of a model")
  refused(of("<fmiModelDescription"), "no XML")
  refused(of("{stop('run')}"), "no XML")
  refused(of("<fmiModelDescription fmiVersion=\"1.0\"/>"), "FMI \"1.0\".*Export it again")
  refused(of(sub("modelIdentifier=\"house\"", "modelIdentifier=\"../house\"", house_xml())),
          "no identifier")
  refused(of(sub("valueReference=\"3\"", "valueReference=\"x\"", house_xml())),
          "without a name, reference or type")
  refused(of(sub("valueReference=\"3\"", "valueReference=\"-1\"", house_xml(3))),
          "without a name, reference or type")
  only <- sub("<CoSimulation[^>]*>", "<ModelExchange modelIdentifier=\"house\"/>", house_xml())
  refused(of(only), "model exchange only.*Export it for co-simulation")
  refused(of(house_xml()[-3]), "no co-simulation")
})

test_that("reading an FMU runs nothing of it; its first run does", {
  file <- types_fmu(2)
  unlink(types_mark())
  fmu_variables(file)
  simulator <- fmu_simulator(file, free("real", uniform(0, 1)), output = "sum")
  printed(simulator)
  expect_false(file.exists(types_mark()))
  simulate_runs(simulator, cbind(real = 0.25), matrix(0, 1, 0), 1)
  expect_true(file.exists(types_mark()))
})

test_that("a study runs an FMU only if it is trusted", {
  file <- types_fmu(3)
  unlink(types_mark())
  folder <- withr::local_tempdir()
  study <- write_study_file(folder)
  writeLines(sprintf("simulator <- fmu_simulator('%s', free('real', uniform(0, 1)), output = 'sum')
    simulate_runs(simulator, cbind(real = 0.5), matrix(0, 1, 0), 1)
    simulator", normalizePath(file, "/")), file.path(folder, "model.R"))
  expect_error(read_study(study), "trust", class = "amiss_error_trust")
  expect_false(file.exists(types_mark()))
  expect_s3_class(read_study(study, trust = TRUE)$model, "amiss_fmu_simulator")
  expect_true(file.exists(types_mark()))
})

test_that(paste("an FMU for another platform is refused with the platforms that it has, and",
                "without any with that"), {
  other <- list(modelDescription.xml = description(house_xml()),
                "binaries/vax/house.so" = charToRaw("a"), "binaries/c64/house.so" = charToRaw("a"),
                "binaries/linux64/readme.so" = charToRaw("a"))
  run <- function(file) simulate_runs(house_fmu(file), cbind(R_out = 0.01), house_drivers(3), 1)
  expect_error(run(archive(other)), "no library for this platform.*\"vax\" and \"c64\"",
               class = "amiss_error_fmu")
  expect_error(run(archive(other[1])), "none for any", class = "amiss_error_fmu")
})

test_that("an FMU that changed since it was declared is refused", {
  file <- house_file()
  house <- house_fmu(file)
  build_house(file, resources = list(start.txt = "21"), sources = fmu_sources)
  expect_error(simulate_runs(house, cbind(R_out = 0.01), house_drivers(3), 1), "has changed",
               class = "amiss_error_fmu")
  unlink(file)
  expect_error(simulate_runs(house, cbind(R_out = 0.01), house_drivers(3), 1), "no such file",
               class = "amiss_error_fmu")
  expect_match(printed(house), "not there now")
})

test_that("aliases, arrays and defaults of a description are read", {
  xml <- sub("(.*name=\"leak\".*)/>", "\\1><Alias name=\"draught\"/></Float64>", house_xml(3))
  xml <- sub("(.*name=\"fault\".*)/>", "\\1><Dimension start=\"3\"/></Float64>", xml)
  file <- archive(list(modelDescription.xml = description(xml)))
  v <- fmu_variables(file)
  expect_identical(v$use[match(c("leak", "draught", "fault"), v$name)],
                   c("parameter", "parameter", ""))
  with <- function(...) fmu_simulator(file, ..., output = "T_air")
  expect_error(with(free("leak", uniform(0, 1)), fixed = list(draught = 1)),
               "one variable under the names", class = "amiss_error_input")
  expect_error(with(free("fault", uniform(0, 1))), "is an array", class = "amiss_error_input")
  expect_identical(v$unit[v$name == "T_wall"], "degC")
  expect_identical(v$variability[v$name == "T_air"], "continuous")
})
