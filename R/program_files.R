# The files of a program's run that people give: templates, and a folder of a model or single files
# that are copied.

# The files to copy: data frame of `name` (in the run's directory), `path` and `md5`. A folder gives
# all that is in it.
model_files <- function(files, call = rlang::caller_env()) {
  if (is.null(files)) return(file_table(character(), character()))
  check_input(checkmate::check_character(files, any.missing = FALSE, min.len = 1, min.chars = 1),
              "files", "Give a folder, or paths of files.", call = call)
  if (length(files) == 1 && is.null(names(files)) && dir.exists(files))
    return(folder_table(files, call))
  bad <- files[!is_regular_file(files)]
  if (length(bad)) {
    what <- if (dir.exists(bad[1])) "a folder among files" else if (
      file.exists(bad[1])) "no regular file" else "not there"
    abort_input(c("{.arg files} names {.file {bad[1]}}, which is {what}.",
                  i = "Give one folder, which is copied as a whole, or paths of files."),
                call = call)
  }
  names <- rlang::names2(files)
  names[!nzchar(names)] <- basename(files)[!nzchar(names)]
  check_inside(stats::setNames(names, rep("files", length(names))), call)
  twice <- names[duplicated(names)]
  if (length(twice)) {
    abort_input(c("{.arg files} has two files for {.file {twice[1]}}.",
                  i = "Give each a name of its own: {.code c(\"a/model.txt\" = path)}."),
                call = call)
  }
  file_table(names, files)
}

folder_table <- function(folder, call) {
  names <- dir(folder, recursive = TRUE, all.files = TRUE, no.. = TRUE)
  if (!length(names)) {
    abort_input(c("{.arg files} names the folder {.file {folder}}, which holds no files.",
                  i = "Give that of the model."),
                call = call)
  }
  paths <- file.path(folder, names)
  bad <- paths[!is_regular_file(paths)]
  if (length(bad)) {
    abort_input(c("{.arg files} cannot be copied: {.file {bad[1]}} is no regular file.",
                  i = "Remove pipes and broken links from the folder."), call = call)
  }
  # Folders without files are copied, too: a program may write into them.
  structure(file_table(names, paths), folders = list.dirs(folder, full.names = FALSE)[-1])
}

file_table <- function(names, paths) {
  data.frame(name = as.character(names), path = as.character(normalizePath(paths)),
             md5 = as.character(tools::md5sum(paths)))
}

# What was copied into earlier runs must be what is copied now.
check_files_same <- function(files, call = rlang::caller_env()) {
  now <- tools::md5sum(files$path)
  bad <- which(is.na(now) | now != files$md5)
  if (!length(bad)) return(invisible())
  what <- if (is.na(now[bad[1]])) "is not there any more"
          else "has changed since the simulator was made"
  abort_input(c("The file {.file {files$path[bad[1]]}} {what}.", i = "Make the simulator again."),
              call = call)
}

copy_files <- function(files, folder) {
  for (within in setdiff(c(unique(dirname(files$name)), attr(files, "folders")), ".")) {
    dir.create(file.path(folder, within), recursive = TRUE, showWarnings = FALSE)
  }
  done <- file.copy(files$path, file.path(folder, files$name), overwrite = TRUE, copy.mode = TRUE)
  if (!all(done)) stop("its file ", files$name[!done][1], " could not be copied: is the disk full?")
}

