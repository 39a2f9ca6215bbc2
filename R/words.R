# Numbers, units and lists as text.

# Any text as one line of UTF-8: what is no character, or steers a printer, is not shown.
one_line <- function(x) {
  x <- paste(x)
  Encoding(x[Encoding(x) == "bytes"]) <- "unknown"
  x <- iconv(enc2utf8(x), "UTF-8", "UTF-8", sub = "?")
  gsub("(*UTF)[\\s\\x{00}-\\x{1f}\\x{7f}-\\x{9f}\\x{2028}\\x{2029}\\x{fffe}\\x{ffff}]+", " ", x,
       perl = TRUE)
}

# The name of a file, without its extension, of any text: of a new name where signs had to be left
# out or it is long.
file_stem <- function(x) {
  x <- one_line(x)
  stem <- substr(gsub("[^[:alnum:]_.-]+", "_", x), 1, 80)
  changed <- stem != gsub(" ", "_", x, fixed = TRUE)
  stem[changed] <- paste0(stem[changed], "-", substr(vapply(x[changed], rlang::hash, ""), 1, 8))
  stem
}

listed <- function(x, last = "and", none = "nothing") {
  if (!length(x)) none
  else if (length(x) == 1) x
  else paste(paste(x[-length(x)], collapse = ", "), last, x[length(x)])
}

# A first word with a capital, unless it is a name such as x2 or Te.
capital <- function(text)
  sub("^([[:lower:]])(?=[[:lower:]-]+([ ,;:]|$))", "\\U\\1", text, perl = TRUE)

with_article <- function(x) {
  begins_open <- grepl("^(?!(uni[^n]|us|eu|one))([aeiou]|hour)", x, ignore.case = TRUE, perl = TRUE)
  paste(ifelse(begins_open, "an", "a"), x)
}

# A few significant digits, not in powers of ten unless very far from one.
short <- function(x, digits = 2) {
  far <- abs(x) >= 1e7 | (abs(x) < 1e-4 & x != 0)
  text <- ifelse(far, format_each(signif(x, digits)),
                 formatC(signif(x, digits), digits = digits, format = "fg", flag = "#",
                         big.mark = ","))
  ifelse(is.na(x), "\u2013", sub("\\.$", "", text))
}

format_each <- function(x) vapply(x, format, "")

# What rounds to zero has no sign.
signed <- function(x) {
  text <- ifelse(abs(x) < 9.95, sprintf("%+.1f", x), sprintf("%+.0f", x))
  ifelse(text %in% c("-0.0", "+0.0"), "0.0", text)
}

percent <- function(x) {
  digits <- trimws(formatC(100 * x, digits = 2, format = "fg"))
  text <- ifelse(x > 0.999, "over 99.9 %",
                 ifelse(x > 0.99, "over 99 %",
                        ifelse(x < 0.001, "below 0.1 %", paste(digits, "%"))))
  ifelse(is.na(x), "\u2013", text)
}

# As people write them: degrees, powers of metres and seconds, but not m0.5 and not CO2.
pretty_unit <- function(unit) {
  unit <- sub("^deg(C?)$", "\u00b0\\1", unit)
  squared <- gsub("([ms])2(?![0-9.])", "\\1\u00b2", unit, perl = TRUE)
  gsub("([ms])3(?![0-9.])", "\\1\u00b3", squared, perl = TRUE)
}

with_unit <- function(text, unit)
  ifelse(rep_len(nzchar(unit), length(text)), paste(text, pretty_unit(unit)), text)

# Two ends of an interval, with as many digits as distinguish them.
short_ends <- function(lower, upper, digits = 2) {
  for (more in digits + 0:3) {
    ends <- short(c(lower, upper), more)
    if (lower == upper || ends[1] != ends[2]) break
  }
  ends
}

