# A figure is fitted to its canvas when it is drawn: texts are wrapped by their measured width in
# the font of the device at hand, letters shrink on a narrow canvas, panels go below each other, and
# labels at the ends of lines get room.

canvas_width <- 9  # inches: here letters have their full size
letter_points <- 15
margin_points <- 14
title_size <- 1.13  # of the letters
subtitle_size <- 0.9

# ggplot2 builds a figure when it is drawn, on the device that it is drawn on.
#' @importFrom ggplot2 ggplot_build
#' @export
ggplot_build.amiss_figure <- function(plot, ...) {
  class(plot) <- setdiff(class(plot), "amiss_figure")
  on_canvas(ggplot2::ggplot_build(fit_to_canvas(plot)))
}

# Runs `code` with a device to measure on, a blank one of usual width where none is open.
on_canvas <- function(code) {
  if (grDevices::dev.cur() == 1) {
    grDevices::pdf(NULL, width = canvas_width)
    on.exit(grDevices::dev.off())
  }
  code
}

canvas_inches <- function() {
  c(width = grid::convertWidth(grid::unit(1, "npc"), "inches", valueOnly = TRUE),
    height = grid::convertHeight(grid::unit(1, "npc"), "inches", valueOnly = TRUE))
}

letter_scale <- function(width = canvas_inches()[["width"]])
  min(1, max(0.75, width / canvas_width))

figure_family <- function() getOption("amiss.font", "")

fit_to_canvas <- function(plot) {
  inches <- canvas_inches()
  scale <- letter_scale()
  family <- plot$theme$text$family %||% ""
  wrap <- function(text, width, size, face = "plain") {
    if (is.character(text)) wrap_measured(text, width, letter_points * scale * size, face, family)
    else text
  }
  inside <- inches[["width"]] - 2 * margin_points / 72.27
  plot$labels["title"] <- list(wrap(plot$labels$title, inside, title_size, "bold"))
  plot$labels["subtitle"] <- list(wrap(plot$labels$subtitle, inside, subtitle_size))
  plot$labels["x"] <- list(wrap(plot$labels$x, 0.7 * inside, 1))
  plot$labels["y"] <- list(wrap(plot$labels$y, 0.7 * inches[["height"]], 1))
  plot$layers <- lapply(plot$layers, fit_text_layer, scale, family)
  plot$facet <- fit_columns(plot$facet, inches[["width"]])
  right <- margin_points + 72.27 * end_label_width(plot, scale, family)
  narrow <- inches[["width"]] < 6
  if (!narrow) plot <- with_key_rows(plot, 0.7 * inside, scale, family)
  plot + ggplot2::theme(
    text = ggplot2::element_text(size = letter_points * scale),
    plot.margin = ggplot2::margin(8, right, 8, 8),
    legend.direction = if (narrow) "vertical" else "horizontal",
    legend.box = if (narrow) "vertical" else "horizontal", legend.box.just = "left")
}

fit_text_layer <- function(layer, scale, family) {
  if (!inherits(layer$geom, "GeomText")) return(layer)
  fitted <- list(size = (layer$aes_params$size %||% 4.4) * scale, family = family)
  ggplot2::ggproto(NULL, layer, aes_params = utils::modifyList(layer$aes_params, fitted))
}

narrow_columns <- function(columns, width) max(1, min(columns, floor(width / 2.6)))

fit_columns <- function(facet, width) {
  columns <- facet$params$ncol
  if (is.null(columns)) return(facet)
  ggplot2::ggproto(NULL, facet, params = utils::modifyList(
    facet$params, list(ncol = narrow_columns(columns, width))))
}

# Labels that begin at a point may reach beyond the panel, into the margin.
with_end_labels <- function(figure, labels) {
  attr(figure, "end_labels") <- labels
  figure
}

end_label_width <- function(plot, scale, family) {
  labels <- attr(plot, "end_labels")
  if (!length(labels)) 0 else max(text_inches(labels, 4.6 * scale * 72.27 / 25.4, "plain", family))
}

# Keys of colours, shapes and sizes whose labels are measured; a legend begins at the panel, and has
# no room for many of them in one row.
with_keys <- function(figure, labels) {
  attr(figure, "keys") <- as.character(labels)
  figure
}

key_inches <- 0.5  # of a key without its label

with_key_rows <- function(plot, width, scale, family) {
  labels <- attr(plot, "keys")
  points <- letter_points * scale * subtitle_size
  rows <- ceiling(sum(text_inches(labels, points, "plain", family) + key_inches) / width)
  if (rows < 2) return(plot)
  keys <- ggplot2::guide_legend(nrow = rows, byrow = TRUE)
  plot + ggplot2::guides(colour = keys, fill = keys, shape = keys, size = keys)
}

# ---- measuring

text_inches <- function(text, points, face = "plain", family = "") {
  gp <- grid::gpar(fontsize = points, fontface = face, fontfamily = family)
  vapply(as.character(text), function(t) {
    grid::convertWidth(grid::grobWidth(grid::textGrob(t, gp = gp)), "inches", valueOnly = TRUE)
  }, 0, USE.NAMES = FALSE)
}

# Lines no wider than `width` inches; a number stays beside its "%", a last word of three letters or
# fewer (a unit) beside the one before it, and a word wider than a line is broken.
wrap_measured <- function(text, width, points, face = "plain", family = "") {
  measure <- function(t) text_inches(t, points, face, family)
  wrap_line <- function(line) {
    words <- strsplit(gsub("([0-9]) %", "\\1\u00a0%", line), " +")[[1]]
    last <- utils::tail(words, 2)
    if (length(last) == 2 && nchar(last[2]) <= 3 && measure(paste(last, collapse = " ")) <= width) {
      words <- c(utils::head(words, -2), paste(last, collapse = "\u00a0"))
    }
    words <- unlist(lapply(words, break_word, width, measure))
    lines <- Reduce(function(lines, word) {
      longer <- paste(lines[length(lines)], word)
      if (measure(longer) <= width) c(lines[-length(lines)], longer) else c(lines, word)
    }, words[-1], words[1])
    gsub("\u00a0", " ", paste(lines, collapse = "\n"))
  }
  vapply(as.character(text), function(t) {
    if (is.na(t) || !nzchar(t)) return(t)
    paste(vapply(strsplit(t, "\n")[[1]], wrap_line, ""), collapse = "\n")
  }, "", USE.NAMES = FALSE)
}

break_word <- function(word, width, measure) {
  if (measure(word) <= width || nchar(word) < 2) return(word)
  n <- nchar(word)
  fits <- max(1, which(measure(substring(word, 1, seq_len(n - 1))) <= width))
  c(substr(word, 1, fits), break_word(substring(word, fits + 1), width, measure))
}

# For scales and facets, which ask for their labels when they are drawn: wrapped to a share of the
# canvas.
wrap_labels <- function(share) {
  function(x) {
    wrap_measured(x, share * canvas_inches()[["width"]], letter_points * letter_scale(), "bold",
                  figure_family())
  }
}

# Strips above `columns` panels beside each other, or beside `rows` panels, turned.
wrap_strips <- function(columns = 1) {
  ggplot2::as_labeller(
    function(x) wrap_labels(0.85 / narrow_columns(columns, canvas_inches()[["width"]]))(x))
}

wrap_turned <- function(rows) {
  ggplot2::as_labeller(function(x) {
    wrap_measured(x, 0.6 * canvas_inches()[["height"]] / rows, letter_points * letter_scale(),
                  "bold", figure_family())
  })
}
