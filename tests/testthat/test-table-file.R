n <- 30
stamps <- as.POSIXct("2024-03-01", tz = "UTC") + 3600 * seq_len(n)
when <- format(stamps, "%Y-%m-%d %H:%M")
Te <- with_seed(1, round(rnorm(n, 5, 3), 2))
Ti <- with_seed(2, round(rnorm(n, 20, 1), 2))
comma <- function(x) gsub(".", ",", x, fixed = TRUE)
rows <- function(..., sep = ",") paste(..., sep = sep)
plain <- rows(when, Te, Ti)

write_table <- function(lines, bytes = charToRaw(paste0(enc2utf8(lines), "\n", collapse = ""))) {
  path <- withr::local_tempfile(fileext = ".csv", .local_envir = parent.frame(2))
  writeBin(bytes, path)
  path
}
read <- function(lines, ..., bytes = NULL) {
  path <- if (is.null(bytes)) write_table(lines) else write_table(bytes = bytes)
  suppressMessages(read_table_file(path, c("Zeit", "Ti", "Te"), ...),
                   classes = "amiss_message_file")
}
expect_read <- function(lines, time = when, ...) {
  table <- read(lines, ...)
  expect_identical(as.data.frame(table)[c("Zeit", "Te", "Ti")],
                   data.frame(Zeit = time, Te = Te, Ti = Ti))
}
refused <- function(lines, pattern, ...)
  expect_error(read(lines, ...), pattern, class = "amiss_error_input")

test_that("separators and decimal commas are recognised", {
  expect_read(c("Zeit,Te,Ti", plain))
  expect_read(c("Zeit, Te , Ti", rows(when, Te, Ti, sep = " , "), "", ""))
  for (sep in c(";", "\t", "|")) {
    expect_read(c(paste("Zeit", "Te", "Ti", sep = sep), rows(when, Te, Ti, sep = sep)))
    expect_read(c(paste("Zeit", "Te", "Ti", sep = sep), comma(rows(when, Te, Ti, sep = sep))))
  }
  expect_read(c("Zeit  Te   Ti", paste("  ", 1:n, Te, "  ", Ti)), as.numeric(1:n))
  expect_read(c("sep=;", "Zeit;Te;Ti;", paste0(comma(rows(when, Te, Ti, sep = ";")), ";"), ";;;",
                ";;;"))
  expect_read(c("Zeit,Te,Ti",
                sprintf("%s,\"%s\",\"%s\"", when, comma(format(Te)), comma(format(Ti)))))
  expect_read(c("Zeit;Te;Ti", paste0(when, "$", Te, "$", Ti)[0],
                comma(sprintf("%s;%.3f;%.3f", when, Te, Ti))))
  expect_read(c("Zeit$Te$Ti", rows(when, Te, Ti, sep = "$")), separator = "$")
})

test_that("signs between thousands are no decimals", {
  value <- function(text, sep = ";", ...) {
    read(c(paste("Zeit", "Te", "Ti", "p", sep = sep),
           paste(when, comma(Te), comma(Ti), text, sep = sep)), ...)$p[1]
  }
  expect_identical(value("1.013,25"), 1013.25)
  expect_identical(value("101'325"), 101325)
  expect_identical(value("1\u00a0013,2"), 1013.2)
  expect_identical(value("1.013", decimal = ","), 1013)
  expect_error(value("1.013"), "Row 1 of the column Te holds .*,.*row 1 of p holds 1.013.*decimal",
               class = "amiss_error_input")
  table <- read(c("Zeit,Te,Ti,p", paste0(plain, ",\"1,013.25\"")))
  expect_identical(table$p[1], 1013.25)
  expect_identical(read(c("Zeit,Te,Ti,p", paste0(plain, ",\"1,013\"")))$p[1], 1013)
})

