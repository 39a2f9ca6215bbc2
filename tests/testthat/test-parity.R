# bench/parity/cases.R says what is compared, and how far it may differ on another machine.
skip_on_cran()  # second tier: tools/test --quick
test_that("every stage gives what it gave", {
  folder <- test_path("..", "..", "bench", "parity")
  if (!dir.exists(folder)) skip("bench/ is not part of the installed package")
  scope <- new.env(parent = globalenv())
  sys.source(file.path(folder, "cases.R"), scope)
  reference <- jsonlite::read_json(file.path(folder, "reference.json"), simplifyVector = TRUE)
  differences <- scope$parity_differences(scope$parity_rows(), reference)
  expect_identical(nrow(differences), 0L,
                   info = paste(utils::capture.output(print(differences)), collapse = "\n"))
})
