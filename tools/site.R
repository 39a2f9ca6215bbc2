# The web site of the package in build/site. Usage: Rscript tools/site.R whole|quick
quick <- identical(commandArgs(trailingOnly = TRUE), "quick")
options(pkgdown.internet = FALSE)
# Links to packages that are named but not installed would be sought in CRAN's list.
if (exists("CRAN_urls", asNamespace("downlit"))) {
  utils::assignInNamespace(
    "CRAN_urls", function() data.frame(Package = character(), URL = character()), "downlit")
}
place <- list(destination = "build/site")
if (quick) {
  site <- pkgdown::as_pkgdown(override = place)
  pkgdown::init_site(site)
  pkgdown::build_home(site, preview = FALSE)
  pkgdown::build_reference(site, examples = FALSE, devel = FALSE, preview = FALSE)
  pkgdown::build_articles_index(site)
  pkgdown::build_news(site, preview = FALSE)
} else {
  pkgdown::build_site(devel = FALSE, preview = FALSE, install = FALSE, new_process = FALSE,
                      override = place)
}
