library(testthat)
library(amiss)

test_check("amiss")
