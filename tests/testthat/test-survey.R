# Upgrades of several houses without new runs: the small one with its verdicts changed by hand.
surveyed_upgrade <- function(verdict = "named", adopted = TRUE) {
  upgrade <- small_upgrade()
  if (!adopted) return(base_only(upgrade))
  upgrade$models[[2]]$verdict <- verdict
  upgrade
}

small_survey <- function() {
  survey(list(a = surveyed_upgrade(), b = surveyed_upgrade("likely"), c = surveyed_upgrade(),
              d = surveyed_upgrade(adopted = FALSE), e = surveyed_upgrade("stand-in")))
}

test_that("a survey counts what each study lacks", {
  found <- small_survey()
  studies <- tidy(found)
  expect_identical(studies$study, letters[1:5])
  expect_identical(studies$verdict, c("named", "likely", "named", "unexplained", "unexplained"))
  expect_identical(studies$named, c("sun", "", "sun", "", ""))
  expect_identical(studies$likely, c("", "sun", "", "", ""))
  expect_identical(studies$stand_in, c("", "", "", "", "sun"))
  upgrade <- small_upgrade()
  expect_equal(studies$error_before[1],
               upgrade$models[[1]]$scores$validate[["rmse"]] / upgrade$measurements$noise_sd)
  expect_equal(studies$error_after[1],
               upgrade$models[[2]]$scores$validate[["rmse"]] / upgrade$measurements$noise_sd)
  expect_true(all(studies$held_out))
  doubtful <- surveyed_upgrade("likely")
  doubtful$models[[2]]$doubts <- c(edge = "it lies at the edge")
  expect_identical(tidy(survey(list(a = doubtful)))$doubts, "it lies at the edge")
  expect_match(summary(survey(list(a = doubtful)))$studies[["to look at"]], "at the edge")
  expect_equal(studies$runs[1], upgrade$runs_total)

  counts <- tidy(found, "mechanisms")
  expect_identical(counts$mechanism, c("sun", "drift"))
  expect_identical(unlist(counts[1, -1]),
                   c(tried = 5L, named = 2L, likely = 1L, stand_in = 1L, not_adopted = 1L))
  expect_identical(counts$not_adopted[2], 5L)
  conditions <- tidy(found, "conditions")
  expect_identical(conditions$studies, c(5L, 5L))
  expect_identical(conditions$condition[1], "Gv")
  brought <- tidy(found, "parameters")
  expect_identical(brought$study, c("a", "b", "c", "e"))
  expect_equal(brought$median[1], unname(coef(upgrade)["sun_gain"]))
})

test_that("a survey says its counts, and what stays open", {
  told <- summary(small_survey())
  expect_match(told$headline, "^In 2 of 5 studies a cause is named, in 1 a cause is likely and in")
  expect_match(told$causes[1], "Named: sun in 2 of 5.", fixed = TRUE)
  expect_match(told$causes[2], "Likely: sun in 1 of 5.", fixed = TRUE)
  expect_match(told$gain, "median of 5 studies; held-out data")
  expect_match(told$open, "1 study with an error that stays above 1.5 times the noise.*: d.")
  expect_identical(told$studies$study[1:2], c("a", "c"))
  expect_identical(told$parameters$studies, 3L)  # the stand-in is none
  expect_output(print(small_survey()), "2 of 5 studies")
  expect_output(print(told), "What stays open")
})

test_that("numbers that are not trusted give no odds in a survey", {
  rough <- surveyed_upgrade()
  rough$models[[1]]$fit$trust$trusted <- FALSE
  found <- survey(list(a = rough))
  expect_identical(tidy(found)$log10_bf, NA_real_)
  expect_identical(unique(tidy(found, "trials")$log10_bf), NA_real_)
  shaky <- surveyed_upgrade()
  shaky$candidates$trusted[shaky$candidates$mechanism == "sun"] <- FALSE
  expect_identical(tidy(survey(list(a = shaky)))$log10_bf, NA_real_)
  expect_match(summary(found)$open, "1 study with numbers that are not trusted: a.", fixed = TRUE,
               all = FALSE)
})

