#' Many studies in one table and one report
#'
#' Reads the results of many studies, such as those of all houses of an estate, and counts in how
#' many of them each cause was found. [report()] writes it as one report. The command
#' `amiss survey FOLDER --out DIR` does both.
#'
#' Each study was judged by itself: nothing that one house shows counts for another. A study without
#' a result does not stop the survey: it is listed, with the reason in `why`. A study that is
#' refused leaves no folder of its own. Make the folders of all studies before the first begins, so
#' that none is forgotten.
#'
#' @param results A named list of upgrades ([upgrade_model()]), or names of folders that
#'   [run_study()] filled. If a folder holds no result of its own, its subfolders are searched for
#'   studies, at any depth.
#' @param x A survey.
#' @param what Which table, see below.
#' @param object A survey.
#' @param ... Not used.
#' @return `survey()`: an object of class `amiss_survey`, for `print()`, `summary()`, `tidy()`,
#'   `plot()` ([figures]) and [report()]. `summary()` gives sentences and tables as people read
#'   them.
#' @section Tables: `tidy()` gives one of five tables:
#'   * `"studies"`: one row for each study.
#'     * `verdict`: `"named"`, `"likely"`, `"unexplained"` or `"nothing"` as of
#'       [summary.amiss_upgrade()]; `"undecided"` if no mechanism was adopted, and the first
#'       model's numbers are not trusted or no mechanism could be computed; `"no result"`. `why`
#'       has the reason, or that the result is being made again.
#'     * `named`, `likely`, `stand_in`: mechanisms adopted, separated by semicolons. `or`: those
#'       that the record does not distinguish from them. `doubts`: what speaks against those that
#'       are not named. `responds_to`: what the first model's error responds to.
#'     * `error_before`, `error_after`: root mean squared error of the first and the last model
#'       over the stated noise, on held-out data if there are any (`held_out`).
#'     * `log10_bf`: the sum of what each adopted mechanism explains (`log10_bf` of the `candidates`
#'       of [upgrade_model()]), `NA` if the numbers are not `trusted`.
#'     * `runs`, `seconds`, `faults` of the record.
#'   * `"mechanisms"`: in how many studies each was tried, named, likely, a stand-in, or not
#'     adopted. A mechanism that could not be computed was not tried. A pair counts for both of its
#'     mechanisms.
#'   * `"conditions"`: how many `studies` have each condition, and in how many of these the first
#'     model's error `responds` to it.
#'   * `"trials"`: one row for each study and single mechanism, with its `state` (`named`, `likely`,
#'     `stand-in`, `not adopted`, `not computed`) and the `log10_bf` of its first trial, `NA` if
#'     that is not trusted.
#'   * `"parameters"`: what each adopted mechanism brought, with median, 95 % interval and physical
#'     interval.
#' @seealso `vignette("pipelines", "amiss")`
#' @examples
#' table <- data.frame(hour = 1:96, Te = 10 + 5 * sin(1:96 / 4),
#'                     Gv = pmax(0, 100 * cos(1:96 / 3.8)))
#' house <- function(aperture) {
#'   table$Ti <- 20 + 0.4 * table$Te + aperture * table$Gv + 0.1 * cos(1:96 * 1.7)
#'   measurements(table, time = "hour", target = "Ti", boundary = ~ Te + Gv, noise_sd = 0.1,
#'                validate = table$hour > 72)
#' }
#' linear <- function_simulator(function(values, drivers) 20 + values[["gain"]] * drivers[, "Te"],
#'                              free("gain", uniform(0, 1)), boundary = "Te")
#' brighter <- function(values, drivers, base) base(values) + values[["sun"]] * drivers[, "Gv"]
#' sun <- mechanism("sun", boundary = "Gv", sentence = "Sun enters that the model leaves out.",
#'                  edit = function(model) {
#'   with_parameters(model, free("sun", uniform(0, 0.1), "K m2/W"), boundary = "Gv", f = brighter)
#' })
#' quick <- list(calibration = list(ais = list(pilot_chains = 48, groups = 4)),
#'               attribution = list(surrogates = 19))
#' upgrade <- function(aperture) {
#'   upgrade_model(linear, house(aperture), catalogue(sun), runs = 20, control = quick, seed = 1,
#'                 quiet = TRUE)
#' }
#' estate <- survey(list(north = upgrade(0), south = upgrade(0.005)))
#' estate
#' tidy(estate)
#' @export
survey <- function(results) {
  check_arguments()
  sources <- survey_sources(results)
  each <- Filter(length, Map(surveyed, sources, names(sources)))
  if (!length(each))
    abort_input(c("{.arg results} has no study.", i = "Name the folders of studies."))
  bound <- lapply(c(studies = "studies", trials = "trials", conditions = "conditions",
                    parameters = "parameters"), function(table) {
    rows <- do.call(rbind, unname(lapply(each, `[[`, table)))
    if (is.null(rows)) data.frame() else rows
  })
  structure(c(list(format_version = format_version), bound), class = "amiss_survey")
}

