#' Priors of model parameters
#'
#' A prior is a distribution on one parameter, in that parameter's unit. `normal()` and
#' `lognormal()` may be truncated.
#'
#' The design, the emulator and the sampler work on the unit cube. A prior's quantile function maps
#' the cube onto the parameters, so the prior is uniform on the cube.
#'
#' @param lower,upper Ends of the distribution of `uniform()`, `triangular()` and `beta_prior()`
#'   (the shape of `beta_prior()` is stretched to them). `normal()` and `lognormal()` are cut off
#'   there and scaled up again.
#' @param mean,sd Mean and standard deviation (before truncation).
#' @param meanlog,sdlog Mean and standard deviation of the logarithm.
#' @param shape1,shape2 Shapes of the beta distribution on `[lower, upper]`.
#' @param mode The most likely value.
#' @return An object of class `amiss_prior`.
#' @examples
#' uniform(0.03, 0.05)
#' normal(20, 2, lower = 15)
#' @name prior
NULL

new_prior <- function(family, parameters, lower, upper, call) {
  if (!is.finite(lower) && family %in% c("uniform", "triangular", "beta") ||
      !is.finite(upper) && family %in% c("uniform", "triangular", "beta")) {
    abort_input(paste("A {family} prior needs finite limits; got lower = {.val {lower}}, upper =",
                      "{.val {upper}}."), call = call)
  }
  if (is.na(lower) || is.na(upper) || lower >= upper) {
    abort_input(c(paste("A {family} prior needs lower < upper; got lower = {.val {lower}}, upper =",
                        "{.val {upper}}."), i = "Exchange or widen the limits."), call = call)
  }
  if (family %in% c("uniform", "triangular", "beta") && !is.finite(upper - lower)) {
    abort_input("A {family} prior from {.val {lower}} to {.val {upper}} is wider than numbers go.",
                call = call)
  }
  prior <- structure(list(family = family, parameters = parameters, lower = lower, upper = upper),
                     class = "amiss_prior")
  mass <- diff(untruncated_cdf(prior, c(lower, upper)))
  if (!is.finite(mass) || mass < 1e-8) {
    abort_input(c(paste("A {family} prior has no mass between its limits {.val {lower}} and",
                        "{.val {upper}}."), i = "Move the limits to where the distribution is."),
                call = call)
  }
  prior
}

number <- function(x, name, lower = -Inf, call = rlang::caller_env()) {
  check_input(checkmate::check_number(x, lower = lower, finite = TRUE), name, call = call)
  as.numeric(x)
}

limit <- function(x, name, call = rlang::caller_env()) {
  check_input(checkmate::check_number(x), name, call = call)
  as.numeric(x)
}

#' @rdname prior
#' @export
uniform <- function(lower, upper) {
  new_prior("uniform", list(), limit(lower, "lower"), limit(upper, "upper"), rlang::current_env())
}

#' @rdname prior
#' @export
normal <- function(mean, sd, lower = -Inf, upper = Inf) {
  new_prior(
    "normal", list(mean = number(mean, "mean"), sd = number(sd, "sd", .Machine$double.xmin)),
    limit(lower, "lower"), limit(upper, "upper"), rlang::current_env())
}

#' @rdname prior
#' @export
lognormal <- function(meanlog, sdlog, lower = 0, upper = Inf) {
  new_prior("lognormal",
            list(meanlog = number(meanlog, "meanlog"),
                 sdlog = number(sdlog, "sdlog", .Machine$double.xmin)),
            limit(lower, "lower"), limit(upper, "upper"), rlang::current_env())
}

#' @rdname prior
#' @export
beta_prior <- function(shape1, shape2, lower = 0, upper = 1) {
  new_prior("beta", list(shape1 = number(shape1, "shape1", .Machine$double.xmin),
                         shape2 = number(shape2, "shape2", .Machine$double.xmin)),
            limit(lower, "lower"), limit(upper, "upper"), rlang::current_env())
}

#' @rdname prior
#' @export
triangular <- function(lower, mode, upper) {
  mode <- number(mode, "mode")
  prior <- new_prior("triangular", list(mode = mode), limit(lower, "lower"), limit(upper, "upper"),
                     rlang::current_env())
  if (mode < lower || mode > upper) {
    abort_input(
      "A triangular prior needs lower <= mode <= upper; got {.val {c(lower, mode, upper)}}.")
  }
  prior
}

untruncated_cdf <- function(prior, x) {
  p <- prior$parameters
  switch(prior$family,
    uniform = stats::punif(x, prior$lower, prior$upper),
    normal = stats::pnorm(x, p$mean, p$sd),
    lognormal = stats::plnorm(x, p$meanlog, p$sdlog),
    beta = stats::pbeta((x - prior$lower) / (prior$upper - prior$lower), p$shape1, p$shape2),
    triangular = triangular_cdf(x, prior$lower, p$mode, prior$upper))
}

untruncated_quantile <- function(prior, u) {
  p <- prior$parameters
  switch(prior$family,
    uniform = stats::qunif(u, prior$lower, prior$upper),
    normal = stats::qnorm(u, p$mean, p$sd),
    lognormal = stats::qlnorm(u, p$meanlog, p$sdlog),
    beta = prior$lower + (prior$upper - prior$lower) * stats::qbeta(u, p$shape1, p$shape2),
    triangular = triangular_quantile(u, prior$lower, p$mode, prior$upper))
}

