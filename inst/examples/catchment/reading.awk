# A day of drivers.csv: rain [mm/d] and the evaporation that the air demands [mm/d]. Mechanisms append rules that
# change them.
BEGIN { FS = "," }
NR == 1 { for (i = 1; i <= NF; i++) column[$i] = i; next }
{ rain = $column["rain"]; evaporation = $column["evaporation"] }
