#' Mechanisms and catalogues
#'
#' `mechanism()` makes a named physical change to a model. It consists of the edit that makes the
#' change, the boundary conditions that drive it and one sentence for a person. `catalogue()`
#' collects the mechanisms that make sense for a model.
#'
#' # Mechanisms of given runs
#'
#' If the model is an [ensemble()] of given runs, `edit` is another ensemble, of runs with the
#' mechanism. It may also be a function of the present ensemble that returns one. An ensemble is
#' tried only while it has the parameters of all that was adopted before it.
#'
#' # Several records
#'
#' If `edit` has two arguments, the second is the name of the record. If there are several records,
#' `edit` is called for each in turn. It may return the simulator as it is if the mechanism does not
#' act there. A single record that is not given in a list has the name of the measurements.
#'
#' @param name Short name.
#' @param edit Function of a simulator that returns the extended simulator, with the mechanism's
#'   parameters declared by [free()]. It may be an edit of a [zone()], [with_parameters()] of a
#'   function, [with_template()] of a program or [with_fmu()] of an FMU.
#' @param boundary Names of the boundary conditions that drive the mechanism; `character()` for
#'   none. Without them it would do nothing, or always the same. If the mechanism acts on a state,
#'   give the conditions that drive the state. `log10_bf` is the factor without an unknown response
#'   to them, so that a wrong name here changes it ([upgrade_model()], *Candidates*). They also
#'   decide the order of trials, what is reported as the cause, and one doubt
#'   (`vignette("algorithm", "amiss")`, *Naming*). `beside_unknown` does not depend on them.
#' @param sentence One sentence for a person: what it means if this mechanism is the cause.
#' @return `mechanism()`: an object of class `amiss_mechanism`; `catalogue()`: of class
#'   `amiss_catalogue`.
#' @examples
#' brighter <- function(values, drivers, base) base(values) + values[["sun"]] * drivers[, "Gv"]
#' sun <- mechanism("sun", boundary = "Gv", sentence = "Sun enters that the model leaves out.",
#'                  edit = function(model) {
#'   with_parameters(model, free("sun", uniform(0, 0.1), "K m2/W"), boundary = "Gv", f = brighter)
#' })
#' leaks <- mechanism("leaks", boundary = "Te", sentence = "Air enters.", edit = function(zone) {
#'   add_component(zone, zone_infiltration("leaks", free("ach", uniform(0, 1), "1/h"),
#'                                         outside = "Te"))
#' })
#' catalogue(sun, leaks)
#' @export
mechanism <- function(name, edit, boundary, sentence) {
  check_arguments()
  check_input(checkmate::check_string(name, min.chars = 1), "name")
  if (!inherits(edit, "amiss_ensemble")) {
    check_input(checkmate::check_function(edit, nargs = if (knows_record(edit)) 2 else 1), "edit")
  }
  check_columns_named(boundary)
  check_input(checkmate::check_string(sentence, min.chars = 1), "sentence")
  structure(list(name = name, edit = edit, boundary = boundary, sentence = sentence),
            class = "amiss_mechanism")
}

#' @rdname mechanism
#' @param ... Mechanisms.
#' @export
catalogue <- function(...) {
  check_arguments()
  mechanisms <- list(...)
  if (!all(vapply(mechanisms, inherits, TRUE, "amiss_mechanism"))) {
    other <- which(!vapply(mechanisms, inherits, TRUE, "amiss_mechanism"))[1]
    abort_input(c(paste("Every entry of a catalogue must be a mechanism; number {other} is",
                        "{seen(mechanisms[[other]])}."),
                  i = paste("Make each with {.fun mechanism}; of a list of them",
                            "{.code do.call(catalogue, list)} makes one.")))
  }
  for (one in mechanisms) check_whole(one, "...")
  names(mechanisms) <- vapply(mechanisms, `[[`, "", "name")
  if (anyDuplicated(names(mechanisms)))
    abort_input(paste("Mechanism {.val {names(mechanisms)[anyDuplicated(names(mechanisms))]}}",
                      "stands twice in the catalogue."))
  structure(mechanisms, class = "amiss_catalogue")
}

#' @export
`[.amiss_catalogue` <- function(x, i) {
  if (is.character(i) && !all(i %in% names(x))) {
    abort_input(c("There is no mechanism {.val {setdiff(i, names(x))}} in the catalogue.",
                  i = "Its mechanisms: {.val {names(x)}}."))
  }
  structure(unclass(x)[i], labels = attr(x, "labels"), class = "amiss_catalogue")
}

# A catalogue with further entries; those of a name that it has are the same.
with_entries <- function(catalogue, entries) {
  new <- entries[setdiff(names(entries), names(catalogue))]
  structure(c(unclass(catalogue), new), labels = attr(catalogue, "labels"),
            class = "amiss_catalogue")
}

