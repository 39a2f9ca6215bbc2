# A matrix as a list of its columns: one more takes no copy of the others, and models share those
# that they have in common. A search adds its runs one by one, and a long record has many rows.

new_columns <- function(x) {
  structure(lapply(seq_len(ncol(x)), function(k) x[, k]), rows = nrow(x), class = "amiss_columns")
}

bind_columns <- function(a, b) {
  structure(c(unclass(a), unclass(b)), rows = nrow(a), class = "amiss_columns")
}

#' @export
dim.amiss_columns <- function(x) c(attr(x, "rows"), length(unclass(x)))

# Rows and columns as of a matrix.
#' @export
`[.amiss_columns` <- function(x, i, j, drop = TRUE) {
  columns <- unclass(x)
  if (!missing(j)) columns <- columns[j]
  if (!missing(i)) columns <- lapply(columns, `[`, i)
  if (drop && length(columns) == 1) return(columns[[1]])
  rows <- if (missing(i)) nrow(x) else length(seq_len(nrow(x))[i])
  matrix(as.numeric(unlist(columns, use.names = FALSE)), rows)
}
