# What cli says in an expression, on standard output: there capture.output() and R Markdown find it.
on_stdout <- function(x, said) {
  check_whole(x, "x", call = NULL)
  cat(cli::cli_fmt(said), sep = "\n")
  invisible(x)
}

# Text from data for a message of cli, which would evaluate what stands in braces.
as_said <- function(x) gsub("([{}])", "\\1\\1", x)

# Each as a bullet of its own.
say_bullets <- function(x, bullet = "*") {
  if (length(x)) cli::cli_bullets(stats::setNames(as_said(x), rep(bullet, length(x))))
}

# A data frame as a part of what cli says.
say_table <- function(table) {
  cli::cli_verbatim(utils::capture.output(print(table, digits = 3, row.names = FALSE)))
}

# The parts of a summary, a paragraph each.
say_parts <- function(parts) {
  for (part in names(parts))
    cli::cli_bullets(c(" " = "{.strong {part}}: {paste(parts[[part]], collapse = ' ')}"))
}
