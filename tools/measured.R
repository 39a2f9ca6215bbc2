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
  "effect of 0.8 to 1.2 times the noise: the right mechanism is adopted first" =
    function(r, m) count(r$detection_at_1),
  "effect below 0.8 times the noise: the right mechanism is adopted first" =
    function(r, m) count(r$detection_below_1),
  "nothing hidden: a mechanism is adopted" = function(r, m) count(r$false_mechanism),
  "an effect outside the catalogue is blamed on a mechanism" =
    function(r, m) count(r$outside_blamed),
  "a mechanism is named that is not there" = function(r, m) count(r$false_named),
  "runs of the simulator, median; worst" =
    function(r, m) paste(whole(m$runs_total$median), whole(m$runs_total$largest), sep = "; "))

more_world_rows <- list(
  "worlds with more than 800 runs" = function(r, m) count(r$many_runs),
  "twice the noise or more: the first parameter lies inside its physical interval" =
    function(r, m) count(r$physical_covered),
  "RMSE at most 10 % above that of least squares: calibration; held out" =
    function(r, m) counts(r$least_squares_calibration, r$least_squares_held_out),
  "twice the noise or more: the right mechanism is among those adopted" =
    function(r, m) count(r$hidden_among_adopted),
  "the same, if the effect is larger than the error of the structure" =
    function(r, m) count(r$hidden_above_misfit_among_adopted),
  "twice the noise or more: attribution by itself names its condition" =
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
             "worlds with something adopted that is not there",
             "held-out error over the noise, median",
             "runs, median", "seconds, median"), rows)
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
  hidden <- c("twice the noise or more" = "strength of two and more", weaker = "weaker",
              "an effect outside the catalogue" = "outside", nothing = "nothing")
  families <- c("box", "network", "runoff")
  cells <- unlist(lapply(names(hidden), function(h) lapply(names(rule_names), function(rule) {
    c(h, rule_names[[rule]], vapply(families, function(family) cell(rule, hidden[[h]], family), ""))
  })), recursive = FALSE)
  with_source(markdown(c("hidden", "rule", "box: right; wrong; none", "networks", "catchments"),
                       unname(cells)), found, "conditions")
}

# ---- one part each

# Under a table: the commands that made it, and when.
with_source <- function(lines, found, parts) {
  of <- found[intersect(parts, names(found))]
  commands <- vapply(of, function(f) sub(" --out FILE", "", sub("Rscript ", "", f$command)), "")
  dates <- unique(vapply(of, `[[`, "", "date"))
  c(lines, "", paste0("From `", paste(commands, collapse = "`, `"), "`, ",
                      paste(dates, collapse = " and "), "."))
}

field <- function(rows, name) {
  unlist(lapply(rows, function(r) if (is.null(r[[name]])) NA else r[[name]]))
}
between <- function(x, f = whole) {
  ends <- unique(f(range(x)))
  paste(ends, collapse = " to ")
}
of_all <- function(x, n = length(x)) sprintf("%d of %d", as.integer(sum(x)), as.integer(n))
digits <- function(x, n = 2)
  sub("[.]$", "", formatC(signif(x, n), digits = n, format = "fg", flag = "#"))

calibration_table <- function(found) {
  rows <- found$calibration$found
  case <- field(rows, "case")
  p <- field(rows, "p_value")
  holm <- stats::p.adjust(p)
  kinds <- c("joint posterior" = "^joint",
             "posteriors (5), also with one noise precision, and (6)" = "^posterior",
             "probabilities of three models" = "^model prob",
             "evidence against bridge sampling" = "^evidence")
  lines <- lapply(names(kinds), function(kind) {
    of <- grepl(kinds[[kind]], case)
    c(kind, sum(of), digits(min(p[of])), digits(min(holm[of])))
  })
  with_source(markdown(c("", "quantities", "least p-value",
                         sprintf("adjusted by Holm over all %d", length(p))), lines),
              found, "calibration")
}

