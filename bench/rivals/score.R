# One world, by all rivals: a row each.
score_rivals <- function(world, asked) {
  m <- world$measurements
  seed <- fit_seed(world)
  by_least_squares <- timed_fits(fit_autoregressive, m, seed)
  rivals <- list(
    bic = function() choose_forward(world, by_least_squares, least_bic(0)),
    bic10 = function() choose_forward(world, by_least_squares, least_bic(10)),
    importance = function()
      choose_forward(world, timed_fits(fit_importance, m, seed), most_evident()),
    kalman = function() if (world$family == "network")
      choose_forward(world, timed_fits(fit_kalman, m, seed), likelihood_ratio))
  rows <- lapply(asked, function(name) {
    found <- rivals[[name]]()
    if (!is.null(found)) rival_row(world, name, found)
  })
  do.call(rbind, rows)
}

rival_row <- function(world, rival, found) {
  true <- intersect(world$kinds, names(world$catalogue))
  data.frame(
    family = world$family, seed = world$seed, kind = world$kind, strength = world$strength,
    achieved = world$achieved, hidden = length(true), rival = rival,
    first = c(found$adopted, NA)[1], adopted = length(found$adopted),
    right_first = c(found$adopted, NA)[1] %in% true, wrong = sum(!found$adopted %in% true),
    rmse = found$rmse / mean(world$measurements$noise_sd), runs = found$runs,
    seconds = found$seconds)
}

# The rows of the package for worlds that its rivals have seen: adopted, and only what is named.
amiss_rows <- function(folders, rivals) {
  files <- list.files(folders, "[.]rds$", full.names = TRUE)
  rows <- lapply(files, function(file) {
    world <- readRDS(file)
    same <- rivals[rivals$family == world$family & rivals$seed == world$seed, ]
    if (!is.null(world$error) || !nrow(same)) return(NULL)
    row <- same[1, ]
    of <- function(label, mechanisms) {
      row$rival <- label
      row$first <- c(mechanisms, NA)[1]
      row$adopted <- length(mechanisms)
      row$right_first <- row$first %in% world$true_mechanism
      row$wrong <- sum(!mechanisms %in% world$true_mechanism)
      row$rmse <- world$held_out / world$noise_sd
      row$runs <- world$runs_total
      row$seconds <- world$wall_s
      row
    }
    rbind(of("amiss, adopted", world$adopted), of("amiss, named", named_mechanisms(world)))
  })
  do.call(rbind, rows)
}

# For each family and rival: the right mechanism first, by strength; what is adopted without being
# there; the error on held-out data over the noise, runs and seconds, medians.
rival_table <- function(rows) {
  count <- function(right, of) sprintf("%d of %d", sum(right & of), sum(of))
  one <- function(r) {
    strong <- r$hidden > 0 & r$achieved >= 1.95
    weak <- r$hidden > 0 & !strong
    none <- r$hidden == 0
    data.frame(family = r$family[1], rival = r$rival[1], worlds = nrow(r),
               strong_right = count(r$right_first, strong), weak_right = count(r$right_first, weak),
               nothing_there = count(r$adopted > 0, none), some_wrong = sum(r$wrong > 0),
               held_out = stats::median(r$rmse), runs = stats::median(r$runs),
               seconds = stats::median(r$seconds))
  }
  groups <- split(rows, list(rows$rival, rows$family), drop = TRUE)
  do.call(rbind, unname(lapply(groups, one)))
}