untruncated_density <- function(prior, x) {
  p <- prior$parameters
  switch(prior$family,
    uniform = stats::dunif(x, prior$lower, prior$upper),
    normal = stats::dnorm(x, p$mean, p$sd),
    lognormal = stats::dlnorm(x, p$meanlog, p$sdlog),
    beta = stats::dbeta((x - prior$lower) / (prior$upper - prior$lower), p$shape1,
                        p$shape2) / (prior$upper - prior$lower),
    triangular = triangular_density(x, prior$lower, p$mode, prior$upper))
}

triangular_density <- function(x, a, m, b) {
  ifelse(x < m, 2 * (x - a) / ((b - a) * max(m - a, .Machine$double.xmin)),
         2 * (b - x) / ((b - a) * max(b - m, .Machine$double.xmin)))
}

triangular_cdf <- function(x, a, m, b) {
  x <- pmin(pmax(x, a), b)
  ifelse(x <= m, if (m > a) (x - a)^2 / ((b - a) * (m - a)) else 0,
         if (b > m) 1 - (b - x)^2 / ((b - a) * (b - m)) else 1)
}

triangular_quantile <- function(u, a, m, b) {
  at_mode <- (m - a) / (b - a)
  ifelse(u <= at_mode, a + sqrt(u * (b - a) * (m - a)), b - sqrt((1 - u) * (b - a) * (b - m)))
}

# F(x) and its inverse with the truncation taken in: u is uniform on (0, 1).
prior_cdf <- function(prior, x) {
  limits <- untruncated_cdf(prior, c(prior$lower, prior$upper))
  pmin(pmax((untruncated_cdf(prior, x) - limits[1]) / (limits[2] - limits[1]), 0), 1)
}

prior_quantile <- function(prior, u) {
  limits <- untruncated_cdf(prior, c(prior$lower, prior$upper))
  pmin(pmax(untruncated_quantile(prior, limits[1] + u * (limits[2] - limits[1])), prior$lower),
       prior$upper)
}

prior_density <- function(prior, x) {
  limits <- untruncated_cdf(prior, c(prior$lower, prior$upper))
  untruncated_density(prior, x) / (limits[2] - limits[1])
}

#' @export
format.amiss_prior <- function(x, ...) {
  values <- c(x$parameters,
              if (is.finite(x$lower) || is.finite(x$upper)) list(lower = x$lower, upper = x$upper))
  paste0(x$family, "(", paste(names(values), vapply(values, format, "", digits = 4), sep = " = ",
                              collapse = ", "), ")")
}

#' @export
print.amiss_prior <- function(x, ...) {
  cat(format(x), "\n", sep = "")
  invisible(x)
}

#' Declare a free parameter in its place
#'
#' Puts a free parameter, an unknown that calibration finds, in place of a number in a model's
#' description. The same name may stand in several places. It is then one parameter, and must carry
#' the same prior.
#'
#' @param name Name of the parameter.
#' @param prior Its [prior].
#' @param unit Its unit, for people.
#' @param label One short phrase for people; the name if not given. If two parameters of a model
#'   share a label, or the label is the name of another parameter, it is shown with the parameter's
#'   name behind it.
#' @return An object of class `amiss_free`.
#' @examples
#' free("k_insulation", uniform(0.03, 0.05), unit = "W/mK")
#' @export
free <- function(name, prior, unit = "", label = name) {
  check_input(checkmate::check_string(name, min.chars = 1), "name")
  check_object(prior, "amiss_prior", "prior", "Give for example {.code uniform(0, 1)}.")
  check_input(checkmate::check_string(unit), "unit")
  check_input(checkmate::check_string(label), "label")
  structure(list(name = name, prior = prior, unit = unit, label = label), class = "amiss_free")
}

#' @export
format.amiss_free <- function(x, ...) paste0("free(", x$name, ": ", format(x$prior),
                                             if (nzchar(x$unit)) paste0(" ", x$unit), ")")

#' @export
print.amiss_free <- function(x, ...) {
  cat(format(x), "\n", sep = "")
  invisible(x)
}

# Labels that distinguish parameters: one that two share, or that is the name of another, has its
# own name behind it.
distinct_labels <- function(parameters) {
  label <- vapply(parameters, `[[`, "", "label")
  name <- names(parameters)
  label[!nzchar(trimws(label))] <- name[!nzchar(trimws(label))]
  shared <- duplicated(label) | duplicated(label, fromLast = TRUE)
  unclear <- label != name & (shared | label %in% name)
  label[unclear] <- paste0(label[unclear], " (", name[unclear], ")")
  stats::setNames(make.unique(label, " "), name)
}

# Such labels with the names that code takes.
labels_with_names <- function(label, name) {
  known <- label == name | endsWith(label, paste0(" (", name, ")"))
  unname(ifelse(known, label, sprintf("%s (%s)", label, name)))
}

parameter_titles <- function(parameters)
  labels_with_names(distinct_labels(parameters), names(parameters))

to_normal <- function(unit) stats::qnorm(pmin(pmax(unit, 1e-15), 1 - 1e-15))
