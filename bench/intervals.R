# Whether the intervals of a table of tidy() hold the true values: of a parameter with several
# modes, whether one of them does. TRUE or FALSE for each parameter of `true`, by its name.
holds <- function(table, true, kind = "conf") {
  low <- table[[paste0(kind, ".low")]]
  high <- table[[paste0(kind, ".high")]]
  vapply(names(true), function(name) {
    own <- table$term == name
    any(low[own] <= true[[name]] & true[[name]] <= high[own])
  }, NA)
}
