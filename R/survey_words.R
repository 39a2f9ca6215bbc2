# What is counted in a survey, and what is said of it.

# The mechanisms named most often first.
mechanism_counts <- function(survey) {
  trials <- survey$trials[survey$trials$state != "not computed", ]
  states <- c(named = "named", likely = "likely", stand_in = "stand-in",
              not_adopted = "not adopted")
  mechanism <- as.character(unique(trials$mechanism))
  counts <- table(factor(trials$mechanism, mechanism), factor(trials$state, states))
  out <- data.frame(mechanism, tried = as.integer(rowSums(counts)))
  out[names(states)] <- lapply(seq_along(states), function(k) as.integer(counts[, k]))
  out[order(-out$named, -out$likely, -out$stand_in), ]
}

condition_counts <- function(survey) {
  rows <- survey$conditions
  condition <- as.character(unique(rows$condition))
  count <- function(which) as.integer(table(factor(rows$condition[which], condition)))
  out <- data.frame(condition, studies = count(TRUE), responds = count(rows$responds %in% TRUE))
  out[order(-out$responds), ]
}

verdict_order <- c("named", "likely", "unexplained", "nothing", "undecided", "no result")

studies_counted <- function(n) paste(n, if (n == 1) "study" else "studies")

survey_headline <- function(survey) {
  counts <- table(factor(survey$studies$verdict, verdict_order))
  told <- c(named = "a cause is named", likely = "a cause is likely",
            unexplained = "something is missing that the catalogue does not explain",
            nothing = "nothing decisive is wrong",
            undecided = "nothing could be decided", "no result" = "there is no result")
  seen <- names(counts)[counts > 0]
  sprintf("In %d of %s %s.", counts[[seen[1]]], studies_counted(nrow(survey$studies)),
          listed(c(told[seen[1]], sprintf("in %d %s", counts[seen[-1]], told[seen[-1]]))))
}

cause_sentences <- function(survey) {
  counts <- mechanism_counts(survey)
  sentence <- function(field, head) {
    rows <- counts[counts[[field]] > 0, ]
    rows <- rows[order(-rows[[field]]), ]
    each <- sprintf("%s in %d of %d", rows$mechanism, rows[[field]], rows$tried)
    if (length(each)) paste0(head, listed(each), ".")
  }
  c(sentence("named", "Named: "), sentence("likely", "Likely: "),
    sentence("stand_in", "Adopted as a stand-in for something else: "))
}

survey_gain <- function(survey) {
  done <- survey$studies[!is.na(survey$studies$error_before), ]
  if (!nrow(done)) return(NULL)
  held <- if (all(done$held_out)) "held-out data"
          else if (any(done$held_out)) "held-out data if there are any, else calibration"
          else "calibration"
  sprintf("The typical error, in units of the stated noise, %s (median of %s; %s).",
          median_change(done), studies_counted(nrow(done)), held)
}

median_change <- function(studies)
  change_words(stats::median(studies$error_before), stats::median(studies$error_after), "")

# The first few of many, by their names.
some_names <- function(names, most = 5) {
  more <- length(names) - most
  if (more > 1) paste(paste(names[seq_len(most)], collapse = ", "), "and", more, "more")
  else listed(names)
}

# What to look at: no result, faults of the record, numbers that are not trusted, errors that
# remain.
open_sentences <- function(survey) {
  s <- survey$studies
  s <- s[order(-s$error_after), ]
  of <- function(which, words) {
    which <- which & !is.na(which)
    if (any(which)) sprintf(words, studies_counted(sum(which)), some_names(s$study[which]))
  }
  failed <- unique(survey$trials$study[survey$trials$state %in% "not computed"])
  c(of(s$verdict == "no result", "%s without a result: %s."),
    of(nzchar(s$why) & s$verdict != "no result", "%s made again, or not made whole: %s."),
    of(nzchar(s$faults), "%s with a fault in the record, which looks like a cause: %s."),
    of(!s$trusted, "%s with numbers that are not trusted: %s."),
    of(s$study %in% failed, "%s with a mechanism that could not be computed: %s."),
    of(s$error_after > rules$large_remainder,
       paste("%s with an error that stays above", rules$large_remainder,
             "times the noise, the largest first: %s.")))
}

# The table of studies as people read it: by verdict, by what was found most often, then by what
# remains.
studies_words <- function(survey) {
  s <- survey$studies
  often <- function(names) factor(names, names(sort(table(names), decreasing = TRUE)))
  s <- s[order(factor(s$verdict, verdict_order), often(s$named), often(s$likely),
               -s$error_after), ]
  error <- ifelse(is.na(s$error_before), "",
                  ifelse(s$named == "" & s$likely == "" & s$stand_in == "", short(s$error_before),
                         paste(short(s$error_before), "\u2192", short(s$error_after))))
  count <- function(x)
    ifelse(is.na(x), "", format(x, big.mark = ",", trim = TRUE, scientific = FALSE))
  data.frame(study = s$study, verdict = s$verdict, named = s$named, likely = s$likely,
             "stand-in" = s$stand_in, "not distinguished from" = s$or,
             "the error responds to" = s$responds_to,
             "error over the noise" = error,
             "log10 Bayes factor" = ifelse(is.na(s$log10_bf) | s$log10_bf == 0, "",
                                           signed(s$log10_bf)),
             runs = count(s$runs), "to look at" = look_at(s), check.names = FALSE,
             row.names = NULL)
}

look_at <- function(studies) {
  trim <- function(x) trimws(gsub("(^; )+|(; )+$", "", gsub("(; )+", "; ", x)))
  untrusted <- ifelse(!is.na(studies$trusted) & !studies$trusted, "numbers not trusted", "")
  trim(paste(studies$why, studies$faults, untrusted, studies$doubts, sep = "; "))
}

mechanism_counts_words <- function(survey) {
  counts <- mechanism_counts(survey)
  stats::setNames(counts, c("mechanism", "tried", "named", "likely", "stand-in", "not adopted"))
}

condition_counts_words <- function(survey) {
  stats::setNames(condition_counts(survey),
                  c("boundary condition", "studies that have it", "of these, the error responds"))
}

# Where the medians of what was brought lie, over the studies that adopted it, stand-ins left out.
parameter_ranges <- function(survey) {
  rows <- survey$parameters
  rows <- rows[rows$verdict != "stand-in", ]
  if (!NROW(rows)) return(data.frame())
  of <- paste(rows$mechanism, rows$name, rows$unit)
  each <- split(rows, factor(of, unique(of)))
  do.call(rbind, unname(lapply(each, function(r) {
    data.frame(mechanism = r$mechanism[1], parameter = r$label[1], unit = pretty_unit(r$unit[1]),
               studies = nrow(r), "lowest median" = short(min(r$median), 3),
               "median of medians" = short(stats::median(r$median), 3),
               "highest median" = short(max(r$median), 3), check.names = FALSE)
  })))
}