test_that("a survey of folders lists what has no result, and why", {
  folder <- withr::local_tempdir()
  study <- function(name, value) {
    dir.create(file.path(folder, name))
    if (!is.null(value)) saveRDS(value, file.path(folder, name, "result.rds"))
  }
  study("done", surveyed_upgrade())
  study("empty", NULL)
  study("begun", NULL)
  dir.create(file.path(folder, "begun", "stages"))
  study("other", list(1))
  study("old", utils::modifyList(surveyed_upgrade(), list(format_version = 1L)))
  study("broken", NULL)
  writeLines("no R file", file.path(folder, "broken", "result.rds"))
  study("whole", survey(list(a = surveyed_upgrade())))
  dir.create(file.path(folder, "earlier-2026"))
  studies <- tidy(survey(folder))
  expect_setequal(studies$study, c("done", "empty", "begun", "other", "old", "broken"))
  why <- stats::setNames(studies$why, studies$study)
  expect_identical(why[["done"]], "")
  expect_match(why[["empty"]], "no result.rds")
  expect_match(why[["begun"]], "not finished")
  expect_match(why[["other"]], "no upgrade")
  expect_match(why[["old"]], "another version")
  expect_match(why[["broken"]], "cannot be read")
  expect_match(summary(survey(folder))$open, "5 studies without a result", all = FALSE)
  one <- survey(file.path(folder, c("done", "empty")))
  expect_identical(tidy(one)$study, c("done", "empty"))
  expect_error(survey(file.path(folder, "whole")), class = "amiss_error_input")
})

test_that("a folder counts once, streets are entered, and a survey in their midst is none", {
  folder <- withr::local_tempdir()
  for (house in c("north/1", "north/2", "south/3", "south/4")) {
    dir.create(file.path(folder, house), recursive = TRUE)
    saveRDS(surveyed_upgrade(), file.path(folder, house, "result.rds"))
  }
  dir.create(file.path(folder, "south", "4", "figures"))
  dir.create(file.path(folder, "south", "5", "figures"), recursive = TRUE)
  houses <- c("1", "2", "3", "4", "5")
  expect_identical(tidy(survey(folder))$study, houses)
  expect_identical(tidy(survey(c(folder, paste0(folder, "/"), file.path(folder, "north"))))$study,
                   houses)
  saveRDS(survey(folder), file.path(folder, "result.rds"))
  file.create(file.path(folder, "studies.csv"))
  expect_identical(tidy(survey(folder))$study, houses)
})

test_that("what decides nothing is undecided, whatever its verdict", {
  verdict <- function(upgrade) tidy(survey(list(a = upgrade)))$verdict
  base <- surveyed_upgrade(adopted = FALSE)
  expect_identical(verdict(base), "unexplained")
  untrusted <- base
  untrusted$models[[1]]$fit$trust$trusted <- FALSE
  expect_identical(verdict(untrusted), "undecided")
  refuted <- base
  refuted$models[[1]]$fit$check$passed <- FALSE
  expect_identical(verdict(refuted), "undecided")
  none <- base
  none$stopped_id <- "none_computed"
  expect_identical(verdict(none), "undecided")
  expect_match(summary(survey(list(a = none)))$headline, "nothing could be decided")
})

test_that("an upgrade whose parts do not fit has no result, and does not stop the survey", {
  folder <- withr::local_tempdir()
  for (name in c("good", "bad")) dir.create(file.path(folder, name))
  saveRDS(surveyed_upgrade(), file.path(folder, "good", "result.rds"))
  bad <- surveyed_upgrade()
  bad$models[[2]]$mechanism <- "not in the catalogue"
  saveRDS(bad, file.path(folder, "bad", "result.rds"))
  studies <- tidy(survey(folder))
  expect_identical(studies$verdict, c("no result", "named"))
  expect_match(studies$why[1], "not whole")
})

