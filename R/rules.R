# Every number that decides something, once: its value and unit, what it decides, why it has this
# value, and the benchmark that shows what it does. Code reads rules$name.

rule <- function(value, unit, decides, reason, benchmark) {
  list(value = value, unit = unit, decides = decides, reason = reason, benchmark = benchmark)
}

rule_table <- list(
  scouts_base = rule(2, "runs", "runs over the priors, whatever the number of parameters",
                     "two runs show how far the simulator moves at all", "bench/seeds.R"),
  scouts_parameter = rule(2, "runs", "further runs over the priors for each parameter",
                          "a slope for each parameter, and as many runs again to see it bend",
                          "bench/seeds.R"),
  farthest = rule(4, "sd", "how far from the middle of a prior that is not flat a search may go",
                  "a normal prior has 6e-5 of its mass beyond", "bench/seeds.R"),
  scout_stale = rule(1, "prior sd", "how uncertain slopes are that come from runs over the priors",
                     "the runs lie about a standard deviation apart", "bench/seeds.R"),
  trial_stale = rule(0.3, "prior sd", "how uncertain the slopes are with which a trial begins",
                     "those of the present model are exact at its mode only", "bench/runs.R"),
  search_steps = rule(25, "steps", "the longest search", "the longest that converged took 18",
                      "bench/seeds.R"),
  trial_steps = rule(12, "steps", "the longest search of a trial",
                     "it begins at the mode of the present model", "bench/runs.R"),
  trial_starts = rule(2, "searches", "searches of a trial that ends below the present model",
                      "the second began right in the worlds looked at", "bench/runs.R"),
  search_draws = rule(8, "draws", "draws of error and discrepancy by which a step is judged",
                      "their mean value is exact to a tenth of a nat near the mode", "bench/seeds.R"),
  search_gain = rule(0.5, "nats", "predicted and achieved gain below which a search has converged",
                     "half a nat is a fifth of a decade; local runs find the rest", "bench/seeds.R"),
  leaps = rule(4, "leaps", "how often a search goes on from a place that is worse",
               "the longest ridge took three", "bench/seeds.R"),
  ridge_damping = rule(10, "times", "damping of a step up to which a search may leap",
                       "a heavily damped step sees no farther than the ridge bends", "bench/seeds.R"),
  futile_gain = rule(2.3, "nats", "gain over the present model below which the search of a trial ends",
                     "a decade before what is new has paid for its prior: two could not be reached", "bench/runs.R"),
  resample_gain = rule(2, "nats", "gain after which error and discrepancy are sampled anew",
                       "a smaller gain leaves their posterior nearly where it was", "bench/seeds.R"),
  search_difference = rule(0.05, "prior sd", "difference by which slopes are taken",
                           "small beside the prior, far above rounding", "bench/seeds.R"),
  wide_difference = rule(0.5, "prior sd", "difference if a smaller one shows nothing",
                         "a simulator with thresholds is flat over small ones", "bench/seeds.R"),
  pace = rule(5, "steps", "steps that together must gain a nat for a search to go on",
              "what creeps along a ridge is left to the runs in its region", "bench/seeds.R"),
  renew_after = rule(3, "steps", "failed steps after which slopes are taken by differences",
                     "each failed step has corrected the slopes along one direction", "bench/seeds.R"),
  stalled_after = rule(7, "steps", "failed steps after which a search ends",
                       "with exact slopes and damping of a million nothing is left to try",
                       "bench/seeds.R"),
  most_starts = rule(4, "searches", "searches of a base model before it is said that none agree",
                     "each costs about twenty runs", "bench/seeds.R"),
  mode_depth = rule(10, "nats", "depth below the best mode from which another does not count",
                    "it would hold less than 5e-5 of the posterior", "bench/seeds.R"),
  local_runs = rule(25, "runs", "runs in the region of a mode",
                    "they emulate it to a few hundredths of the noise", "bench/seeds.R"),
  local_parameter = rule(2, "runs", "least runs in a region for each parameter",
                         "a slope for each, and the bend along it", "bench/seeds.R"),
  more_runs = rule(20, "runs", "further runs in a region if the check fails",
                   "two thirds of what it had", "bench/seeds.R"),
  check_runs = rule(16, "runs", "runs at posterior draws that check an emulator",
                    "their mean square is known to a third or better", "bench/seeds.R"),
  first_check = rule(10, "runs", "the same in the first round, before the region is final",
                     "they train the second", "bench/seeds.R"),
  trial_check = rule(4, "runs", "runs that check a trial",
                     "enough to refute an emulator that is off by more than the noise",
                     "bench/runs.R"),
  trial_rounds = rule(4, "rounds", "checks of a trial before it is left as not trusted",
                      "each check also trains", "bench/runs.R"),
  verify_rounds = rule(8, "rounds", "checks of a model before it is left as not trusted",
                       "runs refute it to the end", "bench/seeds.R"),
  slope_draws = rule(32, "draws", "draws of the posterior over which slopes are averaged",
                     "evidences agree over seeds with it, and differ by a decade with slopes at one point",
                     "bench/seeds.R"),
  region_growth = rule(1.15, "times", "the final region over the ellipsoid of its draws",
                       "skewed tails reach further than a normal one's", "bench/parameter_coverage.R"),
  region_tries = rule(4, "tries", "how often a region follows its posterior without new runs",
                      "a posterior that still runs away asks for runs", "bench/seeds.R"),
  tangent_near = rule(0.3, "of the region", "how far the exact tangent may lie from the centre of its region",
                      "how it turns within that the emulator says", "bench/seeds.R"),
  basis_error = rule(0.01, "noise", "what the basis of a local emulator may leave out",
                     "at 0.05 the basis, not the processes, was most of the error", "bench/seeds.R"),
  error_ratio = rule(1 / 3, "noise", "error of the emulator above which it is not good enough",
                     "it then adds a tenth to the variance of the noise", "bench/parameter_coverage.R"),
  effective = rule(0.1, "share", "least effective share of the check runs",
                   "below it the evidence is that of a few runs", "bench/evidence.R"),
  effective_intervals = rule(1 / 3, "share", "the same for intervals of parameters",
                             "tails need more than the mean does", "bench/parameter_coverage.R"),
  effective_good = rule(0.8, "share", "effective share that ends verification in its first rounds",
                        "evidences then agree over seeds to a tenth of a decade", "bench/seeds.R"),
  least_rounds = rule(2, "rounds", "fewest checks of a verified model",
                      "after one, evidences of a model differ by up to a decade over seeds",
                      "bench/seeds.R"),
  good_rounds = rule(3, "rounds", "from which the share for intervals is enough",
                     "two more rounds cost forty runs", "bench/seeds.R"),
  border = rule(0.05, "share", "most of a posterior in the outer tenth of its region",
                "more says that the region cuts it", "bench/parameter_coverage.R"),
  border_intervals = rule(0.01, "share", "the same for intervals of parameters",
                          "a normal posterior has a tenth of it there", "bench/parameter_coverage.R"),
  evidence_error = rule(1, "nats", "standard error of an evidence above which it is not trusted",
                        "a factor of three", "bench/evidence.R"),
  off_change = rule(0.05, "noise", "change of the output below which a mechanism is switched off",
                    "over a thousand rows it moves the likelihood by a nat", "bench/runs.R"),
  effective_trial = rule(0.7, "share", "effective share of the check runs that confirms a trial",
                         "trials below it were off by up to two decades", "bench/runs.R"),
  trial_margin = rule(0.5, "decades", "how far the evidence of a confirmed trial may be off",
                      "nine in ten lie within it of what verification finds", "bench/runs.R"),
  trial_doubt = rule(2, "decades", "the same of one that is not confirmed, and as much again for an error of the noise",
                     "its runs have not reached its mode yet", "bench/runs.R"),
  worst_ratio = rule(4, "noise", "error of an emulator beyond which a trial's bound rises no further",
                     "a trial that lies ten decades behind with it has not won in any world looked at", "bench/runs.R"),
  decisive = rule(2, "decades", "log10 Bayes factor that a mechanism must earn",
                  "a hundred to one (Jeffreys)", "bench/hidden_effects.R"))

rules <- lapply(rule_table, `[[`, "value")

#' The numbers that decide
#'
#' Every threshold and count of the loop: its value, what it decides, why it has this value, and the
#' benchmark that shows what it does.
#'
#' @return A data frame with a row for each rule: `rule`, `value`, `unit`, `decides`, `reason`,
#'   `benchmark`.
#' @source The package's own.
#' @examples
#' head(decision_rules())
#' @export
decision_rules <- function() {
  of <- function(field) vapply(rule_table, `[[`, "", field, USE.NAMES = FALSE)
  data.frame(rule = names(rule_table), value = unlist(rules, use.names = FALSE), unit = of("unit"),
             decides = of("decides"), reason = of("reason"), benchmark = of("benchmark"))
}
