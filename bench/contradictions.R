#!/usr/bin/env Rscript
# Do result, print, summary, report and figures of a study say the same? Worlds of all families,
# each with its report; a row for each sentence or number that disagrees with another.
# Usage: Rscript bench/contradictions.R [--family box,network,runoff,wrong] [--worlds 10]
#                                       [--seed 95001] [--out FILE]
here <- dirname(sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE)[1]))
source(file.path(here, "options.R"))
suppressPackageStartupMessages(library(amiss))
families <- strsplit(option("family", "box,network,runoff,wrong", "box"), ",", fixed = TRUE)[[1]]
seeds <- as.integer(option("seed", "95001")) +
  seq_len(as.integer(option("worlds", "10", smallest = "1"))) - 1L
scope <- new.env(parent = globalenv())
for (part in c("worlds", "least_squares", "network", "runoff", "wrong", "families"))
  sys.source(file.path(here, "hidden_effects", paste0(part, ".R")), scope)
engine <- asNamespace("amiss")
`%or%` <- function(x, y) if (length(x)) x else y

# Everything that a person reads of a study, by the place where it stands.
places_of <- function(upgrade) {
  options(cli.width = 1e4, width = 1000, cli.num_colors = 1L, cli.unicode = TRUE)
  told <- summary(upgrade)
  page <- withr::local_tempfile(fileext = ".html")
  report(upgrade, page)
  figures <- lapply(stats::setNames(nm = engine$figures_of(upgrade)), function(one) {
    labels <- ggplot2::autoplot(upgrade, one)$labels
    paste(labels$title, labels$subtitle)
  })
  list(print = paste(utils::capture.output(print(upgrade)), collapse = "\n"),
       summary = paste(utils::capture.output(print(told)), collapse = "\n"),
       report = xml2::xml_text(xml2::read_html(page)), figures = figures, told = told,
       json = engine$result_list(upgrade))
}

squeezed <- function(text) gsub("[[:space:]\u00a0]+", " ", paste(unlist(text), collapse = " "))
says <- function(text, pattern, ...) grepl(pattern, squeezed(text), ...)

