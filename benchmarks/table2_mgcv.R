# Table 2 of arXiv:2405.10984 fitted by mgcv, one choice changed at a time: Rscript benchmarks/table2_mgcv.R FOLDER docs/results/table2_mgcv.csv
# FOLDER has rows60.csv, rows10.csv and rows5.csv, which `python -m benchmarks.paper_claims --rows FOLDER` writes. About ten minutes.
suppressMessages(library(mgcv))
arguments <- commandArgs(TRUE)

read_rows <- function(seconds) {
  rows <- read.csv(file.path(arguments[1], sprintf("rows%d.csv", seconds)), stringsAsFactors = TRUE)
  rows$season <- factor(rows$season, levels = c("summer", "winter"), ordered = TRUE)
  rows
}

smooths <- function(target, elevation, k = 10) {
  as.formula(sprintf(paste(
    "%s ~ weather + s(time_s) + s(ambient_temperature_degc, k = %d) + s(speed_m_s) + s(%s) + s(time_s, by = season)",
    "+ s(ambient_temperature_degc, by = season) + s(ambient_temperature_degc, %s, k = 30) + s(trip, bs = 're')"
  ), target, k, elevation, elevation))
}

columns <- list(start = "elevation_difference_m", row = "row_elevation_m")
start <- "start"
row <- "row"
cases <- list(
  list("cumulative", 60, start, "bam", "scat", "fREML", 1, 10),
  list("cumulative", 60, start, "gam", "scat", "REML", 1, 10),
  list("cumulative", 60, start, "gam", "gaussian", "REML", 1, 10),
  list("cumulative", 60, start, "gam", "gaussian", "GCV.Cp", 1.4, 10),
  list("cumulative", 60, start, "bam", "scat", "fREML", 1, 5),
  list("cumulative", 60, start, "bam", "scat", "fREML", 1, 20),
  list("power", 10, row, "bam", "scat", "fREML", 1, 10),
  list("power", 10, row, "gam", "scat", "REML", 1, 10),
  list("power", 5, row, "bam", "scat", "fREML", 1, 10)
)

fit_case <- function(case) {
  names(case) <- c("target", "every_s", "climb_from", "engine", "family", "method", "gamma", "k")
  rows <- read_rows(case$every_s)
  family <- if (case$family == "scat") scat() else gaussian()
  fit <- get(case$engine)(smooths(paste0(case$target, "_nearest"), columns[[case$climb_from]], case$k), data = rows,
                          family = family, method = case$method, gamma = case$gamma,
                          control = gam.control(maxit = 1000))
  tables <- summary(fit, re.test = FALSE)
  p <- function(name) signif(tables$p.pv[[name]], 2)
  edf <- sapply(fit$smooth, function(term) sum(fit$edf[term$first.para:term$last.para]))
  names(edf) <- c("time", "ambient", "speed", "elevation", "time_winter", "ambient_winter", "surface", "trip")
  data.frame(case, rows = nrow(rows), converged = fit$converged, t(round(edf, 2)),
             intercept = round(tables$p.coeff[1]), se = round(tables$se[1]),
             p_dark = p("weatherdark"), p_sunset = p("weathersunset"), mgcv = as.character(packageVersion("mgcv")),
             row.names = NULL)
}

write.csv(do.call(rbind, lapply(cases, fit_case)), arguments[2], row.names = FALSE, quote = FALSE)
