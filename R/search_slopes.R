# The slopes of a search: by differences, given by the simulator, or of the line that runs bend.

renew_slopes <- function(search, context) {
  found <- difference_slopes(search$model, search$at, context)
  search$model <- found$model
  search[c("poor", "since")] <- 0
  if (is.null(found$slopes)) return(search)
  search$reference <- reference_here(search, found$slopes, found$stale)
  search["gains"] <- list(NULL)
  search$trusted <- search$trusted * rules$trust_changes
  search
}

# Slopes that were taken where the search is.
reference_here <- function(search, slopes, stale) {
  utils::modifyList(search$reference, list(z = search$model$runs$z[search$at, ], slopes = slopes,
                                           stale = stale))
}

# Slopes by differences, on the same side wherever the priors allow it; where a small one shows
# nothing, by larger ones on both sides: list(model, slopes, stale, idle), no slopes if the budget
# ends. A difference is the slope half way along it: what the simulator bends over that, other runs
# show. `idle`: the parameters on which nothing depends there.
difference_slopes <- function(model, at, context, asked = names(model$parameters)) {
  z <- model$runs$z[at, ]
  known <- given_slopes(model, z)
  if (!is.null(known)) {
    return(list(model = model, slopes = known[, asked, drop = FALSE], stale = 0,
                idle = asked[colSums(known[, asked, drop = FALSE] != 0) == 0]))
  }
  seen <- function(model, step) {
    points <- matrix(z, length(step), length(z), byrow = TRUE)
    points[cbind(seq_along(step), match(names(step), names(z)))] <- z[names(step)] + step
    made <- with_runs(model, points, context)
    if (length(made$at) < length(step)) return(list(model = made$model))
    change <- made$model$runs$outputs[, made$at, drop = FALSE] - made$model$runs$outputs[, at]
    slopes <- sweep(change, 2, step, "/")
    failed <- colSums(!is.finite(slopes)) > 0
    slopes[, failed] <- 0
    list(model = made$model, slopes = slopes, stale = rules$search_difference / 2,
         idle = names(step)[colSums(slopes != 0) == 0 & !failed])
  }
  side <- difference_side(z, model$space)[asked]
  found <- seen(model, rules$search_difference * side)
  if (is.null(found$slopes)) return(found)
  flat <- asked[colSums(found$slopes^2) == 0]
  if (!length(flat)) return(found)
  up <- seen(found$model, rules$wide_difference * side[flat])
  down <- seen(up$model, -rules$wide_difference * side[flat])
  if (is.null(up$slopes) || is.null(down$slopes)) return(list(model = down$model))
  found$slopes[, match(flat, asked)] <- (up$slopes + down$slopes) / 2
  list(model = down$model, slopes = found$slopes, stale = found$stale,
       idle = Reduce(intersect, list(found$idle, up$idle, down$idle)))
}

# Those that the simulators give themselves, for a unit of z; NULL unless all do.
given_slopes <- function(model, z) {
  unit <- to_unit(rbind(z), model$space)
  by <- 1e-4
  ends <- lapply(c(-by, by), function(step) to_unit(rbind(z + step), model$space))
  slopes <- matrix(0, length(model$target), length(z), dimnames = list(NULL, names(z)))
  for (k in seq_along(model$simulators)) {
    own <- model$own[[k]]
    parameters <- model$parameters[own]
    value <- function(unit) unit_to_values(unit[, own, drop = FALSE], parameters)
    seen <- measured_slopes(model$simulators[[k]], value(unit), model$records[[k]]$measurements)
    if (is.null(seen)) return(NULL)
    way <- from_unit(ends[[2]], model$space) - from_unit(ends[[1]], model$space)
    per_z <- as.numeric(value(ends[[2]]) - value(ends[[1]])) / way[, own]
    slopes[model$rows[[k]], own] <- sweep(seen, 2, per_z, "*")
  }
  slopes
}

# Upwards, but where that would leave the prior.
difference_side <- function(z, space) {
  room <- rules$wide_difference
  ifelse(z > pmax(pmin(1, space$upper - room), space$lower + room), -1, 1)
}

