# The record of a river, a rainfall-runoff model of it in awk, and what the model may lack. The record is that of the
# catchment L0123002 in the package airGR (install.packages("airGR")); the target is the logarithm of the flow.
library(amiss)

folder <- system.file("examples", "catchment", package = "amiss")
script <- function(name) file.path(folder, name)

least <- 0.01  # mm/d, so that a dry river has a logarithm
basin <- new.env()
utils::data("L0123002", package = "airGR", envir = basin)
measured <- basin$BasinObs
daily <- data.frame(day = as.Date(measured$DatesR), flow = log(pmax(measured$Qmm, least)), rain = measured$P,
                    temperature = measured$T, evaporation = measured$E)
daily <- daily[daily$day >= "2000-01-01" & daily$day < "2006-01-01", ]
river <- measurements(daily, time = "day", target = "flow", unit = "ln(mm/d)", name = basin$BasinInfo$BasinName,
                      boundary = ~ rain + temperature + evaporation,
                      noise_sd = 0.1,  # a rating curve knows a river to about ten per cent
                      warmup = 24 * 366, calibrate = "day < as.Date(\"2004-01-01\")",
                      validate = "day >= as.Date(\"2004-01-01\")")

runoff <- program_simulator(
  c("awk", "-f", "reading.awk", "-f", "ground.awk", "-f", "gr4j.awk", "drivers.csv"),
  free("production", lognormal(5.9, 0.8), "mm", "production store"),
  free("exchange", normal(0, 1.5), "mm/d", "exchange with the ground"),
  free("routing", lognormal(4.5, 0.7), "mm", "routing store"),
  free("lag", uniform(0.6, 5), "d", "time base of the unit hydrograph"),
  templates = c(reading.awk = script("reading.awk"), ground.awk = script("ground.awk"), gr4j.awk = script("gr4j.awk")),
  output = function(directory) log(pmax(utils::read.csv(file.path(directory, "stdout.txt"))$flow, least)),
  boundary = c("rain", "evaporation"), cache = file.path(tempdir(), "catchment"), name = "GR4J by awk")

# Snow is another script in the place of ground.awk; the other mechanisms are rules more in reading.awk.
rule <- function(text) list(reading.awk = function(lines) c(lines, text))
ideas <- catalogue(
  mechanism("snow", boundary = c("rain", "temperature"), sentence = "Precipitation waits as snow and melts.",
            edit = function(model) {
    with_template(model, c(ground.awk = script("snow.awk")),
                  free("melt", uniform(0.5, 10), "mm/(K d)", "melt"),
                  free("covered", lognormal(5.5, 0.7), "mm", "snow that leaves no ground bare"),
                  boundary = "temperature")
  }),
  mechanism("undercatch", boundary = "rain", sentence = "Gauges catch less than falls, or more.",
            edit = function(model) {
    with_template(model, rule("{ rain *= {{catch}} }"),
                  free("catch", uniform(0.7, 1.6), "", "rain over what was caught"))
  }),
  mechanism("demand", boundary = "evaporation", sentence = "Plants need more water than the formula says, or less.",
            edit = function(model) {
    with_template(model, rule("{ evaporation *= {{demand}} }"),
                  free("demand", uniform(0.5, 1.6), "", "demand over the formula's"))
  }))
