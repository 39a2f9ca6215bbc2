# Bad input that no one has thought of, made from the good calls of helper-bad-input.R: every
# argument of every exported function takes every hostile value, and objects of the package come
# with a part taken out or replaced.

bytes_text <- local({
  text <- "a\xff"
  Encoding(text) <- "bytes"
  text
})

# Whole numbers as the package bit64 keeps them: in the bits of doubles.
as_integer64 <- function(x) structure(x * 2^-1074, class = "integer64")

# Values of every kind that R has, by a name to be told.
hostile_values <- list(
  null = NULL, na = NA, na_real = NA_real_, na_text = NA_character_, nan = NaN, inf = Inf,
  minus_inf = -Inf, negative = -1, zero = 0, half = 0.5, fraction = 1.5, huge = 1e300,
  beyond_integers = 2^31, true = TRUE, numbers = c(0.5, 0.25), whole = 2L, named = c(a = 1),
  complex = 1i, raw = as.raw(1), integer64 = as_integer64(2), date = as.Date("2024-03-01"),
  stamp = as.POSIXct("2024-03-01", tz = "UTC"), difference = as.difftime(1, units = "days"),
  factor = factor("a"), no_numbers = numeric(), no_text = character(), empty_text = "", blank = " ",
  newline = "a\nb", quotes = "it's \"a\"", braces = "{stop('evaluated')}", markup = "{.val",
  bracket = "[a", backslash = "\\1", percent = "%s%n", path_up = "../../x", bytes = bytes_text,
  not_utf8 = "a\xff", long_text = strrep("a", 1e4), texts = c("a", "a"), empty_list = list(),
  list_of_null = list(NULL), list_of_number = list(1), list_of_self = list(list(list())),
  twice_named = list(a = 1, a = 2), no_names = stats::setNames(list(1, 2), c("", "")),
  na_names = stats::setNames(list(1), NA), all_columns = ~ ., two_sided = a ~ b,
  broken_formula = structure(list(), class = "formula"), symbol = as.name("x"), call = quote(x + 1),
  expression = expression(x), identity = identity, no_arguments = function() NULL,
  stops = function(...) stop("inside"), primitive = sum, environment = new.env(),
  no_table = data.frame(), no_rows = data.frame(a = 1)[0, , drop = FALSE],
  table = data.frame(a = 1), list_column = data.frame(a = I(list(1, "b"))),
  no_matrix = matrix(0, 0, 0), matrix = matrix(c(0.5, 0.25, 0.1, 0.2), 2),
  array = array(1, c(1, 1, 1)), text_matrix = matrix("a"), list_matrix = matrix(list(1, 2), 1),
  foreign = structure(list(), class = "nonsense"),
  foreign_number = structure(1, class = "nonsense"),
  not_whole_fit = structure(list(), class = "amiss_fit"), s4 = methods::getClass("numeric"))

# What is like a good value, and is not one.
near_values <- function(value) {
  if (is.function(value) || is.null(value)) return(list())
  near <- list(doubled = c(value, value), as_list = list(value), nothing = value[0],
               faked = structure(list(), class = class(value)))
  if (is.data.frame(value)) return(c(near["faked"], near_tables(value)))
  if (is.matrix(value)) return(c(near["faked"], near_matrices(value)))
  if (is.list(value)) return(c(near, near_lists(value)))
  if (is.numeric(value))
    near <- c(near,
              list(one_missing = replace(value, length(value), NA), text = as.character(value)))
  if (is.character(value))
    near <- c(near, list(factor = factor(value), one_missing = replace(value, length(value), NA)))
  near
}

near_tables <- function(table) {
  column <- function(change) {
    table[[2]] <- change(table[[2]])
    table
  }
  named <- function(name) stats::setNames(table, replace(names(table), 2, name))
  list(no_rows = table[0, ], one_row = table[1, ], no_columns = table[0],
       integer64 = column(as_integer64), factors = column(factor), text = column(as.character),
       dates = column(function(x) as.Date("2024-01-01") + x), list_column = column(as.list),
       missing = column(function(x) replace(x, 3, NA)),
       infinite = column(function(x) replace(x, 3, Inf)),
       huge = column(function(x) replace(x, 3, 1e300)),
       matrix_column = column(function(x) cbind(x, x)), complex = column(as.complex),
       twice = named(names(table)[1]), empty_name = named(""), no_name = named(NA),
       braces = named("{x}"), newline = named("a\nb"), bytes = named(bytes_text),
       no_names = unname(table), all_missing = column(function(x) x * NA),
       reversed = table[rev(seq_len(nrow(table))), ], as_list = as.list(table),
       matrix = as.matrix(table))
}