test_that("lines above the header, comments and rows of units are left out", {
  expect_read(c("# made by", "Zeit,Te,Ti", append(plain, "# a gap", 9)))
  expect_read(c("# Zeit,Te,Ti", plain))
  expect_read(c("Station: A, 12", "1,2,3,4,5", "", "Zeit,Te,Ti", ",degC,degC", plain))
  expect_read(c("\"TOA5\",\"a\",\"b\"", "\"Zeit\",\"Te\",\"Ti\"", "\"TS\",\"Deg C\",\"Deg C\"",
                "\"\",\"Avg\",\"Smp\"", sprintf("\"%s\",%s,%s", when, Te, Ti)))
  expect_read(c("# USGS", "Zeit\tTe\tTi", "20d\t14n\t14n", rows(when, Te, Ti, sep = "\t")))
})

test_that("every row has the fields of the header", {
  refused(c("Zeit,Te,Ti", paste(1:n, plain, sep = ",")),
          "Row 1 \\(line 2\\) has 4 fields, its header 3: 1 | 2024")
  refused(c("Zeit,Te,Ti,Note", rows(1:n, 1:n, Te, Ti, "")), "has 5 fields")
  refused(c("Zeit,Te,Ti", "", replace(plain, 7, paste0(plain[7], ",x"))), "Row 7 \\(line 9\\)")
  refused(c("Zeit,Te,Ti", replace(plain, n, when[n])), "Row 30 \\(line 31\\) has 1 field.*cut off")
  refused(c("Zeit,Te,Ti", comma(plain)), "has 5 fields.*decimal comma")
  refused(c("Zeit,Te,Ti", replace(plain, 5, paste0("\"", plain[5]))), "quotation mark.*line 6")
  refused(c("Zeit,Te,Ti", replace(plain, 5, sub(",", paste0(strrep(" ", 1e5), "x,"), plain[5]))),
          "Line 6 has 1000[0-9]* characters in field 1 \\(Zeit\\)")
  refused(c("Zeit\tTe\tTi", replace(rows(when, Te, Ti, sep = "\t"), 5,
                                    paste0(when[5], strrep("\t", 1e5), Ti[5]))),
          "Line 6 has 100001 fields, its header 3")
  refused("Zeit,Te,Ti", "no rows below")
  refused("", "holds no lines")
  expect_read(c(",Zeit,Te,Ti", paste(0:(n - 1), plain, sep = ",")))
  expect_named(read(c(",Te,Ti", plain)), c("column_1", "Te", "Ti"))
})

test_that("numbers of Fortran and of loggers are read, and what is none is said", {
  expect_read(c("Zeit,Te,Ti", sub("e", "D", sprintf("%s,%.6e,%.6e", when, Te, Ti), fixed = TRUE)))
  expect_identical(marked_column(c("1.5-102", "-2.0d+03", "NAN", ""), "."),
                   c(1.5e-102, -2000, NA, NA))
  expect_warning(x <- read(c("Zeit,Te,Ti,x", paste(plain, replace(Ti, 5, "****"), sep = ",")))$x,
                 "\"x\" is read as text: row 5 holds \"\\*\\*\\*\\*\"",
                 class = "amiss_warning_input")
  expect_type(x, "character")
  table <- read(c("Zeit,Te,Ti,on,phase",
                  paste(plain, rep(c("True", "False"), n / 2), "NA", sep = ",")))
  expect_identical(table$on, rep(c(TRUE, FALSE), n / 2))
})

test_that("digits of a date keep the zeros in front", {
  digits <- format(stamps, "%d%m%Y%H%M")
  expect_read(c("Zeit,Te,Ti", rows(digits, Te, Ti)), digits)
})

test_that("other encodings are read", {
  lines <- c("Zeit,Te,Ti,Gr\u00f6\u00dfe", paste0(plain, ",1"))
  text <- paste0(lines, "\r\n", collapse = "")
  coded <- function(to) iconv(text, "UTF-8", to, toRaw = TRUE)[[1]]
  marks <- list("UTF-8" = c(0xef, 0xbb, 0xbf), "UTF-16LE" = c(0xff, 0xfe),
                "UTF-16BE" = c(0xfe, 0xff), "windows-1252" = numeric())
  for (code in names(marks)) {
    table <- read(bytes = c(as.raw(marks[[code]]), coded(code)))
    expect_identical(names(table), c("Zeit", "Te", "Ti", "Gr\u00f6\u00dfe"))
    expect_identical(table$Ti, Ti)
  }
})

