# The tables of README and of vignettes/measured.Rmd that stand between <!-- table: NAME --> and
# <!-- end -->, from the results that bench/results keeps.
# Usage: Rscript tools/measured.R [--from DIR] [--check]
#   --from: a folder that bench/all has filled: what it measured replaces what bench/results has
#   --check: changes nothing, and fails if a table is not what bench/results says
results <- file.path("bench", "results")
documents <- c("README.md", file.path("vignettes", "measured.Rmd"))
families <- c(networks = "networks", catchments = "catchments", box = "box",
              wrong = "wrong in structure")

main <- function(args) {
  from <- match("--from", args)
  if (!is.na(from)) keep_results(args[from + 1])
  found <- read_results()
  stale <- Filter(function(file) !identical(readLines(file), filled(file, found)), documents)
  if ("--check" %in% args) {
    if (length(stale)) {
      stop(toString(stale), ": a table is not what bench/results says; run tools/measured.R",
           call. = FALSE)
    }
    return(invisible())
  }
  for (file in stale) {
    writeLines(filled(file, found), file)
    cat(file, "\n")
  }
}

# Of each part that is done: command, date, code and what was found, without the single worlds.
keep_results <- function(folder) {
  code <- readLines(file.path(folder, "code.txt"))[2]
  for (done in list.files(folder, "[.]txt$")) {
    part <- sub("[.]txt$", "", done)
    if (part == "code") next
    said <- readLines(file.path(folder, done))
    found <- jsonlite::read_json(file.path(folder, paste0(part, ".json")))
    if (is.list(found)) found[c("worlds", "rows")] <- NULL
    kept <- list(command = gsub(folder, "DIR", said[1], fixed = TRUE), date = said[2], code = code,
                 found = found)
    jsonlite::write_json(kept, file.path(results, paste0(part, ".json")), auto_unbox = TRUE,
                         digits = 6, null = "null", na = "null", pretty = TRUE)
  }
}

read_results <- function() {
  files <- list.files(results, "[.]json$", full.names = TRUE)
  stats::setNames(lapply(files, jsonlite::read_json), sub("[.]json$", "", basename(files)))
}

# A document with its tables as they should be.
filled <- function(file, found) {
  text <- readLines(file)
  for (start in rev(grep("^<!-- table: .* -->$", text))) {
    name <- sub("^<!-- table: (.*) -->$", "\\1", text[start])
    end <- start + match("<!-- end -->", text[-seq_len(start)])
    table <- tables[[name]]
    if (is.null(table) || is.na(end)) stop(file, ": no table '", name, "'", call. = FALSE)
    text <- c(text[seq_len(start)], table(found), text[end:length(text)])
  }
  text
}

markdown <- function(header, rows) {
  line <- function(cells) paste0("| ", paste(cells, collapse = " | "), " |")
  c(line(header), paste0("|", strrep("---|", length(header))), vapply(rows, line, ""))
}

# ---- worlds

count <- function(r) {
  if (is.null(r) || !isTRUE(r$n > 0)) return("")
  sprintf("%d of %d", as.integer(round(r$rate * r$n)), r$n)
}
counts <- function(...) {
  each <- vapply(list(...), count, "")
  paste(each[nzchar(each)], collapse = "; ")
}
whole <- function(x) formatC(round(x), format = "d", big.mark = ",")

# Each row: what it says, and a function of the rates and means of a family.
world_rows <- list(
  "worlds" = function(r, m) whole(m$runs_total$n),
  "twice the noise or more: the right mechanism is adopted first" =
    function(r, m) count(r$right_mechanism),
  "the same: it is named as the cause" = function(r, m) count(r$named),
  "the same: the parameter of the first lies inside its 95 % interval" =
    function(r, m) count(r$parameter_covered),
  "effect about as large as the noise: the right mechanism is adopted first" =
    function(r, m) count(r$detection_at_1),
  "half as large: the right mechanism is adopted first" = function(r, m) count(r$detection_below_1),
  "nothing hidden: a mechanism is adopted" = function(r, m) count(r$false_mechanism),
  "an effect outside the catalogue is blamed on a mechanism" =
    function(r, m) count(r$outside_blamed),
  "a mechanism is named that is not there" = function(r, m) count(r$false_named),
  "runs of the simulator, median; worst" =
    function(r, m) paste(whole(m$runs_total$median), whole(m$runs_total$largest), sep = "; "))

