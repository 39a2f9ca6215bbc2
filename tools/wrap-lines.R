# Breaks lines of R code longer than 120 characters, and fills comments that have one, without touching any other line:
# tools/format. Code is broken after a comma or an operator, as far out of brackets as there is one, and goes on where
# its bracket opened; what a file parses to stays the same. Strings and lines without such a place stay, and are named.
# Usage: Rscript wrap-lines.R FILE...
width <- 120

# Comment paragraphs: lines of one prefix ("#' " or "# "), from a blank line or a roxygen tag to the next.
fill_comments <- function(lines) {
  prefix <- ifelse(grepl("^ *#'? +[^ ]", lines), sub("^( *#'? ).*", "\\1", lines), "")
  starts <- grepl("^ *#'? +(@|[-*] |[0-9]+\\. |\\||\\\\)", lines)
  raw <- in_examples(lines)
  paragraph <- cumsum(prefix == "" | starts | prefix != c("", prefix[-length(prefix)]))
  unlist(lapply(unname(split(seq_along(lines), paragraph)), function(at) {
    table <- grepl("^ *#'? +\\|", lines[at[1]])
    if (prefix[at[1]] == "" || any(raw[at]) || table || all(nchar(lines[at]) <= width)) return(lines[at])
    text <- paste(trimws(substring(lines[at], nchar(prefix[at[1]]) + 1)), collapse = " ")
    indent <- if (length(at) > 1) strrep(" ", nchar(sub("^( *).*", "\\1",
                                                        substring(lines[at[2]], nchar(prefix[at[1]]) + 1))))
              else if (grepl("@", lines[at[1]])) "  " else ""
    fill(text, prefix[at[1]], indent)
  }))
}

fill <- function(text, prefix, indent) {
  words <- strsplit(text, " +")[[1]]
  out <- character()
  line <- paste0(prefix, words[1])
  for (word in words[-1]) {
    if (nchar(line) + 1 + nchar(word) > width) {
      out <- c(out, line)
      line <- paste0(prefix, indent, word)
    } else {
      line <- paste(line, word)
    }
  }
  c(out, line)
}

# Examples are code; so are fenced lines.
in_examples <- function(lines) {
  inside <- FALSE
  vapply(lines, function(line) {
    if (!grepl("^ *#'", line)) inside <<- FALSE
    else if (grepl("^ *#' @examples", line)) inside <<- TRUE
    else if (grepl("^ *#' @", line)) inside <<- FALSE
    inside
  }, NA, USE.NAMES = FALSE)
}

# Where line `number` can be broken: the column after which, how deep in brackets (places of the last resort deeper than
# all), and where the rest goes.
places <- function(tokens, number, line) {
  indent <- nchar(sub("[^ ].*", "", line))
  own <- tokens[tokens$line1 == number & tokens$line2 == number, ]
  statement <- own$token[1] %in% c("IF", "FOR", "WHILE", "ELSE") && !"ELSE" %in% own$token[-1]
  kind <- own$token
  resort <- c("','" = 0, AND2 = 0, OR2 = 0, AND = 0, OR = 0, PIPE = 0, "'+'" = 0.25, "'-'" = 0.25, "'*'" = 0.5,
              SPECIAL = 0.5,
              LEFT_ASSIGN = 20, "'('" = 10)
  opened <- heads <- integer()
  found <- list()
  for (i in seq_len(max(0, nrow(own) - 1))) {  # after the last token there is nothing to break off
    before <- if (i > 1) kind[i - 1] else ""
    if (kind[i] %in% c("'('", "'['", "'{'")) opened <- c(opened, own$col1[i])
    if (kind[i] == "LBB") opened <- c(opened, own$col2[i], own$col2[i])
    if (kind[i] == "'('" && before %in% c("IF", "FOR", "WHILE")) heads <- c(heads, length(opened))
    if (kind[i] %in% c("')'", "']'", "'}'")) {
      ends_head <- length(opened) && length(opened) %in% heads
      opened <- utils::head(opened, -1)
      if (ends_head) heads <- setdiff(heads, length(opened) + 1)
      if (ends_head && statement && kind[i + 1] != "'{'" && !length(opened)) {
        found <- c(found, list(data.frame(col = own$col2[i], depth = -1, rest = indent + 2)))
      }
    }
    unary <- kind[i] %in% c("'-'", "'+'") && own$col1[i] <= c(0, own$col2)[i] + 1
    if (!kind[i] %in% names(resort) || i == 1 || unary) next
    aligned <- if (length(opened)) utils::tail(opened, 1) else if (kind[i] == "','") indent else indent + 2
    rest <- if (kind[i] == "'('") indent + 2 else aligned
    if (kind[i] == "'('" && nchar(line) - own$col2[i] + rest > width) next  # would bring nothing
    found <- c(found, list(data.frame(col = own$col2[i], depth = length(opened) + resort[[kind[i]]], rest = rest)))
  }
  do.call(rbind, found)
}

# One break: the outermost place that leaves both parts short, else the outermost that leaves the first part short, else
# the first.
broken <- function(line, at) {
  if (is.null(at)) return(NULL)
  at <- at[at$rest < 90 & nchar(line) - at$col + at$rest < nchar(line), ]
  if (!nrow(at)) return(NULL)
  if (!any(at$col <= width)) at <- at[at$col == min(at$col), ] else at <- at[at$col <= width, ]
  enough <- at[nchar(line) - at$col + at$rest <= width + 1, ]
  if (nrow(enough)) at <- enough
  at <- at[at$depth == min(at$depth), ]
  at <- at[which.max(at$col), ]
  c(substr(line, 1, at$col), paste0(strrep(" ", at$rest), trimws(substring(line, at$col + 1), "left")))
}

wrap_code <- function(lines) {
  given <- parse(text = lines, keep.source = FALSE)
  stuck <- character()
  repeat {
    long <- setdiff(which(nchar(lines) > width & !grepl("^ *#", lines)), which(lines %in% stuck))
    if (!length(long)) break
    tokens <- utils::getParseData(parse(text = lines, keep.source = TRUE), includeText = TRUE)
    tokens <- tokens[tokens$terminal, ]
    tokens <- tokens[order(tokens$line1, tokens$col1), ]
    # From the bottom up, so that the numbers of the lines above stay.
    for (number in rev(long)) {
      parts <- broken(lines[number], places(tokens, number, lines[number]))
      if (is.null(parts)) stuck <- c(stuck, lines[number])
      else lines <- append(lines[-number], parts, number - 1)
    }
  }
  if (!identical(parse(text = lines, keep.source = FALSE), given)) stop("the code would change")
  lines
}

for (file in commandArgs(trailingOnly = TRUE)) {
  before <- readLines(file, encoding = "UTF-8")
  if (all(nchar(before) <= width)) next
  after <- wrap_code(fill_comments(before))
  if (!identical(before, after)) writeLines(after, file)
  for (number in which(nchar(after) > width))
    message(sprintf("%s:%d: by hand: %d characters", file, number, nchar(after[number])))
}
