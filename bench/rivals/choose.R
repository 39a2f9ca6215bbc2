# What all rivals share: forward selection over the mechanisms of a world, as the loop of the
# package does it, at most two of them.

#' @param fit_model Function of a simulator, the fit of the model that it extends (`NULL` for the
#'   base) and its mechanisms, that returns a fit: a list with `values` of the parameters, `runs`,
#'   `seconds`, and what `better` compares.
#' @param better Function of the fits of all extensions and of the present model: the position of
#'   the extension that is adopted, or `NULL` if none is.
#' @return adopted, the names of the mechanisms in turn; rmse, held out, of the last model; runs;
#'   seconds.
choose_forward <- function(world, fit_model, better, most = 2) {
  simulator <- world$base
  present <- fit_model(simulator, NULL, character())
  spent <- c(runs = present$runs, seconds = present$seconds)
  adopted <- character()
  while (length(adopted) < most) {
    left <- setdiff(names(world$catalogue), adopted)
    extended <- lapply(left, function(name) world$catalogue[[name]]$edit(simulator))
    fits <- Map(function(extension, name) fit_model(extension, present, c(adopted, name)), extended,
                left)
    for (what in names(spent)) spent[what] <- spent[what] + sum(vapply(fits, `[[`, 0, what))
    chosen <- better(unname(fits), present)
    if (is.null(chosen)) break
    adopted <- c(adopted, left[chosen])
    present <- fits[[chosen]]
    simulator <- extended[[chosen]]
  }
  list(adopted = adopted, rmse = held_out_rmse(simulator, present$values, world$measurements),
       runs = spent[["runs"]], seconds = spent[["seconds"]])
}

# A fit by its method, timed; what rules have in common is computed once.
timed_fits <- function(fit, m, seed) {
  known <- new.env()
  function(simulator, from, mechanisms) {
    key <- paste(c("base", mechanisms), collapse = " + ")
    if (is.null(known[[key]])) {
      seconds <- system.time(found <- fit(simulator, from, m, seed))[["elapsed"]]
      assign(key, c(found, seconds = seconds), known)
    }
    known[[key]]
  }
}

held_out_rmse <- function(simulator, values, m) {
  values <- values[names(amiss::free_parameters(simulator))]
  y <- m$y[m$use == "validate" & !is.na(m$y)]
  sqrt(mean((amiss:::simulate_measured(simulator, t(values), m, "validate", 1L)[, 1] - y)^2))
}

# Parameters of the present model keep their values; those of a mechanism begin where they act
# little, in the middle, and at a place drawn.
starts_from <- function(parameters, from, seed) {
  places <- amiss:::with_seed(seed, stats::runif(length(parameters), 0.1, 0.9))
  starts <- list(rep(0.5, length(parameters)), places)
  if (is.null(from)) {
    again <- amiss:::with_seed(seed + 1L, stats::runif(length(parameters), 0.1, 0.9))
    return(c(starts, list(again)))
  }
  known <- match(names(parameters), names(from$unit))
  keep <- function(start) ifelse(is.na(known), start, from$unit[known])
  little <- replace(rep(0.5, length(parameters)), which(is.na(known))[1], 0.05)
  lapply(c(list(little), starts), keep)
}
