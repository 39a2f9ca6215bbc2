# A study file is data: UTF-8 whatever the locale, one YAML document, no tags, and of its words only
# true and false are logical.

longest_text <- 5000L
deepest_study <- 8
largest_study <- 10000

read_study_file <- function(path, call = rlang::caller_env()) {
  text <- read_utf8(path, "study", call)
  refuse <- function(why) {
    abort_input(c("The study file {.file {path}} cannot be read as YAML.", x = "{why}"),
                call = call)
  }
  check_study_text(text, refuse)
  lines <- strsplit(text, "\r?\n")[[1]]
  if (any(startsWith(lines, "%TAG"))) refuse("Tags cannot be declared in a study.")
  written <- grep("^(%|\\s*(#|$))", lines, value = TRUE, invert = TRUE)
  marks <- grep("^(---|\\.\\.\\.)(\\s|$)", written)
  if (any(marks > 1 & !(marks == length(written) & startsWith(written[marks], "..."))))
    refuse("It holds several documents; give each its own file.")
  tags <- new.env()
  study <- tryCatch(yaml::yaml.load(text, eval.expr = FALSE,
                                    handlers = c(plain_words, noted_tags(text, tags))),
                    error = function(e) refuse(conditionMessage(e)),
                    warning = function(w) refuse(conditionMessage(w)))
  if (length(tags)) refuse(paste("It has the tag", ls(tags)[1], "which is not known."))
  check_study_size(study, refuse)
  joined_numbers(with_numbers(study, unquoted_numbers(text)))
}

# Numbers of one sequence, which the parser leaves in a list where some have a point and others have
# none.
joined_numbers <- function(x) {
  if (!is.list(x)) return(x)
  number <- vapply(x, function(value) is.numeric(value) && length(value) == 1, NA)
  if (length(x) && is.null(names(x)) && all(number)) as.numeric(unlist(x))
  else lapply(x, joined_numbers)
}

# The parser takes minutes for what is nested very deep. Brackets in texts count too: a hundred are
# in no study.
check_study_text <- function(text, refuse) {
  if (nchar(text, "bytes") > 1e6) refuse("It is larger than 1 MB.")
  signs <- utf8ToInt(text)
  open <- cumsum(signs %in% utf8ToInt("[{") - signs %in% utf8ToInt("]}"))
  if (any(open > 100) || grepl("(?:[-?:] ){100}", text, perl = TRUE)) {
    refuse(paste("It is nested deeper than", deepest_study, "levels."))
  }
}

# A number as YAML 1.2 has it: 1e-3 is one, and 017 is seventeen.
number_pattern <- "[-+]?(?:[0-9]+(?:[.][0-9]*)?|[.][0-9]+)(?:[eE][-+]?[0-9]+)?"

# The number that a word is, an integer if it has neither point nor exponent and R's integers hold
# it; or the word.
number_of <- function(word) {
  if (!grepl(paste0("^(", number_pattern, "|0x[0-9a-fA-F]+)$"), word, perl = TRUE)) return(word)
  number <- as.numeric(word)
  whole <- grepl("^([-+]?[0-9]+|0x.*)$", word) && abs(number) <= .Machine$integer.max
  if (whole) as.integer(number) else number
}

# The parser reads YAML 1.1. There yes, no, on, off, y and n are logical, 017 is octal and 1:30 is
# ninety; here words stay text, so that a column may be called y, and numbers are those of YAML 1.2.
plain_words <- c(
  sapply(c("int", "int#oct", "int#hex", "int#base60", "float", "float#fix", "float#exp",
           "float#base60"), function(kind) number_of),
  list("bool#yes" = function(word) if (tolower(word) == "true") TRUE else word,
       "bool#no" = function(word) if (tolower(word) == "false") FALSE else word))

# Numbers that are text for the parser, as far as they stand in the text without quotes.
unquoted_numbers <- function(text) {
  found <- regmatches(text, gregexpr(paste0("(?m)(?<=[\\s,\\[{:-])", number_pattern,
                                            "(?=\\s*(?:[],}]|\\s#|$))"), text, perl = TRUE))[[1]]
  Filter(function(word) is.character(yaml::yaml.load(word, eval.expr = FALSE,
                                                     handlers = plain_words)), unique(found))
}

with_numbers <- function(x, words) {
  if (is.list(x)) return(lapply(x, with_numbers, words))
  if (!is.character(x) || !any(x %in% words)) return(x)
  read <- lapply(x, function(one) if (one %in% words) number_of(one) else one)
  if (length(read) == 1) read[[1]] else read
}

# The parser drops tags that it does not know. A handler for every word that could be one notes
# those that are.
noted_tags <- function(text, tags) {
  words <- unique(regmatches(text, gregexpr("![^][:space:],{}[]+", text))[[1]])
  names <- sub("^!<?!?(tag:yaml.org,2002:)?([^>]*)>?$", "\\2", words)
  foreign <- !names %in% c("", "str", "int", "float", "bool", "null", "seq", "map")
  note <- function(word) function(value) assign(word, TRUE, tags)
  stats::setNames(lapply(words[foreign], note), names[foreign])
}

# Aliases can make a short text a huge tree: the walk stops at the first value too many.
check_study_size <- function(study, refuse) {
  walk <- function(x, depth, before) {
    values <- before + length(x)
    if (depth > deepest_study) refuse(paste("It is nested deeper than", deepest_study, "levels."))
    if (values > largest_study) refuse(paste("It holds more than", largest_study, "values."))
    texts <- c(names(x), if (is.character(x)) x)
    long <- which(nchar(texts, "bytes") > longest_text)
    if (length(long)) {
      refuse(sprintf("A text of it, \"%s ...\", has %d characters. At most %d are read.",
                     trimws(substr(texts[long[1]], 1, 20)), nchar(texts[long[1]]), longest_text))
    }
    if (is.list(x)) for (part in x) values <- walk(part, depth + 1, values)
    values
  }
  walk(study, 1, 0)
}
