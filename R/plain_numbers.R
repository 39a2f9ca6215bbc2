# Numbers that R keeps in another way than its own (class integer64 of package bit64: the bits of
# 64-bit integers) as its own numbers. Larger ones than 2^53 are rounded.

# A vector, a matrix or a data frame; what else there is stays as it is.
plain_numbers <- function(x) {
  if (is.data.frame(x)) {
    for (column in which(vapply(x, inherits, NA, "integer64")))
      x[[column]] <- plain_numbers(x[[column]])
    return(x)
  }
  if (!inherits(x, "integer64")) return(x)
  halves <- matrix(readBin(writeBin(as.vector(unclass(x)), raw(), endian = "little"), "integer",
                           2 * length(x), 4, endian = "little"), 2)
  halves[is.na(halves)] <- -2^31  # these bits are R's NA
  numbers <- halves[2, ] * 2^32 + halves[1, ] %% 2^32
  numbers[numbers == -2^63] <- NA
  array_like(numbers, x)
}

array_like <- function(numbers, x) {
  if (is.null(dim(x))) stats::setNames(numbers, names(x)) else array(numbers, dim(x), dimnames(x))
}

# A data frame as a matrix.
as_number_matrix <- function(x) {
  x <- plain_numbers(x)
  if (is.data.frame(x)) as.matrix(x) else x
}