evidence_table <- function(found) {
  rows <- Filter(function(r) !is.null(r$d), found$evidence$found)
  lines <- lapply(rows, function(r) {
    c(r$case, r$d, sprintf("%.3f", r$bias), sprintf("%.3f", r$sd),
      sprintf("%.0f %%", 100 * r$coverage))
  })
  with_source(markdown(c("target", "dimensions", "bias of the log evidence, nats",
                         "standard deviation", "intervals that hold it"), lines), found, "evidence")
}

basis_table <- function(found) {
  rows <- found$basis$found
  models <- unique(field(rows, "model"))
  spread <- function(model, varied) {
    of <- Filter(function(r) r$model == model && r$varied %in% varied, rows)
    trusted <- field(of, "trusted")
    values <- field(of, "log10_evidence")[trusted]
    paste0(sprintf("%.2f", diff(range(values))),
           if (any(!trusted)) sprintf(" (%d not trusted)", sum(!trusted)))
  }
  own <- c("own choice", "twice as many")
  kinds <- list("own choice of vectors, twice as many" = list(own, 0.3),
                "8, 10, 12, 16 vectors" = list("Q", 1), "100, 150, 250 runs" = list("M", 1))
  lines <- lapply(names(kinds), function(kind) {
    c(kind, vapply(models, spread, "", kinds[[kind]][[1]]), kinds[[kind]][[2]])
  })
  with_source(markdown(c("", models, "required"), lines), found, "basis")
}

record_names <- c(
  reservoir = "level of a tank, by the hour", cell = "voltage of a battery cell",
  greenhouse = "carbon dioxide in a greenhouse", town = "electricity of a town",
  river = "oxygen of a river, by the hour", glucose = "glucose, by the quarter of an hour",
  reactor = "temperature of a stirred reactor", module = "power of a photovoltaic module",
  drug = "a drug in the blood")

# What is hidden though no mechanism of the catalogue holds it.
outside <- c(greenhouse = "vents that open when it is warm, in no catalogue",
             module = "dust that rain washes off, in no catalogue")

sciences_table <- function(found) {
  parts <- grep("^sciences_", names(found), value = TRUE)
  rows <- unlist(lapply(found[parts], `[[`, "found"), recursive = FALSE)
  lines <- lapply(names(record_names), function(record) {
    of <- Filter(function(r) r$record == record, rows)
    each <- table(unlist(strsplit(field(of, "adopted"), ", ", fixed = TRUE)))
    told <- if (identical(names(each), "nothing")) sprintf("nothing in %d", each)
            else sprintf("%s in %d", names(each), each)
    ratio <- function(name) between(field(of, name) / field(of, "noise"), digits)
    before <- ratio("rmse_before")
    after <- ratio("rmse_after")
    hidden <- if (record %in% names(outside)) outside[[record]] else of[[1]]$hidden
    c(record_names[[record]], hidden, paste(told, collapse = "; "),
      sprintf("%d; %d of %d", sum(field(of, "covered")), sum(field(of, "calibrated_covered")),
              sum(field(of, "parameters"))),
      if (before == after) paste0(before, ", unchanged") else paste(before, "\u2192", after),
      between(field(of, "runs")))
  })
  n <- length(parts)
  with_source(markdown(c(sprintf("record, %d of each", n), "hidden", "adopted",
                         "true values in their 95 % intervals: physical; calibrated",
                         "held-out RMSE over the noise, before \u2192 after", "runs"), lines),
              found, parts)
}

steps_table <- function(found) {
  rows <- found$steps$found
  off <- field(rows, "off")
  ends <- c(0, 0.1, 0.3, 1, 3, Inf)
  names <- c("below 0.1", "0.1 to 0.3", "0.3 to 1", "1 to 3", "above 3")
  row <- function(name, of) {
    r <- rows[of]
    there <- field(r, "hidden") != "nothing"
    sum_of <- function(what, which = TRUE) sum(field(r, what)[which])
    c(name, length(r), sprintf("%d (%d)", sum_of("wrong_named"), sum_of("wrong_otherwise")),
      sprintf("%d (%d) of %d", sum_of("right_named", there), sum_of("right_otherwise", there),
              sum(there)),
      sprintf("%d of %d; %d of %d", sum_of("told_held"), sum_of("told"), sum_of("silent_held"),
              sum_of("silent")))
  }
  lines <- lapply(seq_along(names), function(k) row(names[k], off >= ends[k] & off < ends[k + 1]))
  with_source(markdown(c("what the steps change at the true values, over the noise", "worlds",
                         "named that is not there", "hidden, and named",
                         "95 % intervals that hold the truth: said to move; others"),
                       c(lines, list(row("all", TRUE)))), found, "steps")
}

