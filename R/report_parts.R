# What the templates are written with. Each of these writes markdown, and HTML where the document
# becomes HTML. Text from data comes in through one function for each place: markdown_text(),
# html_text(), html_attribute(), and file_stem() for the name of a file.

# Text as it is: nothing in it is markup, but 10^3 is set as a power. All signs of ASCII become
# entities, which pandoc reads after everything that could be markup.
markdown_text <- function(x) {
  plain <- trimws(one_line(x))
  signs <- gregexpr("[!-/:-@[-`{-~]", plain, perl = TRUE)
  regmatches(plain, signs) <- lapply(regmatches(plain, signs), function(sign) {
    sprintf("&#%d;", vapply(sign, utf8ToInt, 0L))
  })
  plain <- gsub("10&#94;((&#45;)?[0-9]+)", "10^\\1^", plain)
  gsub("([0-9]) &#37;", "\\1\u00a0&#37;", plain)
}

# Text of an element of HTML, and of an attribute in quotes. Three backticks would end the raw block
# that holds it.
html_text <- function(x) without_backticks(htmltools::htmlEscape(one_line(x)))

html_attribute <- function(x)
  without_backticks(htmltools::htmlEscape(one_line(x), attribute = TRUE))

without_backticks <- function(html) gsub("`", "&#96;", html, fixed = TRUE)

markdown_items <- function(x)
  if (length(x)) cat("\n", paste0("- ", markdown_text(x), "\n\n"), sep = "")

markdown_paragraphs <- function(x) cat("\n", paste0(markdown_text(x), "\n\n"), sep = "")

# The head of what is said of one mechanism.
mechanism_head <- function(m) {
  verdict <- if (knitr::is_html_output()) paste0(" [", m$verdict, "]{.chip}")
             else paste0(": ", m$verdict)
  cat("\n\n### ", markdown_text(m$name), verdict, "\n\n", sep = "")
}

# A paragraph that begins with a word in bold.
markdown_point <- function(head, x) {
  if (length(x)) cat("\n**", head, "** ", paste(markdown_text(x), collapse = " "), "\n\n", sep = "")
}

# What to inspect next: the first sentences, and the others folded away.
markdown_inspections <- function(told) {
  markdown_items(first_inspections(told))
  markdown_folded(further_inspections(told), "more to inspect")
}

# Items that a reader of HTML opens; elsewhere, and on paper, they are open.
markdown_folded <- function(x, what) {
  if (!length(x)) return(invisible())
  head <- paste(length(x), what)
  if (!knitr::is_html_output()) {
    cat("\n**", markdown_text(head), "**\n\n", sep = "")
    return(markdown_items(x))
  }
  cat("\n```{=html}\n<details class=\"more\"><summary>", html_text(head), "</summary>\n```\n",
      sep = "")
  markdown_items(x)
  cat("\n```{=html}\n</details>\n```\n")
}

# A table without the columns that say nothing.
report_table <- function(table, bold = rep(FALSE, nrow(table))) {
  if (!NROW(table)) return(invisible())
  table <- table[vapply(table, function(x) any(nzchar(as.character(x))), NA)]
  if (knitr::is_html_output()) html_sheet(table, bold) else markdown_sheet(table, bold)
}

html_sheet <- function(table, bold = rep(FALSE, nrow(table))) {
  cell <- function(x, tag) paste0("<", tag, ">", html_text(x), "</", tag, ">", collapse = "")
  rows <- vapply(seq_len(nrow(table)), function(i) {
    paste0("<tr", if (bold[i]) " class=\"adopted\"", ">",
           cell(unlist(lapply(table[i, ], as.character)), "td"), "</tr>")
  }, "")
  cat("\n```{=html}\n<div class=\"scroll\"><table><thead><tr>", cell(names(table), "th"),
      "</tr></thead><tbody>\n", paste(rows, collapse = "\n"), "\n</tbody></table></div>\n```\n",
      sep = "")
}

# A pipe table; its dashes are the widths of the columns: what the longest words need, and of the
# rest of a page what longer texts want.
markdown_sheet <- function(table, bold = rep(FALSE, nrow(table))) {
  cells <- rbind(names(table), as.matrix(data.frame(lapply(table, as.character))))
  needed <- apply(cells, 2, function(x) max(nchar(unlist(strsplit(x, " "))))) + 3
  wanted <- pmax(pmin(40, 0.7 * apply(nchar(cells), 2, max)) - needed, 0)
  left <- max(page_letters - sum(needed), 0)
  widths <- needed + wanted * min(1, left / max(sum(wanted), 1))
  cells[] <- markdown_text(cells)
  strong <- c(FALSE, bold) & nzchar(cells)
  cells[strong] <- paste0("**", cells[strong], "**")
  row <- function(x) paste0("|", paste(x, collapse = "|"), "|")
  dashes <- row(strrep("-", ceiling(widths)))
  cat("\n", paste0(c(row(cells[1, ]), dashes, apply(cells[-1, , drop = FALSE], 1, row)), "\n"),
      "\n", sep = "")
}

page_letters <- 110  # in a line of a table

# Numbers with what they are: in HTML large, side by side.
report_tiles <- function(value, words) {
  if (!knitr::is_html_output()) return(markdown_items(paste0(words, ": ", value)))
  tiles <- paste0("<div><b>", html_text(value), "</b>", html_text(words), "</div>", collapse = "")
  cat("\n```{=html}\n<div class=\"big\">", tiles, "</div>\n```\n", sep = "")
}

narrow_canvas <- 4.2  # inches: of a figure on a phone

# A figure of the result by its name, or one made already. In HTML it is drawn twice, also for a
# narrow page, where letters of the wide one were too small.
report_figure <- function(x, which) {
  figure <- if (inherits(x, "ggplot")) x else ggplot2::autoplot(x, which)
  alt <- paste0(which, ": ", figure$labels$title)
  if (knitr::is_html_output()) return(html_figure(figure, alt))
  file <- knitr::fig_path(".png", number = file_stem(which))
  dir.create(dirname(file), recursive = TRUE, showWarnings = FALSE)
  save_figure(figure, file, dpi = 160)
  size <- if (figure_height(figure) > canvas_width) "height=8.5in" else "width=85%"  # of a page
  cat("\n![", markdown_text(alt), "](", file, "){", size, "}\\\n\n", sep = "")
}

# On the narrow canvas letters are smaller, so that panels need less height.
html_figure <- function(figure, alt) {
  narrow <- with_height(figure, 0.75 * (attr(figure, "height_in") %||% 5))
  drawn <- function(figure, width, dpi) {
    file <- tempfile(fileext = ".png")
    on.exit(unlink(file))
    save_figure(figure, file, width, dpi)
    knitr::image_uri(file)
  }
  cat("\n```{=html}\n<picture><source media=\"screen and (max-width: 620px)\" srcset=\"",
      drawn(narrow, narrow_canvas, 160), "\">",
      "<img src=\"", drawn(figure, canvas_width, 120), "\" alt=\"", html_attribute(alt),
      "\"></picture>\n```\n", sep = "")
}

# The style of a fragment goes with it, as others' documents know nothing of it.
fragment_style <- function() {
  if (!knitr::is_html_output()) return(NULL)
  c("```{=html}", "<style>", readLines(report_path("fragment.css")), "</style>", "```", "")
}

report_path <- function(...) system.file("rmarkdown", ..., package = "amiss", mustWork = TRUE)
