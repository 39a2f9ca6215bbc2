# How hard the texts are to read, and whether they keep to plain English: README, ARCHITECTURE, the
# newest section of NEWS, vignettes, help pages, and the sentences in the code. Prints a row for
# each text that is over a limit; with --all a row for each text; with --worst N the N longest
# sentences of each. Fails if a text is over a limit.
# Usage: Rscript tools/prose.R [--all] [--worst N]
limits <- c(mean = 18, longest = 45)  # words a sentence; the mean of texts of ten sentences or more
avoided <- c("^Of ", "\\bhangs? on\\b", "\\banswers? to\\b", "\\btold\\b", "\\btrades? off\\b",
             "\\bin full\\b")

main <- function(args) {
  at <- match("--worst", args)
  worst <- if (is.na(at)) 0 else as.integer(args[at + 1])
  texts <- c(markdown_texts(), help_texts(), code_texts())
  measured <- do.call(rbind, Map(measure, names(texts), texts))
  over <- measured$longest > limits[["longest"]] | measured$avoided > 0 |
    (measured$sentences >= 10 & measured$mean > limits[["mean"]])
  shown <- if ("--all" %in% args) rep(TRUE, length(over)) else over
  if (any(shown)) print(measured[shown, ], row.names = FALSE, digits = 3)
  for (name in measured$text[shown]) say_worst(name, texts[[name]], worst)
  if (any(over)) stop(sum(over), " texts are over a limit", call. = FALSE)
}

# A text is a character vector of paragraphs.
measure <- function(name, paragraphs) {
  sentences <- sentences_of(paragraphs)
  words <- lengths(strsplit(sentences, " +"))
  found <- vapply(avoided, function(pattern) sum(grepl(pattern, sentences)), 0L)
  data.frame(text = name, sentences = length(sentences), mean = mean(words),
             longest = max(words, 0L), over_30 = mean(words > 30), avoided = sum(found))
}

say_worst <- function(name, paragraphs, worst) {
  sentences <- sentences_of(paragraphs)
  words <- lengths(strsplit(sentences, " +"))
  flagged <- vapply(sentences, function(s) any(vapply(avoided, grepl, NA, x = s)), NA)
  longest <- utils::head(order(-words), worst)
  longest <- longest[words[longest] > limits[["mean"]]]
  for (i in union(longest, if (worst) which(flagged))) {
    cat(sprintf("%s, %d words: %s\n", name, words[i], sentences[i]))
  }
}

sentences_of <- function(paragraphs) {
  paragraphs <- gsub("\\s+", " ", trimws(paragraphs))
  parts <- unlist(strsplit(paragraphs, "(?<=[.!?:;])\\s+(?=[A-Z(\u201c\"])", perl = TRUE))
  parts[lengths(strsplit(parts, " ")) >= 3]
}

markdown_texts <- function() {
  files <- c("README.md", "ARCHITECTURE.md", "NEWS.md",
             list.files("vignettes", "[.]Rmd$", full.names = TRUE))
  stats::setNames(lapply(files, markdown_paragraphs), files)
}

# Without the header, code, tables, titles and formulas; names of code are one word.
markdown_paragraphs <- function(file) {
  lines <- readLines(file, encoding = "UTF-8")
  if (lines[1] == "---") lines <- lines[-seq_len(which(lines == "---")[2])]
  if (basename(file) == "NEWS.md") {
    sections <- grep("^# ", lines)
    if (length(sections) > 1) lines <- lines[seq_len(sections[2] - 1)]
  }
  fence <- grepl("^\\s*(```|\\$\\$)", lines)
  lines[fence | cumsum(fence) %% 2 == 1] <- ""
  lines[grepl("^(\\s*\\||#|    |<)", lines)] <- ""
  item <- grepl("^\\s*([*+-]|[0-9]+[.)])\\s", lines)
  lines[item] <- paste0("\n\n", sub("^\\s*([*+-]|[0-9]+[.)])\\s+", "", lines[item]))
  lines[lines == ""] <- "\n\n"
  text <- paste(lines, collapse = " ")
  text <- gsub("`[^`]*`", "CODE", text)
  text <- gsub("\\$[^$]*\\$", "x", text)
  text <- gsub("\\[([^]]*)\\]\\([^)]*\\)", "\\1", text)
  strsplit(gsub("[*_]", "", text), "\\s*\n\n\\s*")[[1]]
}

help_texts <- function() {
  files <- list.files("man", "[.]Rd$", full.names = TRUE)
  paragraphs <- function(file)
    strsplit(rd_text(tools::parse_Rd(file)), "\\s*\n\\s*\n\\s*")[[1]]
  stats::setNames(lapply(files, paragraphs), files)
}

# The prose of a help page: code is one word, an item or an argument a paragraph.
rd_text <- function(node) {
  tag <- attr(node, "Rd_tag")
  if (is.null(tag)) tag <- ""
  dropped <- c("\\usage", "\\examples", "\\tabular", "\\name", "\\alias", "\\title", "\\keyword",
               "\\preformatted", "\\eqn", "\\deqn", "COMMENT", "USERMACRO", "\\figure", "\\docType",
               "\\concept")
  if (tag %in% dropped) return(if (tag == "\\eqn") "x" else "")
  if (tag == "\\code") return("CODE")
  apart <- function(text) paste0("\n\n", text, "\n\n")
  if (tag == "\\item" && length(node) == 2) return(apart(rd_text(node[[2]])))
  if (tag == "\\item") return("\n\n")
  if (tag == "\\section" || tag == "\\subsection") return(apart(rd_text(node[[2]])))
  if (tag == "\\href") return(rd_text(node[[2]]))
  if (!is.list(node)) return(paste(as.character(node), collapse = ""))
  inner <- paste(vapply(node, rd_text, ""), collapse = "")
  within <- c("\\link", "\\emph", "\\strong", "\\pkg", "\\dQuote", "LIST", "")
  if (tag %in% within) inner else apart(inner)
}

# Strings of the code that are sentences: five words or more, with what is filled in as one word.
code_texts <- function() {
  files <- setdiff(list.files("R", "[.]R$", full.names = TRUE), "R/RcppExports.R")
  found <- lapply(files, function(file) {
    tokens <- utils::getParseData(parse(file, keep.source = TRUE, encoding = "UTF-8"))
    strings <- vapply(tokens$text[tokens$token == "STR_CONST"],
                      function(x) eval(parse(text = x)), "")
    strings <- gsub("\\{[.a-z]+ [^{}]*(\\{[^{}]*\\})?[^{}]*\\}|\\{[^{}]*\\}", "CODE", strings)
    strings <- strings[lengths(strsplit(trimws(strings), "\\s+")) >= 5]
    unlist(strsplit(unname(strings), "\n"))
  })
  names(found) <- files
  Filter(length, found)
}

main(commandArgs(TRUE))
