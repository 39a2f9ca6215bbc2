#!/usr/bin/env Rscript
# Seconds that one R session spends on a job, to start it and to collect it, and to ask once whether
# it has ended: Rscript bench/cluster/session.R PLAN.R. The jobs are empty and held back until all
# are submitted, so that they do not take the session's processor.

source(commandArgs(trailingOnly = TRUE))
submit <- system.time(jobs <- lapply(1:20, function(i) future::future(NULL)))[["elapsed"]]
ask <- system.time(future::resolved(jobs))[["elapsed"]]
invisible(system("scontrol update PartitionName=empty State=UP"))
while (length(system("squeue -h", intern = TRUE))) Sys.sleep(0.2)
collect <- system.time(future::value(jobs))[["elapsed"]]
cat((submit + collect) / length(jobs), ask / length(jobs), "\n")