interval_words <- function(lower, upper, digits = 2, between = " to ") {
  mapply(function(l, u) paste(short_ends(l, u, digits), collapse = between), lower, upper,
         USE.NAMES = FALSE)
}

# Estimates and the ends of their intervals as text (a data frame), each row with the same decimals:
# as many as show two digits of the interval's width.
same_decimals <- function(estimate, lower, upper, sign = "") {
  size <- pmax(abs(estimate), abs(lower), abs(upper))
  width <- ifelse(upper - lower > 1e-12 * size, upper - lower, size / 10)
  needed <- 1 - floor(log10(signif(width, 2)))
  decimals <- bounded_digits(needed)
  powers <- is.finite(size) & size > 0 & (size >= 1e7 | size < 1e-4)
  digits <- bounded_digits(floor(log10(size)) + needed)
  text <- function(x) {
    x <- rep_len(x, length(size))
    plain <- sprintf(paste0("%", sign, ".*f"), decimals, x)
    text <- ifelse(powers, sprintf(paste0("%", sign, ".*e"), digits, x), plain)
    # What rounds to zero has no sign.
    text <- ifelse(grepl("^[-+][0.]+$", text), substring(text, 2), text)
    ifelse(is.na(x), NA, text)
  }
  data.frame(estimate = text(estimate), lower = text(lower), upper = text(upper))
}

bounded_digits <- function(x) as.integer(ifelse(is.finite(x), pmin(pmax(x, 0), 15), 0))

# An estimate with its interval in brackets.
with_limits <- function(estimate, lower, upper, sign = "") {
  told <- same_decimals(estimate, lower, upper, sign)
  sprintf("%s [%s, %s]", told$estimate, told$lower, told$upper)
}

# A length of time, as people round it.
duration_words <- function(hours) {
  if (hours >= 48) paste(round(hours / 24), "days")
  else if (hours >= 2) paste(round(hours), "hours")
  else if (hours >= 1 / 30) paste(round(60 * hours), "minutes")
  else paste(signif(3600 * hours, 2), "seconds")
}

# An hour of the day in decimals, as a clock shows it.
clock_words <- function(hour) {
  minutes <- round(60 * hour)
  sprintf("%02d:%02d", minutes %/% 60, minutes %% 60)
}

change_words <- function(before, after, unit) {
  pair <- short(c(before, after))
  if (pair[1] == pair[2]) paste("stays at", with_unit(pair[1], unit))
  else
    paste(if (after < before) "falls" else "rises", "from", pair[1], "to", with_unit(pair[2], unit))
}

# 10^x written out while it can be read.
power_of_ten <- function(x)
  ifelse(x < 6, format_each_comma(signif(10^x, 2)), paste0("10^", round(x)))

format_each_comma <- function(x) vapply(x, format, "", big.mark = ",", scientific = FALSE)

odds <- function(x) {
  if (power_of_ten(abs(x)) == "1") return("1 to 1, neither for nor against")
  paste(odds_size(x), if (x >= 0) "in favour" else "against")
}

odds_size <- function(x) paste(power_of_ten(abs(x)), "to 1")

# An interval of odds in words, left out where both ends read the same and lie on one side.
odds_interval <- function(interval) {
  ends <- power_of_ten(abs(interval))
  if (ends[1] == ends[2] && prod(interval) >= 0) return("")
  told <- if (interval[1] >= 0) paste(ends, collapse = " to ")
  else if (interval[2] <= 0) paste(paste(rev(ends), collapse = " to "), "to 1 against")
  else paste(ends[1], "to 1 against, to", ends[2], "to 1 in favour")
  sprintf(" (95 %% interval: %s)", told)
}

# A point of the parameters' space, for messages.
point_words <- function(point) {
  names <- colnames(point) %||% names(point)
  paste(names, signif(point, 4), sep = " = ", collapse = ", ")
}

axis_label <- function(name, unit)
  ifelse(nzchar(unit), paste0(name, " [", pretty_unit(unit), "]"), name)