test_that(
  "a study says what separates its fields and decimals, and names a value that is no number", {
  folder <- withr::local_tempdir()
  path <- write_study_file(folder, separator = "tab", decimal = ",")
  data <- utils::read.csv(file.path(folder, "data.csv"))
  own <- read_study(write_study_file(withr::local_tempdir()), trust = TRUE)$measurements
  write <- function(data) {
    data[] <- lapply(data, function(x) comma(format(x, digits = 15, trim = TRUE)))
    utils::write.table(data, file.path(folder, "data.csv"), sep = "\t", quote = FALSE,
                       row.names = FALSE)
  }
  write(data)
  expect_equal(read_study(path, trust = TRUE)$measurements, own)
  expect_error(read_study(write_study_file(folder, decimal = ";"), trust = TRUE), "decimal",
               class = "amiss_error_input")
  path <- write_study_file(folder)
  table <- readLines(file.path(folder, "data.csv"))
  target <- match("Ti", strsplit(gsub("\"", "", table[1]), ",")[[1]])
  fields <- strsplit(table[8], ",")[[1]]
  writeLines(replace(table, 8, paste(replace(fields, target, "****"), collapse = ",")),
             file.path(folder, "data.csv"))
  expect_error(read_study(path, trust = TRUE), "Ti.*row 7 holds \"\\*\\*\\*\\*\"",
               class = "amiss_error_input")
})

test_that("what cannot stand between fields is no separator", {
  path <- withr::local_tempfile(lines = c("hour,Ti,Te", paste(1:20, 1:20, 1:20, sep = ",")))
  for (bad in c("[a", "ab", "a", "1", "\"", "#", "\u00e9", "\n", ",,")) {
    expect_error(read_table_file(path, c("hour", "Ti", "Te"), bad), "separator",
                 class = "amiss_error_input")
  }
  expect_identical(read_table_file(path, c("hour", "Ti", "Te"), "comma"),
                   read_table_file(path, c("hour", "Ti", "Te"), ","))
})

test_that("a line of a great many fields is refused before a table is made of it", {
  lines <- c("hour,Ti,Te", paste(1:20, 1:20, 1:20, sep = ","))
  lines[10] <- strrep(",", 1e5)
  path <- withr::local_tempfile(lines = lines)
  stand_in(scan_fields = function(...) stop("a table is made"))
  expect_error(read_table_file(path, c("hour", "Ti", "Te")),
               "Line 10 has 100001 fields, its header 3", class = "amiss_error_input")
})

test_that("blanks at the ends of long texts are left out in a time that grows as they do", {
  long <- strrep(" ", 1e6)
  texts <- c(a = paste0(long, "x \u00e9", long), b = long, c = " y ")
  expect_identical(amiss:::without_blanks(texts), c(a = "x \u00e9", b = "", c = "y"))
})

test_that("a table of gzip is read, and one that is cut off or damaged is refused", {
  lines <- charToRaw(paste0(c("Zeit,Te,Ti", plain), "\n", collapse = ""))
  path <- withr::local_tempfile(fileext = ".csv.gz")
  file <- gzfile(path, "wb")
  writeBin(lines, file)
  close(file)
  expect_identical(read_table_file(path, c("Zeit", "Ti", "Te"))$Ti, Ti)
  bytes <- readBin(path, "raw", 1e5)
  for (kept in c(3, 20, length(bytes) - c(40, 9, 8, 1)))
    refused(NULL, "cannot be read", bytes = utils::head(bytes, kept))
  refused(NULL, "damaged, cut off", bytes = utils::head(bytes, length(bytes) - 40))
  refused(NULL, "cannot be read", bytes = replace(bytes, 100:200, as.raw(0)))
})
