# The sources are listed twice, in src/Makevars for R and in CMakeLists.txt for C++: both must agree with the tree.

source_root <- function() {
  folder <- normalizePath(test_path("."))
  repeat {
    if (all(file.exists(file.path(folder, c("DESCRIPTION", "CMakeLists.txt", "src/Makevars"))))) return(folder)
    if (dirname(folder) == folder) skip("the source tree is not reachable")
    folder <- dirname(folder)
  }
}

sources_in_tree <- function(root) sort(list.files(file.path(root, "src"), "\\.cpp$", recursive = TRUE))

sources_in_makevars <- function(path) {
  text <- paste(sub("#.*", "", readLines(path)), collapse = "\n")
  objects <- sub(".*\\bOBJECTS *= *((\\\\\n|[^\n])*).*", "\\1", text)
  sort(sub("\\.o$", ".cpp", scan(text = gsub("\\\\\n", " ", objects), what = "", quiet = TRUE)))
}

sources_in_cmake <- function(path) {
  lines <- readLines(path)
  sort(sub("^ *src/", "", grep("^ *src/[A-Za-z_/]+\\.cpp$", lines, value = TRUE)))
}

test_that("Makevars and Makevars.win list every source of the tree", {
  root <- source_root()
  tree <- sources_in_tree(root)
  expect_gt(length(tree), 10)
  expect_identical(sources_in_makevars(file.path(root, "src", "Makevars")), tree)
  expect_identical(sources_in_makevars(file.path(root, "src", "Makevars.win")), tree)
})

test_that("CMakeLists.txt lists every source of the engine and the zone", {
  root <- source_root()
  tree <- sources_in_tree(root)
  expect_identical(sources_in_cmake(file.path(root, "CMakeLists.txt")), tree[grepl("/", tree)])
})