crude_table <- function(found) {
  lines <- lapply(found$crude$found, function(r) {
    split <- function(text) strsplit(text, ", ", fixed = TRUE)[[1]]
    c(r$house, r$states, sub("/", ", ", r$before),
      paste0(split(r$adopted), " (", split(r$verdicts), ")", collapse = "; "),
      sub("/", ", ", r$after), whole(r$runs_total))
  })
  with_source(markdown(c("house", "capacities", "RMSE before, K: calibration, held out", "adopted",
                         "RMSE after", "runs"), lines), found, "crude")
}

catchment_table <- function(found) {
  lines <- lapply(found$catchment$found, function(r) {
    arrows <- function(text) gsub(", ", " \u2192 ", text, fixed = TRUE)
    c(r$catchment, r$adopted, arrows(r$rmse_calibration), arrows(r$rmse_held_out), whole(r$runs))
  })
  with_source(markdown(c("catchment", "adopted", "RMSE in calibration", "RMSE held out", "runs"),
                       lines), found, "catchment")
}

estate_table <- function(found) {
  r <- found$estate$found
  hides <- function(n) sprintf("%d of %d", as.integer(n), as.integer(r$hide_something))
  lines <- list(
    c("houses, each with a result", sprintf("%d of %d", r$houses - r$without_result, r$houses)),
    c("the right mechanism is adopted", hides(r$right_adopted)),
    c("the right mechanism is named", hides(r$right_named)),
    c("nothing hidden: nothing is adopted",
      sprintf("%d of %d", r$nothing_adopted, r$nothing_hidden)),
    c("a mechanism is adopted that is not there", sprintf("%d of %d", r$wrong_adopted, r$houses)),
    c("a mechanism is named that is not there", sprintf("%d of %d", r$wrong_named, r$houses)),
    c("runs of the simulator, median", whole(r$runs_median)),
    c("seconds of a study without its report, median", whole(r$seconds_median)))
  with_source(markdown(c("", ""), lines), found, "estate")
}

joint_table <- function(found) {
  rows <- found$joint$found$parameters
  lines <- c("facade insulation, W/mK (0.035 to 0.040 by the documentation)" = "k_insulation",
             "air change by infiltration, 1/h" = "ach",
             "heat capacity of partitions, J/m\u00b3K" = "c_partition",
             "inside convection, W/m\u00b2K" = "inside_convection")
  cells <- lapply(names(lines), function(label) {
    r <- Find(function(r) r$record == "Ti" && r$parameter == lines[[label]], rows)
    ends <- function(which) {
      x <- signif(unlist(r[paste0(which, c("_lower", "_upper"))]), 2)
      paste(ifelse(x >= 1000, whole(x), digits(x)), collapse = " to ")
    }
    c(label, ends("alone"), ends("joint"))
  })
  markdown(c("", "temperature alone", "with the flux"), cells)
}

joint_cases_table <- function(found) {
  lines <- lapply(found$joint$found$evidence, function(r) {
    c(r$case, sprintf("%+.1f", r$log10_shared), r$rmse_held_out, r$runs)
  })
  with_source(markdown(c("calibrated together", "log10 Bayes factor of sharing",
                         "RMSE on held-out data", "runs"), lines), found, "joint")
}