test_that("a pair counts for both of its mechanisms, and units are not mixed", {
  pair <- surveyed_upgrade()
  both <- paired_mechanism(c("sun", "drift"), pair$catalogue)
  pair$catalogue <- with_entries(pair$catalogue, list("sun + drift" = both))
  pair$models[[2]]$mechanism <- "sun + drift"
  row <- pair$candidates[pair$candidates$mechanism == "sun", ]
  row$mechanism <- "sun + drift"
  pair$candidates <- rbind(pair$candidates, row)
  other <- surveyed_upgrade()
  other$models[[2]]$fit$emulator$parameters[["sun_gain"]]$unit <- "cm2"
  found <- survey(list(a = pair, b = other))
  counts <- tidy(found, "mechanisms")
  expect_identical(counts$named[match(c("sun", "drift"), counts$mechanism)], c(2L, 1L))
  expect_identical(tidy(found)$named, c("sun + drift", "sun"))
  expect_identical(summary(found)$parameters$studies, c(1L, 1L))
})

test_that("three hundred studies still make figures", {
  many <- small_survey()
  many$studies <- do.call(rbind, lapply(1:60, function(k) {
    transform(many$studies, study = paste(study, k))
  }))
  many$trials <- do.call(rbind, lapply(1:60, function(k) {
    transform(many$trials, study = paste(study, k))
  }))
  for (which in survey_figures) {
    figure <- ggplot2::autoplot(many, which)
    expect_lt(figure_height(figure, narrow_canvas), 50)
    expect_error(ggplot2::ggplot_build(figure), NA)
  }
})

test_that("folders of the same name keep their paths", {
  folder <- withr::local_tempdir()
  for (street in c("north", "south")) {
    house <- file.path(folder, street, "house")
    dir.create(house, recursive = TRUE)
    saveRDS(surveyed_upgrade(), file.path(house, "result.rds"))
  }
  studies <- tidy(survey(file.path(folder, c("north", "south"))))
  expect_identical(studies$study, file.path(folder, c("north", "south"), "house"))
})

test_that("figures and report of a survey are made, also if nothing was adopted or computed", {
  skip_on_cran()
  folder <- withr::local_tempdir()
  grDevices::pdf(NULL)
  withr::defer(grDevices::dev.off())
  nothing <- survey(list(d = surveyed_upgrade(adopted = FALSE)))
  none <- survey(withr::local_tempdir())
  for (found in list(small_survey(), nothing, none)) {
    for (which in survey_figures)
      expect_error(ggplot2::ggplot_build(ggplot2::autoplot(found, which)), NA)
    expect_output(print(found), "Survey")
    file <- file.path(folder, "survey.html")
    report(found, file)
    expect_match(paste(readLines(file), collapse = " "), "How many studies lack what")
  }
  expect_identical(ggplot2::autoplot(small_survey())$labels$title, "Named: sun in 2 of 5 studies")
})

test_that("the command writes a survey, and says with its status that a study has no result", {
  folder <- withr::local_tempdir()
  for (name in c("one", "two")) dir.create(file.path(folder, "results", name), recursive = TRUE)
  saveRDS(surveyed_upgrade(), file.path(folder, "results", "one", "result.rds"))
  out <- file.path(folder, "estate")
  run <- function() run_command(c("survey", file.path(folder, "results"), "--out", out, "--quiet"))
  expect_equal(run(), 1)
  expect_setequal(dir(out), c("result.rds", "result.json", "report.html", "figures",
                              "studies.csv"))
  expect_identical(utils::read.csv(file.path(out, "studies.csv"))$verdict, c("named", "no result"))
  expect_identical(jsonlite::read_json(file.path(out, "result.json"))$studies[[1]]$named, "sun")
  saveRDS(surveyed_upgrade(), file.path(folder, "results", "two", "result.rds"))
  expect_equal(run(), 0)
  said <- function(...) {
    expect_message(expect_equal(run_command(c("survey", ...)), 2), "amiss: ")
    conditionMessage(tryCatch(run_command(c("survey", ...)), message = identity))
  }
  expect_match(said("--out", out), "a folder of results is needed")
  expect_match(said(folder), "'--out DIR' is needed", fixed = TRUE)
  expect_match(said(folder, "--out", out, "--seed", "1"), "'--seed' is not for 'survey'")
  expect_match(said(file.path(folder, "none"), "--out", out), "does not exist")
  expect_match(said(folder, "--out", folder), "another folder")
})
