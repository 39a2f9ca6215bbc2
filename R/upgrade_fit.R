# An upgrade asked what a fitted model is asked: its last model answers.
last_fit <- function(upgrade) {
  check_whole(upgrade, "x", call = NULL)
  upgrade$models[[length(upgrade$models)]]$fit
}

#' @rdname posterior
#' @export
coef.amiss_upgrade <- function(object, ...) stats::coef(last_fit(object), ...)

#' @rdname posterior
#' @export
confint.amiss_upgrade <- function(object, parm = NULL, level = 0.95, ...) {
  stats::confint(last_fit(object), parm, level, ...)
}

#' @rdname posterior
#' @export
vcov.amiss_upgrade <- function(object, ...) stats::vcov(last_fit(object), ...)

#' @rdname posterior
#' @export
tidy.amiss_upgrade <- function(x, what = "parameters", conf.level = 0.95, ...) {
  rlang::check_dots_empty()
  if (is.numeric(what)) {
    abort_input(c("{.arg what} is the name of a table, not a number.",
                  i = "The probability of intervals is {.code conf.level = {what}}."))
  }
  check_input(checkmate::check_choice(what, c("parameters", "candidates")), "what")
  if (what == "parameters") return(generics::tidy(last_fit(x), conf.level))
  check_whole(x, "x")
  if (!identical(conf.level, 0.95)) {
    abort_input(c("{.arg conf.level} of {.val candidates} is 0.95.",
                  i = "Their intervals are part of the upgrade."))
  }
  tidy_candidates(x)
}

# The estimates are left out: a table in a cell is no plain column.
tidy_candidates <- function(upgrade) {
  none <- empty_row("", upgrade$models[[1]], "none")[0, ]
  table <- upgrade$candidates %||% cbind(none, probability = numeric())
  table <- table[names(table) != "parameters"]
  names(table)[match(c("lower95", "upper95"), names(table))] <- c("conf.low", "conf.high")
  table
}

#' @rdname fit
#' @export
fitted.amiss_upgrade <- function(object, ...) stats::fitted(last_fit(object), ...)

#' @rdname fit
#' @export
residuals.amiss_upgrade <- function(object, ...) stats::residuals(last_fit(object), ...)

#' @rdname fit
#' @export
nobs.amiss_upgrade <- function(object, ...) stats::nobs(last_fit(object), ...)

#' @rdname fit
#' @export
logLik.amiss_upgrade <- function(object, ...) stats::logLik(last_fit(object))

#' @rdname fit
#' @exportS3Method loo::loo
loo.amiss_upgrade <- function(x, ...) loo.amiss_fit(last_fit(x))

#' @rdname fit
#' @export
augment.amiss_upgrade <- function(x, data = NULL, newdata = NULL, ...) {
  generics::augment(last_fit(x), data = data, newdata = newdata, ...)
}

#' @rdname fit
#' @export
glance.amiss_upgrade <- function(x, ...) {
  check_whole(x, "x")
  g <- x$gain
  data.frame(generics::glance(last_fit(x), ...), adopted = length(x$models) - 1L,
             named_cause = x$named_cause$mechanism %||% NA_character_,
             log10_bf = x$named_cause$log10_bf %||% NA_real_, gain_beside_unknown = g$log10_bf,
             rmse_before = g$rmse_calibration[1], rmse_after = g$rmse_calibration[2],
             rmse_validation_before = g$rmse_validation[1],
             rmse_validation_after = g$rmse_validation[2])
}

#' @rdname predict.amiss_fit
#' @export
predict.amiss_upgrade <- function(object, newdata = NULL, ...)
  stats::predict(last_fit(object), newdata, ...)

#' @rdname simulate.amiss_fit
#' @export
simulate.amiss_upgrade <- function(object, nsim = 1, seed = NULL, ...) {
  stats::simulate(last_fit(object), nsim, seed, ...)
}

#' @rdname as.data.frame.amiss_fit
#' @export
as.data.frame.amiss_upgrade <- function(x, row.names = NULL, optional = FALSE, ...) {
  as.data.frame(last_fit(x), row.names = row.names, ...)
}

#' @rdname as.data.frame.amiss_fit
#' @export
as.matrix.amiss_upgrade <- function(x, ...) as.matrix(last_fit(x), ...)

#' @rdname as.data.frame.amiss_fit
#' @exportS3Method posterior::as_draws_matrix
as_draws_matrix.amiss_upgrade <- function(x, ...) posterior::as_draws_matrix(last_fit(x), ...)

#' @rdname as.data.frame.amiss_fit
#' @exportS3Method posterior::as_draws_df
as_draws_df.amiss_upgrade <- function(x, ...) posterior::as_draws_df(last_fit(x), ...)

#' @rdname as.data.frame.amiss_fit
#' @exportS3Method posterior::as_draws
as_draws.amiss_upgrade <- function(x, ...) posterior::as_draws_df(last_fit(x), ...)
