# What drives the circuit, as ngspice reads it: the columns of drivers.csv are nodes of their names, each value is held
# until the end of its interval, and its first value is the parameter NAME_first. Then the run, in steps of at most ten
# minutes.
set -e
awk -F, '
  NR == 1 { for (i = 3; i <= NF; i++) { nodes = nodes " " $i; name[i] = $i; zeros = zeros " 0"; ones = ones " 1" }; next }
  NR == 2 { step = 3600 * $2; for (i = 3; i <= NF; i++) print ".param " name[i] "_first=" $i }
  { line = ""; for (i = 3; i <= NF; i++) line = line " " $i
    print 3600 * $2 - step line > "drivers.txt" }
  END {
    print step * (NR - 1) line > "drivers.txt"
    print "adrivers %v([" nodes " ]) record"
    print ".model record filesource (file=\"drivers.txt\" amplstep=true amploffset=[" zeros " ] amplscale=[" ones " ])"
    print ".tran " step, step * (NR - 1), 0, 600
  }' drivers.csv > drivers.inc
ngspice -b room.cir > ngspice.log
