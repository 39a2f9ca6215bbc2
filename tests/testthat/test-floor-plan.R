# The table of rooms in ARCHITECTURE.md, held against the sources.

root <- file.path("..", "..")
skip_without_sources <- function() {
  skip_if_not(file.exists(file.path(root, "ARCHITECTURE.md")), "the package's sources")
}

rooms_of <- function(files) {
  lines <- grep("^\\| [a-z]+ \\| `",
                readLines(file.path(root, "ARCHITECTURE.md"), encoding = "UTF-8"), value = TRUE)
  patterns <- lapply(regmatches(lines, gregexpr("`[^`]+`", lines)),
                     function(x) utils::glob2rx(gsub("`", "", x)))
  lapply(files, function(f) which(vapply(patterns, function(p) any(vapply(p, grepl, NA, f)), NA)))
}

# Which file calls which: list(from, to, what), from the names that the functions of each file ask
# for.
calls_between <- function(files) {
  parsed <- lapply(file.path(root, "R", paste0(files, ".R")), parse, keep.source = FALSE)
  defined <- lapply(
    parsed, function(file) Filter(function(e) rlang::is_call(e, "<-") && !is.call(e[[2]]), file))
  home <- stats::setNames(rep(files, lengths(defined)),
                          unlist(lapply(defined, vapply, function(e) as.character(e[[2]])[1], "")))
  asked <- function(e) {
    value <- e[[3]]
    f <- if (rlang::is_call(value, "function")) eval(value, globalenv())
         else rlang::new_function(NULL, value)
    intersect(codetools::findGlobals(f), names(home))
  }
  do.call(rbind, Map(function(from, definitions) {
    what <- unique(unlist(lapply(definitions, asked)))
    calls <- data.frame(from = rep(from, length(what)), to = unname(home[what]),
                        what = as.character(what))
    calls[calls$from != calls$to, ]
  }, files, defined))
}

files <- setdiff(sub("\\.R$", "", list.files(file.path(root, "R"), "\\.R$")), "RcppExports")

test_that("every file of R stands in one room", {
  skip_without_sources()
  rooms <- rooms_of(files)
  expect_identical(files[lengths(rooms) != 1], character())
})

test_that("no file calls into a room below its own, and none in a circle", {
  skip_without_sources()
  calls <- calls_between(files)
  expect_gt(nrow(calls), 300)
  rooms <- stats::setNames(vapply(rooms_of(files), `[`, 0L, 1), files)
  back <- calls[rooms[calls$from] < rooms[calls$to], ]
  expect_identical(paste(back$from, "calls", back$what, "of", back$to, recycle0 = TRUE),
                   character())
  left <- unique(calls[c("from", "to")])
  while (any(last <- !left$to %in% left$from)) left <- left[!last, ]
  expect_identical(nrow(left), 0L)
})

test_that("the tables of README and measured.Rmd are those of bench/results", {
  skip_without_sources()
  check <- processx::run(file.path(R.home("bin"), "Rscript"),
                         c(file.path("tools", "measured.R"), "--check"), wd = root,
                         error_on_status = FALSE)
  expect_identical(check$status, 0L, info = check$stderr)
})

test_that("every benchmark is in the plan of bench/all, by options that it has", {
  skip_without_sources()
  lines <- grep("^[^#]", readLines(file.path(root, "bench", "plan.txt")), value = TRUE)
  parts <- utils::read.table(text = lines, sep = "|", strip.white = TRUE,
                             col.names = c("part", "how", "command"))
  code <- function(script) readLines(file.path(root, "bench", script))
  scripts <- list.files(file.path(root, "bench"), "\\.R$")
  started <- Filter(function(f) startsWith(code(f)[1], "#!"), scripts)
  script <- sub(" .*", "", parts$command)
  expect_setequal(script, c(started, "peers/ball_drop.R", "estate", "slurm"))
  expect_false(anyDuplicated(parts$part) > 0)
  expect_true(all(parts$how %in% c("alone", "shared", "last")))
  options <- regmatches(parts$command, gregexpr("(?<=--)[a-z]+", parts$command, perl = TRUE))
  for (k in seq_along(options)) for (name in options[[k]]) {
    read <- sprintf(if (grepl("[.]R$", script[k])) 'option("%s"' else "--%s", name)
    expect_true(any(grepl(read, code(script[k]), fixed = TRUE)),
                info = paste(parts$command[k], name))
  }
  # Those that come last look at worlds again.
  own <- parts$command[parts$how != "last"]
  seeds <- regmatches(own, regexpr("(?<=--seed |--first )[0-9]+", own, perl = TRUE))
  expect_false(anyDuplicated(seeds) > 0)
})