# Upgrades, or folders of them, each under the name of its study.
survey_sources <- function(results, call = rlang::caller_env()) {
  if (is.character(results)) return(study_folders(results, call))
  check_input(checkmate::check_list(results, types = "amiss_upgrade", min.len = 1,
                                    names = "unique"), "results",
              "Or give the names of folders that {.fun run_study} filled.", call = call)
  for (name in names(results))
    check_whole(results[[name]], sprintf("results[[\"%s\"]]", name), call = call)
  results
}

study_folders <- function(folders, call) {
  check_input(checkmate::check_character(folders, any.missing = FALSE, min.len = 1, min.chars = 1),
              "results", call = call)
  absent <- folders[!dir.exists(folders)]
  if (length(absent)) {
    abort_input(c("{.arg results} names {.file {absent[1]}}, which is no folder.",
                  i = "Name folders that {.fun run_study} filled, or a folder that holds them."),
                call = call)
  }
  found <- unlist(lapply(folders, studies_within))
  found <- found[!duplicated(normalizePath(found))]
  names <- basename(normalizePath(found))
  again <- names %in% names[duplicated(names)]
  stats::setNames(as.list(found), ifelse(again, found, names))
}

# The folder itself if it has a study's results or their beginnings, or holds no other.
studies_within <- function(folder) {
  own <- file.exists(file.path(folder, c("result.rds", "stages", ".amiss-holder")))
  of_survey <- file.exists(file.path(folder, "studies.csv"))
  within <- list.dirs(folder, recursive = FALSE)
  within <- within[!grepl("^([.]|earlier-|figures$)", basename(within))]
  if (any(own) && !of_survey || !length(within)) folder else unlist(lapply(within, studies_within))
}

# The upgrade in a folder, or why there is none.
read_result <- function(folder) {
  file <- file.path(folder, "result.rds")
  if (!file.exists(file)) {
    begun <- any(file.exists(file.path(folder, c("stages", ".amiss-holder"))))
    return(if (begun) "it is not finished" else "there is no result.rds in its folder")
  }
  result <- tryCatch(suppressWarnings(readRDS(file)), error = function(e) NULL)
  if (is.null(result)) return("its result.rds cannot be read")
  if (inherits(result, c("amiss_survey", "amiss_upgrade"))) result
  else paste("its result.rds holds", got_words(result), "and no upgrade")
}

# The rows of a study in each table; NULL for the folder of a survey. A result that is not whole is
# none.
surveyed <- function(source, name) {
  upgrade <- if (is.character(source)) read_result(source) else source
  if (inherits(upgrade, "amiss_survey")) return(NULL)
  without <- function(why) list(studies = study_row(name, "no result", why = why))
  if (is.character(upgrade)) return(without(upgrade))
  tryCatch({
    check_whole(upgrade, "result")
    rows <- upgrade_rows(upgrade, name)
    if (is.character(source) && dir.exists(file.path(source, "stages")))
      rows$studies$why <- "it is being made again, or was not made whole"
    rows
  }, error = function(e) {
    without(paste("its result is not whole:", cli::ansi_strip(one_line(conditionMessage(e)))))
  })
}

upgrade_rows <- function(upgrade, name) {
  told <- labelled(upgrade)
  verdicts <- vapply(adopted_models(upgrade), `[[`, "", "verdict")
  names(verdicts) <- vapply(adopted_models(upgrade), `[[`, "", "mechanism")
  of <- function(verdict) paste(names(verdicts)[verdicts == verdict], collapse = "; ")
  rivals <- unlist(lapply(adopted_models(upgrade), `[[`, "rivals"))
  doubts <- unlist(lapply(adopted_models(upgrade), function(model) unname(model$doubts)))
  held <- has_validation(upgrade)
  error <- score_of(upgrade, if (held) "validate" else "calibrate", "rmse") /
    upgrade$measurements$noise_sd
  rows <- lapply(adopted_models(upgrade), candidate_row, upgrade)
  trusted <- all(vapply(upgrade$models, function(m) m$fit$trust$trusted, NA),
                 vapply(rows, is_sound, NA, upgrade))
  explained <- vapply(rows, `[[`, 0, "log10_bf")
  studies <- study_row(
    name, survey_verdict(told), of("named"), of("likely"), of("stand-in"),
    paste(unique(rivals), collapse = "; "), paste(unique(doubts), collapse = "; "),
    paste(significant_conditions(told$models[[1]]$attribution$table), collapse = "; "),
    error[[1]], error[[length(error)]], held, if (trusted) sum(explained) else NA_real_, trusted,
    upgrade$runs_total, upgrade$wall_s %||% NA_real_, paste(record_faults(told), collapse = "; "))
  list(studies = studies, trials = trial_states(upgrade, name, verdicts),
       conditions = condition_rows(told, name), parameters = brought_rows(upgrade, name))
}