near_matrices <- function(x) {
  if (!length(x)) return(list())
  named <- function(name) {
    colnames(x) <- replace(colnames(x) %||% letters[seq_len(ncol(x))], 1, name)
    x
  }
  list(no_rows = x[0, , drop = FALSE], no_columns = x[, 0, drop = FALSE], turned = t(x),
       no_names = unname(x), table = as.data.frame(x), missing = replace(x, 1, NA),
       infinite = replace(x, 1, Inf), huge = replace(x, 1, 1e300),
       text = `storage.mode<-`(x, "character"), complex = `storage.mode<-`(x, "complex"),
       integer64 = structure(as_integer64(x), dim = dim(x), dimnames = dimnames(x)),
       vector = as.vector(x), more = cbind(x, x), array = array(x, c(dim(x), 1)),
       empty_name = named(""), no_name = named(NA), braces = named("{x}"),
       bytes = named(bytes_text))
}

# A list, or an object, with a part taken out, or replaced by what is no such part; and the same one
# level deeper.
near_lists <- function(x, deeper = TRUE) {
  if (!length(x)) return(list())
  with_part <- function(i, value) {
    kept <- attributes(x)
    x <- unclass(x)
    x[i] <- list(value)
    attributes(x) <- kept
    x
  }
  without <- function(i) structure(unclass(x)[-i], class = oldClass(x))
  wrong <- list(null = NULL, text = "nonsense", nothing = numeric(), nan = NaN, list = list(),
                numbers = c(0.5, 0.25, 0.1))
  parts <- stats::setNames(seq_along(x), sprintf("%s[[%d]]", rlang::names2(x), seq_along(x)))
  made <- lapply(parts, function(i) {
    inner <- if (deeper && is.list(x[[i]]) && !is.data.frame(x[[i]])) near_lists(x[[i]], FALSE)
    c(list(without = without(i)), lapply(wrong, function(value) with_part(i, value)),
      lapply(inner, function(value) with_part(i, value)))
  })
  unlist(made, recursive = FALSE)
}

# Forms that say the same as a good value: the result is the same, if they are accepted.
equal_forms <- function(value) {
  if (is.object(value) || !is.atomic(value) || is.matrix(value)) return(equal_tables(value))
  if (!is.numeric(value) || length(value) != 1) return(list())
  c(list(with_name = c(a = value), of_array = array(value, c(1, 1)),
         of_class = structure(value, class = "nonsense"), as_is = I(value), of_list = list(value),
         of_text = format(value, digits = 15)),
    if (value %% 1 == 0 && abs(value) < 1e9)
      list(of_integer = as.integer(value), of_integer64 = as_integer64(value)))
}

equal_tables <- function(value) {
  if (is.data.frame(value)) {
    numbers <- value
    numbers[[1]] <- as_integer64(value[[1]])
    return(list(turned = value[rev(names(value))], of_integer64 = numbers,
                of_text = replace(value, 1, list(paste(value[[1]])))))
  }
  if (!is.matrix(value) || !is.numeric(value)) return(list())
  c(list(of_table = as.data.frame(value)),
    if (!is.null(colnames(value))) list(turned = value[, rev(seq_len(ncol(value))), drop = FALSE]))
}

# ---- rows: list(f, at, what, value, same) of a call of `f` whose argument number `at` is replaced

# The good calls with as little work as can be.
generated_calls <- function() {
  calls <- valid_calls()
  calibration <- bad_input_objects()$calibration
  calls$upgrade_model$control <- list(rounds = 1, max_steps = 1, calibration = calibration)
  calls$compare_models$control <- list(calibration = calibration)
  calls$run_study$path <- bad_study(list(control = list(rounds = 1, max_steps = 1,
                                                        calibration = plain_lists(calibration))))
  calls$run_study$trust <- TRUE
  # predict() of a table goes this way.
  calls$augment$newdata <- stats::setNames(bad_input_objects()$record[1:24, ],
                                           c("time", "Te", "Gv", "Ti"))
  calls$read_calibro$folder <- calibro_folder(bad_input_objects())
  calls
}

# As a study file has them, in which Inf is the word .inf.
plain_lists <- function(control)
  lapply(control, function(x) if (is.list(x)) plain_lists(x) else as.list(x))

