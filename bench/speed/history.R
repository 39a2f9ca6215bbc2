# The history model: its likelihood does not depend on the length of the record.

# Ten microseconds are distinguished by the least of five runs.
r <- micro("micro_history")
again <- replicate(5, {
  once <- micro("micro_history", "likelihood")
  vapply(c(384, 5760, 525600), function(n) once[[paste0("history/likelihood/", n)]]$seconds, 0)
})
likelihood <- apply(again, 1, min)
for (i in 1:3)
  scaled(sprintf("history likelihood with gradient, p = 49, N = %d", c(384L, 5760L, 525600L)[i]),
         likelihood[i], "us", 100)
measured("greatest over least of these three", max(likelihood) / min(likelihood), "", 1.2)
scaled("history set-up of one error setting, N = 525600", r[["history/setup/525600"]]$seconds, "s",
       10)