more_world_rows <- list(
  "worlds with more than 800 runs" = function(r, m) count(r$many_runs),
  "twice the noise or more: it lies inside its physical interval" =
    function(r, m) count(r$physical_covered),
  "error of least squares reached within a tenth: calibration; held out" =
    function(r, m) counts(r$least_squares_calibration, r$least_squares_held_out),
  "twice the noise or more: among what is adopted; larger than what the structure leaves" =
    function(r, m) counts(r$hidden_among_adopted, r$hidden_above_misfit_among_adopted),
  "the same: attribution by itself names its condition" =
    function(r, m) count(r$right_attributed_condition))

worlds_table <- function(found, parts, rows) {
  parts <- parts[names(parts) %in% names(found)]
  of <- lapply(names(parts), function(part) {
    list(r = found[[part]]$found$rates[[1]], m = found[[part]]$found$means[[1]])
  })
  cells <- lapply(names(rows), function(what) {
    c(what, vapply(of, function(f) rows[[what]](f$r, f$m), ""))
  })
  markdown(c("", parts), Filter(function(row) any(nzchar(row[-1])), cells))
}

# ---- rivals

rival_names <- c("amiss, adopted" = "amiss, what it adopts",
                 "amiss, named" = "amiss, what it names",
                 bic = "least squares, AR(1), BIC", bic10 = "the same, if BIC falls by 10",
                 importance = "importance sampling", kalman = "grey box, likelihood ratio")

rivals_table <- function(found) {
  rows <- list()
  for (part in paste0("rivals_", names(families))) {
    if (is.null(found[[part]])) next
    table <- found[[part]]$found$table
    by <- stats::setNames(table, vapply(table, `[[`, "", "rival"))
    for (name in intersect(names(rival_names), names(by))) {
      r <- by[[name]]
      rows <- c(rows, list(c(families[[sub("rivals_", "", part)]], rival_names[[name]],
                             r$strong_right, r$weak_right, r$nothing_there,
                             sprintf("%d of %d", r$some_wrong, r$worlds),
                             sprintf("%.2f", r$held_out), whole(r$runs),
                             sprintf("%.0f", r$seconds))))
    }
  }
  markdown(c("worlds", "method", "twice the noise or more: right first", "weaker: right first",
             "nothing of the catalogue hidden: something adopted",
             "worlds with something adopted that is not there", "held-out error over the noise",
             "runs", "seconds"), rows)
}

# ---- conditions

rule_names <- c(condition = "amiss", tested = "amiss, a p-value of 0.05 at most",
                correlation = "correlation of residuals", forest = "random forest of residuals",
                lengthscales = "lengthscales of residuals", paper = "the paper's rule")

conditions_table <- function(found) {
  if (is.null(found$conditions)) return(character())
  rows <- found$conditions$found$table
  cell <- function(rule, hidden, family) {
    row <- Find(function(r) r$rule == rule && r$hidden == hidden && r$family == family, rows)
    if (is.null(row)) "" else paste(row$right, row$wrong, row$none, sep = "; ")
  }
  hidden <- c("strength of two and more", "weaker", "outside", "nothing")
  families <- c("box", "network", "runoff")
  cells <- unlist(lapply(hidden, function(h) lapply(names(rule_names), function(rule) {
    c(h, rule_names[[rule]], vapply(families, function(family) cell(rule, h, family), ""))
  })), recursive = FALSE)
  markdown(c("hidden", "rule", "box", "networks", "catchments"), cells)
}

tables <- list(
  "conditions" = conditions_table,
  "worlds in short" = function(found) worlds_table(found, families[1:3], world_rows),
  "worlds" = function(found) worlds_table(found, families, c(world_rows, more_world_rows)),
  "rivals" = rivals_table)

main(commandArgs(trailingOnly = TRUE))
