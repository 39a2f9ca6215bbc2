# Numbers, units and lists as text.

listed <- function(x, last = "and", none = "nothing") {
  if (!length(x)) none else if (length(x) == 1) x else paste(paste(x[-length(x)], collapse = ", "), last, x[length(x)])
}

# A few significant digits, not in powers of ten unless very far from one.
short <- function(x, digits = 2) {
  far <- abs(x) >= 1e7 | (abs(x) < 1e-4 & x != 0)
  text <- ifelse(far, format_each(signif(x, digits)),
                 formatC(signif(x, digits), digits = digits, format = "fg", flag = "#", big.mark = ","))
  ifelse(is.na(x), "\u2013", sub("\\.$", "", text))
}

format_each <- function(x) vapply(x, format, "")

signed <- function(x) ifelse(abs(x) < 9.95, sprintf("%+.1f", x), sprintf("%+.0f", x))

percent <- function(x) {
  digits <- trimws(formatC(100 * x, digits = 2, format = "fg"))
  text <- ifelse(x > 0.999, "over 99.9 %",
                 ifelse(x > 0.99, "over 99 %", ifelse(x < 0.001, "below 0.1 %", paste(digits, "%"))))
  ifelse(is.na(x), "\u2013", text)
}

pretty_unit <- function(unit) gsub("m3", "m\u00b3", gsub("m2", "m\u00b2", unit, fixed = TRUE), fixed = TRUE)

change_words <- function(before, after, unit) {
  pair <- short(c(before, after))
  unit <- if (nzchar(unit)) paste0(" ", pretty_unit(unit)) else ""
  if (pair[1] == pair[2]) paste0("stays at ", pair[1], unit)
  else paste0(if (after < before) "falls" else "rises", " from ", pair[1], " to ", pair[2], unit)
}

# 10^x written out while it can be read.
power_of_ten <- function(x) ifelse(x < 4.5, format_each_comma(signif(10^x, 2)), paste0("10^", round(x)))

format_each_comma <- function(x) vapply(x, format, "", big.mark = ",", scientific = FALSE)

odds <- function(x) {
  size <- power_of_ten(abs(x))
  if (size == "1") return("1 to 1, neither for nor against")
  paste(size, if (x >= 0) "to 1 in favour" else "to 1 against")
}

# A point of the parameters' space, for messages.
point_words <- function(point) {
  names <- colnames(point) %||% names(point)
  paste(names, signif(point, 4), sep = " = ", collapse = ", ")
}

axis_label <- function(name, unit) ifelse(nzchar(unit), paste0(name, " [", pretty_unit(unit), "]"), name)
