# The command line of exec/amiss. Exit status: 0 done, 1 failed or not whole, 2 bad usage. A survey
# is not whole if a study has no result.

command_parser <- function() {
  option <- function(name, help, ...) optparse::make_option(paste0("--", name), help = help, ...)
  switch <- function(name, help) option(name, help, action = "store_true", default = FALSE)
  optparse::OptionParser(
    usage = paste0("usage: amiss run STUDY.yml --out DIR [options]\n",
                   "       amiss survey FOLDER ... --out DIR [--quiet]\n",
                   "       amiss --help | --version"),
    add_help_option = FALSE, option_list = list(
      option("out", paste("folder for report.html, figures/, result.rds and result.json; of a",
                          "survey also studies.csv"), metavar = "DIR"),
      option("threads", "threads to use (1); results do not depend on it", default = "1",
             metavar = "N"),
      option("seed", "seed of the random numbers; overrides that of the study", metavar = "N"),
      switch("trust", "run the R files that the study names, and read files outside its folder"),
      switch("large", "run even what is estimated to need more than a day or 4 GB"),
      switch("quiet", "no progress on stderr"),
      switch("version", "the version, and nothing else"),
      optparse::make_option(c("-h", "--help"), help = "this text, and nothing else",
                            action = "store_true", default = FALSE)),
    description = paste0("\nrun: runs the study and writes its results into DIR.\n",
                         "survey: one report of the studies whose results are in the folders."))
}

run_command <- function(words) {
  parser <- command_parser()
  help <- utils::capture.output(optparse::print_help(parser))
  asked <- tryCatch(read_command(words, parser), error = identity)
  if (inherits(asked, "error")) {
    message(paste(c(paste("amiss:", conditionMessage(asked)), help), collapse = "\n"))
    return(2)
  }
  told <- if (asked$help) help
          else if (asked$version) paste("amiss", utils::packageVersion("amiss"))
  if (!is.null(told)) {
    writeLines(told)
    return(0)
  }
  before <- options(amiss.allow_large = asked$large || isTRUE(getOption("amiss.allow_large")))
  on.exit(options(before))
  missing <- FALSE
  tryCatch(withCallingHandlers({
    result <- if (is.null(asked$folders)) {
      run_study(asked$study, out = asked$out, seed = asked$seed, threads = asked$threads,
                quiet = asked$quiet, trust = asked$trust)
    } else write_survey(asked$folders, asked$out, asked$quiet)
    if (!asked$quiet) print(result)
    as.numeric(missing || any(result$studies$verdict == "no result"))
  }, amiss_warning_missing = function(w) missing <<- TRUE), error = function(e) {
    message("amiss: ", conditionMessage(e))
    1
  }, interrupt = function(e) {
    message("amiss: interrupted; the same command goes on where it stopped")
    1
  })
}

# What is asked for; an error says what is wrong with the usage.
read_command <- function(words, parser) {
  parsed <- optparse::parse_args(parser, words, print_help_and_exit = FALSE,
                                 positional_arguments = TRUE)
  asked <- parsed$options
  names <- parsed$args
  if (identical(names, "help")) asked$help <- TRUE
  if (asked$help || asked$version) return(asked)
  if (!length(names)) stop("no command given")
  if (!names[1] %in% c("run", "survey")) stop("unknown command '", names[1], "'")
  if (names[1] == "survey") return(read_survey_command(asked, names[-1]))
  if (length(names) != 2) stop("one study file is needed, not ", length(names) - 1)
  if (is.null(asked$out)) stop("'--out DIR' is needed")
  if (!file.exists(names[2])) stop("the study file '", names[2], "' does not exist")
  if (!is_regular_file(names[2])) stop("the study file '", names[2], "' is not a regular file")
  asked$study <- names[2]
  asked$threads <- whole_number(asked$threads, "threads", 1, 1024)
  if (!is.null(asked$seed)) asked$seed <- whole_number(asked$seed, "seed", 0, .Machine$integer.max)
  asked
}

read_survey_command <- function(asked, folders) {
  if (!length(folders)) stop("a folder of results is needed")
  if (is.null(asked$out)) stop("'--out DIR' is needed")
  of_run <- c(seed = !is.null(asked$seed), threads = asked$threads != "1", trust = asked$trust,
              large = asked$large)
  if (any(of_run)) stop("'--", names(which(of_run))[1], "' is not for 'survey'")
  absent <- folders[!dir.exists(folders)]
  if (length(absent)) stop("the folder '", absent[1], "' does not exist")
  if (normalizePath(asked$out, mustWork = FALSE) %in% normalizePath(folders))
    stop("'--out' must be another folder than those of the studies")
  asked$folders <- folders
  asked
}

whole_number <- function(text, option, least, most) {
  number <- suppressWarnings(as.numeric(text))
  whole <- checkmate::test_int(number, lower = least, upper = most)
  if (!whole)
    stop("'--", option, "' needs a whole number from ", least, " to ", most, ", not '", text, "'")
  number
}