# What disagrees: a text each, none if all agree.
disagreements <- function(upgrade) {
  place <- places_of(upgrade)
  told <- place$told
  last <- upgrade$models[[length(upgrade$models)]]
  adopted <- upgrade$models[-1]
  found <- character()
  note <- function(...) found <<- c(found, sprintf(...))
  texts <- list(print = place$print, summary = place$summary, report = place$report)

  for (where in names(texts))
    if (!says(texts[[where]], told$tag, fixed = TRUE)) note("%s does not say '%s'", where, told$tag)
  if (place$json$diagnosis$verdict != told$verdict) note("verdict of result.json is another")
  for (model in adopted) {
    said <- sprintf("%s (%s", model$mechanism, model$verdict)
    both <- sprintf("%s: %s", model$verdict, model$mechanism)
    for (where in names(texts)) {
      if (!says(texts[[where]], said, fixed = TRUE) && !says(texts[[where]], both, fixed = TRUE) &&
          !(says(texts[[where]], model$mechanism, fixed = TRUE) &&
              says(texts[[where]], model$verdict, ignore.case = TRUE)))
        note("%s does not say that %s is %s", where, model$mechanism, model$verdict)
    }
  }

  # Errors: two digits everywhere.
  rmse <- c(upgrade$gain$rmse_calibration, upgrade$gain$rmse_validation)
  for (value in rmse[is.finite(rmse)]) for (where in c("summary", "report"))
    if (!says(texts[[where]], engine$short(value), fixed = TRUE))
      note("%s lacks the error %s", where, engine$short(value))
  numbers <- function(before, text = texts) {
    text <- squeezed(text)
    pattern <- sprintf("(?<=%s)[0-9]+([.][0-9]+)?(e-?[0-9]+)?", before)
    as.numeric(regmatches(text, gregexpr(pattern, text, perl = TRUE))[[1]])
  }
  missing <- numbers("typically ", place$figures$missing)
  whole <- max(rmse, na.rm = TRUE)
  if (any(missing > 1.05 * whole) && !says(place$figures$missing, "least squares leaves only"))
    note("typically %s missing of %s", max(missing), whole)

  # Edges.
  edge <- unname(engine$edge_of_prior(last$fit))
  if (any(edge) == says(texts$summary, "No parameter is at the edge"))
    note("the summary on edges, of which there are %d", sum(edge))
  title <- place$figures$parameters
  if (length(title) && length(upgrade$models) > 1 &&
      !says(title, sprintf("%d of %d after", sum(edge), length(edge)), fixed = TRUE))
    note("the figure of parameters on edges: %s", title)

  # What the error responds to.
  table <- last$attribution$table
  answers <- if (is.null(table)) FALSE else any(table$significant)
  if (answers == says(texts$summary, "responds to no boundary condition"))
    note("the summary on responses")

  # Sure or not.
  trusted <- last$fit$trust$trusted
  for (where in names(texts))
    if (!trusted && length(upgrade$models) < 3 && says(texts[[where]], "odds of (?!100 to 1 and)",
                                                       perl = TRUE))
      note("%s gives odds of numbers that are not trusted", where)
  if (!trusted && !says(texts$report, "not trusted|not to be trusted|cannot be trusted"))
    note("the report does not say that numbers are not trusted")
  all_trusted <- all(vapply(upgrade$models, function(m) m$fit$trust$trusted, NA),
                     upgrade$candidates$trusted, na.rm = TRUE)
  if (all_trusted && says(told$sure, "not trusted")) note("trusted numbers called not trusted")
  decisive <- Filter(function(m) m$verdict == "named", adopted)
  if (length(decisive) && says(told$headline, "unexplained", ignore.case = TRUE))
    note("named and unexplained")
  if (!length(adopted) && says(told$inspect, "check that on site"))
    note("nothing adopted, something to check on site")
  if (says(told$inspect, "do not read") && says(told$inspect, "check that on site"))
    note("not physical, and to be checked on site")
  for (mechanism in vapply(adopted, `[[`, "", "mechanism"))
    if (says(told$inspect, paste(mechanism, "is not ruled out"), fixed = TRUE))
      note("%s is adopted, and not ruled out", mechanism)
  candidates <- place$figures$candidates
  if (told$verdict == "standin" && says(candidates, "call for|the cause"))
    note("the figure of candidates of a stand-in: %s", candidates)
  if (!length(adopted) && says(candidates, "call for"))
    note("the figure of candidates calls for what was not adopted: %s", candidates)

  # Correlations told as a reason are large, no odds are beyond reason, physical values hold the
  # calibrated ones.
  r <- numbers("correlation ")
  if (any(r < 0.4)) note("go together, by a correlation of %s", min(r))
  powers <- numbers("10\\^")
  if (any(powers > 1000)) note("odds of 10^%d", max(powers))
  values <- tidy(upgrade)
  if (any(values$physical.low > values$conf.low | values$physical.high < values$conf.high,
          na.rm = TRUE))
    note("physical values leave calibrated ones out")

  # At most three to inspect are told at first, and none twice.
  if (anyDuplicated(unname(told$inspect))) note("something to inspect is told twice")
  steps <- place$figures$steps
  if (length(steps) && says(steps, "NA|NaN|Inf")) note("the figure of steps: %s", steps)
  for (where in names(texts))
    if (says(gsub("\\bas NA\\b", "", texts[[where]]), "\\bNA\\b|\\bNaN\\b|NULL|character\\(0\\)"))
      note("%s has NA, NaN or NULL", where)
  found
}

rows <- NULL
for (family in families) for (seed in seeds) {
  world <- scope$family_world(family, seed)
  upgrade <- suppressWarnings(upgrade_model(world$base, world$measurements, world$catalogue,
                                            control = list(max_steps = 2), seed = seed + 77L,
                                            quiet = TRUE))
  found <- disagreements(upgrade)
  message(family, " ", seed, ": ", summary(upgrade)$tag, "; ",
          if (length(found)) paste(found, collapse = "; ") else "no disagreement")
  rows <- rbind(rows, data.frame(family, seed, disagreement = found %or% NA_character_))
}
studies <- unique(rows[c("family", "seed")])
cat(sprintf("%d disagreements in %d studies\n", sum(!is.na(rows$disagreement)), nrow(studies)))
write_rows(rows, option("out", "contradictions.json"))
