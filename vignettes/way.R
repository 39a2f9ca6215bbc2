# Draws the way of the data into man/figures/way.svg. Usage, in a clone: Rscript vignettes/way.R
library(ggplot2)

boxes <- data.frame(
  x = c(1, 1, 2, 3, 4, 4, 3, 2, 1), y = c(3, 2, 2, 2, 2, 1, 1, 1, 1),
  what = c("measurements", "simulator", "runs", "emulator", "calibration", "attribution", "mechanisms", "upgrade", "report"),
  how = c("what was measured", "what should\nreproduce it", "the simulator at\nmany parameters", "a fast stand-in\nfor the simulator",
          "parameters, error,\ndiscrepancy, evidence", "what the error\nresponds to", "what could be missing,\ntried one by one",
          "the model that\nthe evidence supports", "cause, gain,\nwhat remains"))
arrows <- data.frame(
  x = c(1.42, 2.42, 3.42, 4, 3.58, 2.58, 1.58), y = c(2, 2, 2, 1.68, 1, 1, 1),
  xend = c(1.58, 2.58, 3.58, 4, 3.42, 2.42, 1.42), yend = c(2, 2, 2, 1.32, 1, 1, 1))
loop <- data.frame(x = 2, y = 1.32, xend = 1.3, yend = 1.68)
tip <- arrow(length = unit(2, "mm"), type = "closed")

picture <- ggplot(boxes, aes(x, y)) +
  geom_segment(aes(xend = xend, yend = yend), arrows, arrow = tip, colour = "grey35") +
  geom_path(data = data.frame(x = c(1.42, 4, 4), y = c(3, 3, 2.32)), arrow = tip, colour = "grey35") +
  geom_segment(aes(xend = xend, yend = yend), loop, arrow = tip, colour = "#0072B2", linetype = 2) +
  annotate("text", 1.9, 1.5, label = "again, with the\nextended model", hjust = 0, size = 3, colour = "#0072B2") +
  geom_tile(width = 0.84, height = 0.64, fill = "#EAF2F8", colour = "#0072B2") +
  geom_text(aes(y = y + 0.17, label = what), fontface = "bold", size = 3.8) +
  geom_text(aes(y = y - 0.1, label = how), size = 3, lineheight = 0.95) +
  coord_cartesian(xlim = c(0.55, 4.45), ylim = c(0.65, 3.35), expand = FALSE) + theme_void()

ggsave("man/figures/way.svg", picture, device = grDevices::svg, width = 8, height = 4.2)
