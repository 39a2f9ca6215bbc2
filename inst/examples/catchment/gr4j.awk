# GR4J (Perrin, Michel and Andreassian 2003, J. Hydrol. 279, 275-289): from the water that reaches the ground and the
# evaporation demanded [mm/d] to the flow of the river [mm/d], day by day. The stores begin 30 % and 50 % full.
# production, routing: capacities of both stores [mm]; exchange: gain of the routing store from the ground [mm/d];
# lag: time base of the first unit hydrograph [d], that of the second is twice as long.
function rising(day) { return day < lag ? (day / lag) ^ 2.5 : 1 }
function swell(day) {
  if (day <= lag) return (day / lag) ^ 2.5 / 2
  return day < 2 * lag ? 1 - (2 - day / lag) ^ 2.5 / 2 : 1
}
function tanh(x) {
  if (x > 13) x = 13
  x = exp(2 * x)
  return (x - 1) / (x + 1)
}
BEGIN {
  production = {{production}}; exchange = {{exchange}}; routing = {{routing}}; lag = {{lag}}
  soil = 0.3 * production; store = 0.5 * routing
  while (last < 2 * lag) {
    last++
    slow[last] = rising(last) - rising(last - 1)
    fast[last] = swell(last) - swell(last - 1)
  }
  print "time,flow"
}
NR > 1 {
  full = soil / production; excess = 0
  if (water <= evaporation) {
    t = tanh((evaporation - water) / production)
    soil -= soil * (2 - full) * t / (1 + (1 - full) * t)
  } else {
    t = tanh((water - evaporation) / production)
    kept = production * (1 - full ^ 2) * t / (1 + full * t)
    excess = water - evaporation - kept
    soil += kept
  }
  percolation = soil * (1 - (1 + (4 / 9 * soil / production) ^ 4) ^ -0.25)
  soil -= percolation
  excess += percolation

  for (i = 1; i <= last; i++) {
    slow_flow[i] = slow_flow[i + 1] + 0.9 * excess * slow[i]
    fast_flow[i] = fast_flow[i + 1] + 0.1 * excess * fast[i]
  }
  gain = exchange * (store / routing) ^ 3.5
  store += slow_flow[1] + gain
  if (store < 0) store = 0
  outflow = store * (1 - (1 + (store / routing) ^ 4) ^ -0.25)
  store -= outflow
  direct = fast_flow[1] + gain
  printf "%s,%.10g\n", $1, outflow + (direct > 0 ? direct : 0)
}