# Without a mechanism adopted, numbers that are not trusted decide nothing.
survey_verdict <- function(upgrade) {
  open <- !length(adopted_models(upgrade)) &&
    (!upgrade$models[[1]]$fit$trust$trusted || unjudged(upgrade) ||
       identical(upgrade$stopped_id, "none_computed"))
  if (open) "undecided" else diagnosis_verdict(upgrade)$verdict
}

study_row <- function(study, verdict, named = "", likely = "", stand_in = "", or = "",
                      doubts = "", responds_to = "", error_before = NA_real_,
                      error_after = NA_real_, held_out = NA, log10_bf = NA_real_, trusted = NA,
                      runs = NA_real_, seconds = NA_real_, faults = "", why = "") {
  data.frame(study, verdict, named, likely, stand_in, or, doubts, responds_to, error_before,
             error_after, held_out, log10_bf, trusted, runs, seconds, faults, why)
}

# What became of each single mechanism. `verdicts`: of those adopted, by their names; a pair's is
# that of both.
trial_states <- function(upgrade, study, verdicts) {
  trials <- upgrade$candidates
  if (is.null(trials)) return(NULL)
  members <- lapply(upgrade$catalogue[names(verdicts)], single_names)
  verdicts <- stats::setNames(rep(verdicts, lengths(members)), unlist(members))
  singles <- names(Filter(is_single, unclass(upgrade$catalogue)))
  first <- trials[!duplicated(trials$mechanism) & trials$mechanism %in% singles, ]
  state <- unname(verdicts[first$mechanism])
  computed <- first$mechanism %in% trials$mechanism[!is.na(trials$log10_bf)]
  state[is.na(state)] <- ifelse(computed, "not adopted", "not computed")[is.na(state)]
  data.frame(study, mechanism = first$mechanism, state,
             log10_bf = ifelse(is_sound(first, upgrade), first$log10_bf, NA_real_))
}

condition_rows <- function(upgrade, study) {
  table <- upgrade$models[[1]]$attribution$table
  if (!NROW(table)) return(NULL)
  data.frame(study, condition = table$boundary, responds = table$significant)
}

brought_rows <- function(upgrade, study) {
  models <- upgrade$models
  last <- parameter_rows(models[[length(models)]]$fit)
  physical <- physical_intervals(models[[length(models)]]$fit)
  last[c("physical_lower", "physical_upper")] <- physical[c("lower", "upper")] %||% NA_real_
  rows <- lapply(seq_along(models)[-1], function(k) {
    new <- setdiff(names(drawn_parameters(models[[k]]$fit)),
                   names(drawn_parameters(models[[k - 1]]$fit)))
    brought <- last[last$name %in% new, ]
    if (!nrow(brought)) return(NULL)
    data.frame(study, mechanism = models[[k]]$mechanism, verdict = models[[k]]$verdict,
               brought[c("name", "label", "unit", "median", "lower95", "upper95", "physical_lower",
                         "physical_upper")])
  })
  do.call(rbind, rows)
}

#' @rdname survey
#' @export
tidy.amiss_survey <- function(x, what = "studies", ...) {
  check_whole(x, "x")
  rlang::check_dots_empty()
  check_input(checkmate::check_choice(what, c("studies", "mechanisms", "conditions", "trials",
                                              "parameters")), "what")
  table <- switch(what, mechanisms = mechanism_counts(x), conditions = condition_counts(x),
                  x[[what]])
  rownames(table) <- NULL
  table
}

#' @rdname survey
#' @export
summary.amiss_survey <- function(object, ...) {
  check_whole(object, "object")
  structure(list(headline = survey_headline(object), causes = cause_sentences(object),
                 gain = survey_gain(object), open = open_sentences(object),
                 studies = studies_words(object), mechanisms = mechanism_counts_words(object),
                 conditions = condition_counts_words(object),
                 parameters = parameter_ranges(object)), class = "summary.amiss_survey")
}

#' @rdname survey
#' @export
print.summary.amiss_survey <- function(x, ...) on_stdout(x, {
  cli::cli_text("{.strong Survey}: {x$headline}")
  parts <- list("Causes" = x$causes, "What it brings" = x$gain, "What stays open" = x$open)
  say_parts(parts[lengths(parts) > 0])
})

#' @rdname survey
#' @export
print.amiss_survey <- function(x, ...) on_stdout(x, {
  check_whole(x, "x")
  cli::cli_text("{.strong Survey}: {survey_headline(x)}")
  say_bullets(c(cause_sentences(x), survey_gain(x)))
  say_bullets(open_sentences(x), "!")
  cli::cli_bullets(c(">" = "next: {.fun tidy}, {.fun plot} or {.fun report}"))
})