# Each template: its lines, or its bytes as long as nobody reads them. `present` are those that a
# function may change, `files` those of the model's folder, which may be named in their place.
read_templates <- function(templates, present = list(), files = model_files(NULL),
                           call = rlang::caller_env()) {
  templates <- named_templates(templates, files, call)
  sapply(names(templates), function(file) {
    x <- templates[[file]]
    if (is.function(x) && is.null(present[[file]])) present[[file]] <- folder_template(file, files)
    if (is.function(x) && !is.null(present[[file]]))
      return(edited_lines(x, present[[file]], file, call))
    if (inherits(x, "AsIs")) return(if (is.raw(x)) unclass(x) else enc2utf8(as.character(x)))
    if (checkmate::test_string(x) && is_regular_file(x)) return(template_of(file_bytes(x)))
    why <- if (is.function(x)) "there is none that its function could change"
           else paste(if (checkmate::test_string(x) && dir.exists(x)) "a folder is no file:"
                      else "there is no file", if (checkmate::test_string(x)) x else seen(x))
    abort_input(c("Template {.val {file}} cannot be read: {why}.",
                  i = "Give the path of a file, or text in {.fun I}."), call = call)
  }, simplify = FALSE)
}

# A list by names. What has no name names a file of the model's folder by its path there.
named_templates <- function(templates, files, call) {
  if (is.character(templates) && !inherits(templates, "AsIs")) templates <- as.list(templates)
  check_input(checkmate::check_list(templates, null.ok = TRUE), "templates",
              "Give a named list: file = path, or text in {.fun I}.", call = call)
  names <- rlang::names2(templates)
  for (k in which(!nzchar(names))) {
    name <- templates[[k]]
    if (!checkmate::test_string(name) || inherits(name, "AsIs")) {
      abort_input(c("Number {k} of {.arg templates}, {seen(name)}, cannot be used: it has no name.",
                    i = "Give a named list: file = path, or text in {.fun I}."), call = call)
    }
    check_inside(c(templates = name), call)
    if (!name %in% files$name) {
      abort_input(c(paste("{.arg templates} names {.file {name}}, which is none of the",
                          "{nrow(files)} file{?s} of {.arg files}."),
                    i = paste("Give a named list: file = path, or a file of {.arg files} by its",
                              "path in the folder.")), call = call)
    }
    names[k] <- name
    templates[[k]] <- files$path[match(name, files$name)]
  }
  twice <- names[duplicated(names)]
  if (length(twice))
    abort_input("{.arg templates} has the file {.file {twice[1]}} twice.", call = call)
  stats::setNames(as.list(templates), names)
}

folder_template <- function(name, files) {
  path <- files$path[match(name, files$name)]
  if (!is.na(path)) file_bytes(path)
}

# Lines, if there is something to fill in.
template_of <- function(bytes) {
  filled <- length(grepRaw("{{", bytes, fixed = TRUE)) && !any(bytes == as.raw(0))
  if (filled) lines_of(bytes) else bytes
}

edited_lines <- function(edit, template, file, call) {
  if (is.raw(template) && any(template == as.raw(0))) {
    abort_input(c("Template {.val {file}} is binary: it has no lines that a function could change.",
                  i = "Give the path of another file in its place."), call = call)
  }
  lines <- edit(if (is.raw(template)) lines_of(template) else template)
  check_input(checkmate::check_character(lines, any.missing = FALSE), paste0("templates$", file),
              "Let its function return the lines.", call = call)
  lines
}

# Each file of the run has a name of its own, and a folder is none of them. `reserved`: names of
# drivers and outputs.
check_template_names <- function(names, reserved, call = rlang::caller_env()) {
  if (!length(names)) return(invisible())
  check_inside(stats::setNames(names, rep("templates", length(names))), call)
  parts <- fs::path_norm(c(names, reserved))
  folders <- unlist(lapply(parts, function(part)
    setdiff(fs::path_dir(Reduce(fs::path, fs::path_split(part)[[1]], accumulate = TRUE)), ".")))
  taken <- c(names, reserved)[match(unique(c(parts[duplicated(parts)], intersect(parts, folders))),
                                    parts)]
  if (length(taken)) {
    abort_input(c(paste("The name {.file {taken[1]}} is that of two files, or of a file and a",
                        "folder, of the run."), i = "The run itself writes {.file {reserved}}."),
                call = call)
  }
}