#' @export
print.amiss_mechanism <- function(x, ...) on_stdout(x, {
  cli::cli_text("{.strong {x$name}}, driven by {.field {x$boundary}}: {x$sentence}")
  cli::cli_bullets(c(">" = "next: a {.fun catalogue} of mechanisms"))
})

#' @export
print.amiss_catalogue <- function(x, ...) on_stdout(x, {
  cli::cli_text("{.strong Catalogue} of {length(x)} mechanism{?s}")
  shown <- utils::head(x, 10)
  for (entry in shown) {
    driven <- driver_words(entry$name, told_condition(attr(x, "labels"), entry$boundary))
    cli::cli_bullets(c("*" = "{.strong {entry$name}}{driven}: {entry$sentence}"))
  }
  if (length(x) > length(shown))
    cli::cli_bullets(c("*" = "{length(x) - length(shown)} more: {names(x)[-seq_along(shown)]}"))
  cli::cli_bullets(c(">" = "next: {.fun upgrade_model}"))
})

# In brackets behind the name of a mechanism; not if there is none or the name says it.
driver_words <- function(name, boundary) {
  if (!length(boundary) || identical(boundary, name)) "" else sprintf(" (%s)", listed(boundary))
}

# Whether an edit asks for the name of the record beside the model.
knows_record <- function(edit)
  is.function(edit) && length(setdiff(names(formals(args(edit))), "...")) == 2

# The extended simulator. An edit may replace parameters of the base model, but not drop what was
# adopted.
extend <- function(simulator, mechanism, adopted = character(), record = NULL,
                   call = rlang::caller_env()) {
  edit <- mechanism$edit
  of_record <- if (knows_record(edit)) function(simulator) edit(simulator, record) else edit
  extended <- tryCatch(if (is.function(edit)) edited(simulator, of_record) else edit,
                       error = function(e) {
                         abort_input(c(paste("Mechanism {.val {mechanism$name}} cannot be applied",
                                             "to the model."), x = "{conditionMessage(e)}"),
                                     class = "amiss_error_edit", call = call)
                       })
  if (!inherits(extended, class(simulator)[1])) {
    abort_input(c(paste("Mechanism {.val {mechanism$name}} returned an object of class",
                        "{.cls {class(extended)}}, not a simulator."),
                  i = "The model that it extends is of class {.cls {class(simulator)}}."),
                call = call)
  }
  if (!is.null(simulator$held_out) && is.null(extended$held_out)) {
    abort_input(c(paste("The runs of mechanism {.val {mechanism$name}} are not known at the",
                        "validation rows, those of the model are."),
                  i = "Give {.fun ensemble} its runs there too."), call = call)
  }
  lost <- setdiff(adopted, names(free_parameters(extended)))
  if (length(lost)) {
    abort_input(c(paste("Mechanism {.val {mechanism$name}} drops {cli::qty(lost)}the",
                        "parameter{?s} {.val {lost}} of a mechanism that was adopted before."),
                  i = paste("Let its {.code edit} extend the model that it is given, instead of",
                            "making it anew.")), call = call)
  }
  extended
}

# Two mechanisms of a catalogue as one, under a name that no other has. `of`: their names.
paired_mechanism <- function(names, catalogue) {
  a <- catalogue[[names[1]]]
  b <- catalogue[[names[2]]]
  both <- function(simulator, record) {
    first <- extend(simulator, a, record = record)
    brought <- setdiff(names(free_parameters(first)), names(free_parameters(simulator)))
    extend(first, b, brought, record)
  }
  name <- paste(a$name, "+", b$name)
  while (!is.null(catalogue[[name]]) && !identical(catalogue[[name]]$of, names))
    name <- paste(name, "together")
  pair <- mechanism(name, both, union(a$boundary, b$boundary), paste(a$sentence, b$sentence))
  pair$of <- c(a$name, b$name)
  pair
}

# The mechanisms that an entry of a catalogue stands for.
single_names <- function(entry) entry$of %||% entry$name

is_single <- function(entry) is.null(entry$of)

# Given runs cannot be extended: those that lack what was adopted can no longer be tried.
applies <- function(mechanism, adopted) {
  is.function(mechanism$edit) || all(adopted %in% names(free_parameters(mechanism$edit)))
}

# A mechanism whose driver is not analysed can be adopted, but no condition can speak for it.
warn_absent_drivers <- function(catalogue, measurements) {
  for (entry in catalogue) {
    absent <- setdiff(entry$boundary, measurements$conditions)
    if (!length(absent)) next
    warn_input(c(paste("Mechanism {.val {entry$name}} is driven by {.val {absent}}, which",
                       "{?is/are} not among the boundary conditions analysed",
                       "({.val {measurements$conditions}})."),
                 i = paste("{cli::qty(absent)}Name {?it/them} in {.arg boundary} of",
                           "{.fun measurements}, so that the discrepancy can respond to",
                           "{?it/them}.")))
  }
}
