# The families of worlds: how one is drawn, what may be hidden, and whether the rivals, which are
# made for buildings whose output follows their boundary conditions smoothly, are asked as well.
# Sourced after the files of the families.

families <- list(
  box = list(draw = draw_world, kinds = world_kinds, mechanisms = catalogue_kinds, rivals = TRUE),
  network = list(draw = draw_network_world, kinds = c("none", names(network_pieces)),
                 mechanisms = names(network_pieces), rivals = TRUE),
  runoff = list(draw = draw_runoff_world, kinds = c("none", names(runoff_boundary)),
                mechanisms = names(runoff_boundary), rivals = FALSE),
  wrong = list(draw = draw_wrong_world, kinds = c("none", catalogue_kinds, names(network_pieces)),
               mechanisms = c(catalogue_kinds, names(network_pieces)), rivals = FALSE))

family_world <- function(family, seed, ...) families[[family]]$draw(seed, ...)