# The simulator about a run, from slopes known elsewhere and from the runs near it, but for the
# first `others` of the model. With s the way from the run, J0 the reference slopes and A fitted to
# the runs, f(z + s) = f(z) + J0 s + sum_i A_i k(s, s_i), k(s, s') = 4 d^2 s's' + (s's')^2. A
# simulator bends by c |s|^2 over a way s. So its slopes turn by 2 c d over the way d from where the
# reference held; the bend itself has the second term for a prior, as in minimum-norm quadratic
# models (Powell 2004); and as the bend turns over a way L, run i fits to within c |s_i|^3 / L. c
# cancels.
bent_line <- function(model, at, reference) {
  z <- model$runs$z[at, ]
  scale <- way_scale(reference)
  ways <- sweep(sweep(model$runs$z, 2, z), 2, scale, "*")
  squared <- rowSums(ways^2)
  near <- which(succeeded(model) & squared > 1e-8 &
                  seq_along(squared) > (reference$others %||% 0))
  near <- utils::head(near[order(squared[near])], rules$bent_runs * length(z))
  bent <- list(output = model$runs$outputs[, at], slopes = sweep(reference$slopes, 2, scale, "/"),
               scale = scale, d2 = 4 * (sum((scale * (z - reference$z))^2) + reference$stale^2),
               ways = ways[near, , drop = FALSE])
  dot <- tcrossprod(bent$ways)
  of_way <- squared[near]  # rows and columns in units of |s|^2: near and far runs have one size
  covariance <- (bent$d2 * dot + dot^2) / outer(of_way, of_way)
  diag(covariance) <- diag(covariance) * (1 + 1e-8) + of_way / rules$bend_length^2
  missed <- model$runs$outputs[, near, drop = FALSE] - bent$output -
    tcrossprod(bent$slopes, bent$ways)
  bent$weights <- missed
  if (length(near)) bent$weights <- t(solve(covariance, t(missed) / of_way) / of_way)
  bent
}

# A way counts as long as the simulator moves along it, beside the parameter that moves it most
# (More 1978).
way_scale <- function(reference) {
  moves <- sqrt(colSums(reference$slopes^2))
  if (all(moves == 0)) moves[] <- 1
  unname(pmax(moves / max(moves), rules$least_scale))
}

# Its output a way from the run, and its slopes there.
along <- function(bent, way) {
  way <- bent$scale * way
  dot <- (bent$ways %*% way)[, 1]
  slopes <- bent$slopes + bent$weights %*% ((bent$d2 + 2 * dot) * bent$ways)
  list(output = bent$output + (bent$slopes %*% way + bent$weights %*% (bent$d2 * dot + dot^2))[, 1],
       slopes = sweep(slopes, 2, bent$scale, "*"))
}

secant_slopes <- function(model, at, reference) {
  slopes <- along(bent_line(model, at, reference), numeric(length(reference$z)))$slopes
  steep <- too_steep(model, at, slopes)
  slopes[, steep] <- reference$slopes[, steep]
  slopes
}

# Slopes far beyond those of the ways to runs that lie apart: those of a jump between two runs that
# lie close to one another.
too_steep <- function(model, at, slopes) {
  apart <- sqrt(rowSums(sweep(model$runs$z, 2, model$runs$z[at, ])^2))
  far <- which(succeeded(model) & apart >= rules$search_difference)
  if (!length(far)) return(logical(ncol(slopes)))
  from <- model$runs$outputs[, at]
  differ <- vapply(far, function(k) over_noise(model, model$runs$outputs[, k] - from), 0)
  over_noise(model, slopes) > rules$steepest * max(differ / apart[far])
}

# Slopes about a run by regression on all runs over the priors, nearer ones weighing more.
regression_slopes <- function(model, at) {
  ways <- sweep(model$runs$z, 2, model$runs$z[at, ])
  fine <- succeeded(model)
  x <- cbind(1, ways)[fine, , drop = FALSE]
  weights <- 1 / (rules$scout_near + rowSums(ways^2)[fine])
  penalty <- diag(c(0, rep(rules$scout_ridge, ncol(ways))), ncol(x))
  coefficients <- solve(crossprod(x * sqrt(weights)) + penalty,
                        crossprod(x * weights, t(model$runs$outputs[, fine, drop = FALSE])))
  t(coefficients[-1, , drop = FALSE])
}