calibro_folder <- function(o) {
  folder <- tempfile("calibro-")
  dir.create(folder)
  tables <- list(obs = o$record["Ti"][1:45, , drop = FALSE], bc = o$record[1:45, c("Te", "Gv")],
                 inputs = o$ensemble$values, sims = o$ensemble$outputs)
  for (name in names(tables)) {
    utils::write.table(tables[[name]], file.path(folder, paste0(name, ".csv")), sep = ",",
                       row.names = FALSE, col.names = FALSE)
  }
  folder
}

# Stands in for the work of a report.
no_report <- function(x, source, work, kind, quiet) {
  made <- file.path(work, "report.html")
  writeLines("report", made)
  made
}

generated_rows <- function(calls) {
  rows <- lapply(names(calls), function(f) {
    lapply(seq_along(calls[[f]]), function(at) argument_rows(f, at, calls[[f]][[at]]))
  })
  unlist(unlist(rows, recursive = FALSE), recursive = FALSE)
}

argument_rows <- function(f, at, good) {
  hostile <- c(hostile_values, near_values(good))
  if (at == 1 && is_foreign_generic(f))
    hostile <- Filter(function(value) inherits(value, class(good)[1]), hostile)
  same <- equal_forms(good)
  rows <- function(values, same) unname(Map(function(value, what) {
    list(f = f, at = at, what = what, value = value, same = same)
  }, values, names(values)))
  c(rows(hostile, FALSE), rows(same, TRUE))
}

# Generics of other packages dispatch before this one can look.
is_foreign_generic <- function(f)
  f %in% c("predict", "simulate", "tidy", "glance", "augment", "autoplot")

# `size` of them, spread over all arguments and all values: the step is prime to what repeats in the
# rows.
spread_rows <- function(rows, size) {
  if (size >= length(rows)) return(rows)
  rows[sort(order((seq_along(rows) * 0.6180339887) %% 1)[seq_len(size)])]
}

exported_function <- function(f) {
  switch(f, predict = stats::predict, simulate = stats::simulate, getExportedValue("amiss", f))
}

row_call <- function(row, calls) {
  arguments <- unclass(calls[[row$f]])
  arguments[row$at] <- list(row$value)
  arguments
}

# What comes of a call, within ten seconds: list(refused, value), and what it prints must be
# printable.
called <- function(f, arguments) {
  setTimeLimit(elapsed = 10, transient = TRUE)
  on.exit(setTimeLimit())
  tryCatch({
    utils::capture.output(suppressWarnings(suppressMessages({
      value <- do.call(exported_function(f), arguments, quote = TRUE)
      if (inherits(value, objects_of_package)) print(value)
    })))
    list(refused = NULL, value = value)
  }, error = function(e) list(refused = e),
     interrupt = function(e) list(refused = simpleError("it was interrupted")))
}

objects_of_package <- names(object_shapes)

# What the good calls give, each made once.
good_results <- new.env()
good_result <- function(f, calls) {
  if (is.null(good_results[[f]])) good_results[[f]] <- list(called(f, unclass(calls[[f]]))$value)
  good_results[[f]][[1]]
}

# "" if a row is refused by a condition of the package, or gives a whole result; else what is wrong.
generated_outcome <- function(row, calls) {
  told <- called(row$f, row_call(row, calls))
  if (!is.null(told$refused)) {
    if (inherits(told$refused, c("amiss_error", "rlib_error_dots"))) return("")
    return(sprintf("stops with <%s>: %s", class(told$refused)[1],
                   substr(conditionMessage(told$refused), 1, 150)))
  }
  good <- good_result(row$f, calls)
  if (row$same &&
      !identical(all.equal(told$value, good, check.attributes = FALSE, check.environment = FALSE),
                 TRUE)) {
    return("gives another result than the same value in its usual form")
  }
  # A damaged list may be carried along.
  carried <- is.list(row$value) || names(calls[[row$f]])[row$at] %in% takes_all[[row$f]]
  if (!carried && has_nan(told$value) && !has_nan(good)) "gives NaN" else ""
}

has_nan <- function(x) {
  if (is.list(x)) return(any(vapply(unclass(x), has_nan, NA)))
  is.double(x) && any(is.nan(x))
}

row_words <- function(row, calls)
  sprintf("%s(%s = <%s>)", row$f, rlang::names2(calls[[row$f]])[row$at], row$what)
