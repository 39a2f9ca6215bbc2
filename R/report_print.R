# The page as a PDF, printed by a browser of the Chromium family without a window.

browser_names <- c("chromium", "chromium-browser", "chrome-headless-shell",
                   "chromium-headless-shell", "google-chrome", "google-chrome-stable", "chrome",
                   "microsoft-edge", "microsoft-edge-stable", "msedge")

browser_places <- c(
  "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
  "/Applications/Chromium.app/Contents/MacOS/Chromium",
  "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
  "C:/Program Files/Google/Chrome/Application/chrome.exe",
  "C:/Program Files (x86)/Microsoft/Edge/Application/msedge.exe")

# Named by CHROMOTE_CHROME, as for the package chromote, or found.
find_browser <- function(call = rlang::caller_env()) {
  named <- Sys.getenv("CHROMOTE_CHROME")
  found <- if (nzchar(named)) named else c(Sys.which(browser_names), browser_places)
  found <- unname(found[nzchar(found) & file.exists(found)])
  if (!length(found)) {
    abort_input(
      c("A report in PDF is printed by Chromium, Chrome or Edge, and none was found.",
        x = if (nzchar(named)) "CHROMOTE_CHROME names {.file {named}}, which does not exist.",
        i = paste("Install one (Debian: {.code apt-get install chromium}; others:",
                  "{.url https://www.google.com/chrome/})."),
        i = "Or write {.code .html} and print it from a browser, or {.code .docx}."), call = call)
  }
  found[1]
}

# Starts the browser on a page of this machine. Its sandbox needs rights that root and containers
# lack; the page is the package's own and loads nothing.
browse <- function(browser, page, arguments, timeout = 120) {
  profile <- tempfile("amiss-browser-")
  on.exit(unlink(profile, recursive = TRUE))
  address <- paste0("file://", utils::URLencode(normalizePath(page, "/")))
  arguments <- c("--headless", "--disable-gpu", "--no-sandbox", "--no-first-run",
                 "--hide-scrollbars", paste0("--user-data-dir=", profile), arguments, address)
  processx::run(browser, arguments, error_on_status = FALSE, timeout = timeout)
}

print_page <- function(page, file, browser, call = rlang::caller_env()) {
  ran <- browse(browser, page, c("--no-pdf-header-footer", paste0("--print-to-pdf=", file)))
  if (!file.exists(file)) {
    said <- utils::tail(strsplit(ran$stderr, "\n")[[1]], 3)
    abort_input(c(paste("{.file {browser}} did not print the",
                        "report{if (isTRUE(ran$timeout)) ' within two minutes' else ''}."),
                  x = if (length(said)) "It said: {said}",
                  i = "Write {.code .html} and print it from a browser, or {.code .docx}."),
                call = call)
  }
  file
}