joint_upgrade_table <- function(found) {
  rows <- found$joint_upgrade$found
  models <- unique(field(rows, "model"))
  lines <- lapply(models, function(model) {
    of <- Filter(function(r) r$model == model, rows)
    bf <- of[[1]]$log10_bf
    c(model, if (is.null(bf)) "" else sprintf("%.0f, %s", bf, of[[1]]$verdict),
      paste(digits(field(of, "rmse_calibration")), collapse = ", "),
      paste(digits(field(of, "rmse_validation")), collapse = ", "))
  })
  with_source(markdown(c("model", "log10 Bayes factor, verdict",
                         "RMSE in calibration, K: N2, O5", "held out"), lines),
              found, "joint_upgrade")
}

# Rows with a bound; `holds` says on which side of it.
speed_table <- function(found) {
  parts <- intersect(c("speed", "speed_emulator"), names(found))
  rows <- unlist(lapply(found[parts], `[[`, "found"), recursive = FALSE)
  rows <- Filter(function(r) !is.null(r$required) && !is.null(r$holds), rows)
  lines <- lapply(rows, function(r) {
    value <- paste(if (r$value >= 1000) whole(r$value) else digits(r$value, 3), r$unit)
    below <- (r$value <= r$required) == r$holds
    c(r$name, if (r$holds) value else paste0("**", trimws(value), "**"),
      paste(if (below) "at most" else "at least", format(r$required, big.mark = ",")),
      if (r$holds) "" else "**missed**")
  })
  with_source(markdown(c("", "measured", "required", ""), unname(lines)), found, parts)
}

doubt_words <- c(
  record = "a fault of the record is suspected", open = "a rival with rough numbers comes as near",
  rivals = "a rival is probable too", untried = "a condition without a mechanism would do as well",
  untrusted = "numbers are not trusted", steps = "shorter steps of the simulator would change it",
  no_gain = "held-out data do not improve (a stand-in)",
  raises_error = "the error in calibration rises", still_responds = "the error still responds",
  stands_on = "found on top of one that is not named",
  alone = "what was adopted later may make it needless",
  edge = "its value lies at the end of its prior", remains = "much of the error remains",
  drift = "a drifting sensor would do as well", slow = "anything slow would do as well")

doubts_table <- function(found) {
  rows <- found$doubts$found$table
  seen <- Filter(function(r) r$right + r$wrong > 0, rows)
  seen <- seen[order(-field(seen, "right"))]
  lines <- lapply(seen, function(r) {
    words <- if (r$doubt %in% names(doubt_words)) doubt_words[[r$doubt]] else r$doubt
    c(words, r$right, r$wrong, r$named_without_right, r$named_without_wrong)
  })
  adopted <- found$doubts$found$adopted
  none <- found$doubts$found$no_doubt
  all <- list(c("adopted", adopted[[1]], adopted[[2]], "", ""),
              c("nothing: named", none[[1]], none[[2]], "", ""))
  with_source(markdown(c("what speaks against it", "right mechanisms", "wrong ones",
                         "right ones that would be named without it", "wrong ones"),
                       c(all, lines)), found, "doubts")
}

# A table of a part is empty until the part has a result.
of_part <- function(table, part) {
  function(found) if (any(names(found) == part)) table(found) else character()
}

tables <- list(
  "conditions" = conditions_table,
  "worlds in short" = function(found) worlds_table(found, families[1:3], world_rows),
  "worlds" = function(found) worlds_table(found, families, c(world_rows, more_world_rows)),
  "rivals" = rivals_table,
  "doubts" = of_part(doubts_table, "doubts"),
  "calibration" = of_part(calibration_table, "calibration"),
  "evidence" = of_part(evidence_table, "evidence"),
  "basis" = of_part(basis_table, "basis"),
  "sciences" = sciences_table,
  "steps" = of_part(steps_table, "steps"),
  "crude" = of_part(crude_table, "crude"),
  "catchment" = of_part(catchment_table, "catchment"),
  "joint" = of_part(joint_table, "joint"),
  "joint cases" = of_part(joint_cases_table, "joint"),
  "joint upgrade" = of_part(joint_upgrade_table, "joint_upgrade"),
  "speed" = of_part(speed_table, "speed"),
  "estate" = of_part(estate_table, "estate"))

main(commandArgs(trailingOnly = TRUE))
