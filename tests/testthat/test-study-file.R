# What is read from a file of these lines, or bytes.
read_lines <- function(..., bytes = charToRaw(paste0(c(...), "\n", collapse = ""))) {
  path <- withr::local_tempfile(fileext = ".yml")
  writeBin(bytes, path)
  read_study_file(path)
}

refuse_lines <- function(pattern, ...)
  expect_error(read_lines(...), pattern, class = "amiss_error_input")

test_that("a study file is UTF-8, also after a byte order mark and with the line ends of Windows", {
  expect_equal(read_lines(bytes = c(as.raw(c(0xef, 0xbb, 0xbf)),
                                    charToRaw("study: a\r\nunit: \u00b0C\r\n"))),
               list(study = "a", unit = "\u00b0C"))
})

test_that("the line of a byte that is not UTF-8 is said", {
  refuse_lines("line 2", bytes = c(charToRaw("a: 1\nb: "), as.raw(0xb0), charToRaw("C\n")))
  refuse_lines("line 2", bytes = c(charToRaw("a: 1\nb: "), as.raw(0), charToRaw("C\n")))
})

test_that("a study file with tags is refused", {
  refuse_lines("tag !expr", "a: !expr file.create('x')")
  refuse_lines("tag !!python/object:x", "a: !!python/object:x {b: 1}")
  refuse_lines("tag !foo", "a: [!foo 1, 2]")
  refuse_lines("Tags cannot be declared", "%TAG !e! tag:x,2000:", "---", "a: !e!foo 1")
})

test_that("what looks like a tag in a comment or a text is none", {
  expect_equal(read_lines("# see !this", "a: 'no !expr here'", "b: wait !important"),
               list(a = "no !expr here", b = "wait !important"))
})

test_that("numbers with a point and without make one sequence", {
  read <- read_lines("a: [13, 300, .inf]", "b: {c: [2.5, 24]}", "d: [1, x]",
                     "e: [[1, 2], [3, 4.5]]", "f: 5")
  expect_identical(read[c("a", "b")], list(a = c(13, 300, Inf), b = list(c = c(2.5, 24))))
  expect_identical(read$d, list(1L, "x"))
  expect_equal(read$e, list(c(1, 2), c(3, 4.5)))
  expect_identical(read$f, 5L)
})

test_that("numbers are those of YAML 1.2, and everything else is text", {
  read <- read_lines("a: 1e-3", "b: [1e-3, 2, 0.5, 3E+2]", "c: 017", "d: [08, 010]", "e: 0x1F",
                     "f: {g: -1E5} # 7e7", "h:", "  - 4e0", "  - .5", "i: 9999999999")
  expect_identical(read[c("a", "b", "c", "e")],
                   list(a = 1e-3, b = c(1e-3, 2, 0.5, 300), c = 17L, e = 31L))
  expect_identical(read[c("d", "f", "h", "i")],
                   list(d = c(8, 10), f = list(g = -1e5), h = c(4, 0.5), i = 9999999999))
  text <- list(a = "1:30", b = "12:30:00", c = "1_000", d = "0o17", e = "1,5", f = "2024-01-01",
               g = "a 1e3", h = "1e4", i = "017", j = "5", k = "6e6\n")
  expect_identical(read_lines("a: 1:30", "b: 12:30:00", "c: 1_000", "d: 0o17", "e: 1,5",
                              "f: 2024-01-01", "g: a 1e3", "h: '1e4'", "i: \"017\"", "j: '5'",
                              "k: |", "  6e6", "l: 5")[letters[1:11]], text)
})

test_that("a path that leads to no file with an end is refused, over any number of links", {
  skip_on_os("windows")
  folder <- withr::local_tempdir()
  at <- function(name) file.path(folder, name)
  system2("mkfifo", shQuote(at("pipe")))
  writeLines("a: 1", at("file"))
  link <- function(to, names) for (name in names) {
    file.symlink(to, at(name))
    to <- at(name)
  }
  link(at("pipe"), c("p1", "p2", "p3"))
  link("/dev/stdin", c("s1", "s2"))
  link("/dev/zero", c("z1", "z2"))
  link(at("file"), c("f1", "f2", "f3"))
  file.symlink(at("loop2"), at("loop1"))
  file.symlink(at("loop1"), at("loop2"))
  endless <- c("/dev/stdin", "/dev/zero", at(c("pipe", "p1", "p3", "s1", "s2", "z2", "loop1")))
  expect_identical(is_regular_file(c(endless, at(c("file", "f1", "f3", "absent")))),
                   rep(c(FALSE, TRUE, FALSE), c(9, 3, 1)))
  for (path in endless)
    expect_error(read_study_file(path), "not a regular file", class = "amiss_error_input")
  expect_identical(read_study_file(at("f3")), list(a = 1L))
})

test_that("a study file is one document", {
  refuse_lines("several documents", "a: 1", "---", "b: 2")
  refuse_lines("several documents", "---", "a: 1", "...", "b: 2")
  expect_equal(read_lines("# note", "---", "a: 1", "..."), list(a = 1L))
})

test_that("a study file that is nested too deep or grows too large is refused", {
  refuse_lines("A text of it, \"model.* has 6006 characters",
               paste0("a: ['model.", strrep(" ", 6000), "']"))
  refuse_lines("nested deeper", paste0("a: ", strrep("[", 20), strrep("]", 20)))
  levels <- letters[2:9]
  refuse_lines("more than", "a: &a [1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1]",
               sprintf("%s: &%s [%s]", levels, levels,
                       vapply(c("a", levels[-8]),
                              function(l) paste(rep(paste0("*", l), 21), collapse = ","), "")))
})

test_that("only true and false are logical in a study file", {
  expect_equal(read_lines("target: y", "a: [yes, no, on, off, n]", "b: true", "c: false"),
               list(target = "y", a = c("yes", "no", "on", "off", "n"), b = TRUE, c = FALSE))
})

test_that("a title or a unit that is no text is refused", {
  folder <- withr::local_tempdir()
  expect_error(read_study(write_study_file(folder, title = 2024L), trust = TRUE), "title",
               class = "amiss_error_input")
  expect_error(read_study(write_study_file(folder, unit = list(1, 2)), trust = TRUE), "unit",
               class = "amiss_error_input")
})

test_that("a folder is no study file and no data", {
  folder <- withr::local_tempdir()
  expect_error(read_study_file(folder), "not a regular file", class = "amiss_error_input")
  expect_error(read_study(write_study_file(folder, data = "."), trust = TRUE), "not a regular file",
               class = "amiss_error_input")
})

test_that("a pipe is no study file", {
  skip_on_os("windows")
  pipe <- withr::local_tempfile()
  system2("mkfifo", shQuote(pipe))
  expect_error(read_study_file(pipe), "not a regular file", class = "amiss_error_input")
})
