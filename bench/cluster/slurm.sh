# Slurm on this machine, with two nodes of one CPU each: sourced by bench/slurm and bench/estate after tools/lib.sh.
# Needs root on Debian. Everything that it starts ends with the script.
[[ $(id -u) -eq 0 ]] || fail "must be run as root: it starts Slurm's daemons"
grep -qx 'ID=debian' /etc/os-release 2> /dev/null || fail "must be run on Debian: it installs Slurm with apt-get"
export R_LIBS="$(realpath -m "${AMISS_LIBRARY:-$library}")"
export OPENBLAS_NUM_THREADS=1 USER=root  # batchtools asks for the jobs of $USER

install_slurm() {  # further packages
  say "Installing Slurm from Debian, where it is missing"
  local package absent=()
  for package in slurm-wlm munge r-cran-jsonlite "$@"; do
    [[ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2> /dev/null)" == installed ]] || absent+=("$package")
  done
  if [[ ${#absent[@]} -gt 0 ]]; then
    apt-get update -qq || fail "apt-get update failed: is the network there?"
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${absent[@]}" > /dev/null ||
      fail "apt-get could not install: ${absent[*]}"
  fi
  Rscript -e "loadNamespace('amiss')" > /dev/null || fail "R cannot load amiss (R_LIBS=$R_LIBS); has tools/test been run?"
}

# Everything started below carries this folder's name in its environment; that is how it is found at the end.
temporary="$(mktemp -d /tmp/amiss-slurm.XXXXXX)"
chmod 755 "$temporary"
export SLURM_CONF="$temporary/slurm.conf"
ours() { grep -lzsFx "SLURM_CONF=$SLURM_CONF" /proc/[0-9]*/environ | cut -d / -f 3 || true; }
stop_all() {
  local attempt
  for attempt in {1..50}; do
    kill -9 $(ours) 2> /dev/null || break
    sleep 0.1
  done
  rm -rf "$temporary"
}
trap stop_all EXIT
trap 'fail "line $LINENO failed: $BASH_COMMAND"' ERR
trap 'exit 1' INT TERM

wait_for() {  # seconds, command
  local end=$((SECONDS + $1))
  until "${@:2}"; do [[ $SECONDS -lt $end ]] || return 1; sleep 0.2; done
}
start() {  # name, command
  "${@:2}" >> "$temporary/$1.log" 2>&1 &
  disown
}
start_node() { start "$1" slurmd -D -N "$1"; node_pid=$!; }
idle() { [[ "$(sinfo -h -p worlds -t idle -o %D 2> /dev/null)" == 2 ]]; }
empty() { local waiting; waiting="$(squeue -h 2> /dev/null)" && [[ -z $waiting ]]; }

start_slurm() {
  say "Starting munged, slurmctld and two nodes"
  mkdir "$temporary"/state
  local host
  host="$(hostname -s)"
  cat > "$SLURM_CONF" << END
ClusterName=amiss
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=16817
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$temporary/munge.socket
StateSaveLocation=$temporary/state
SlurmdSpoolDir=$temporary/spool-%n
SlurmctldPidFile=$temporary/slurmctld.pid
SlurmdPidFile=$temporary/slurmd-%n.pid
SlurmdTimeout=10
ReturnToService=2
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
NodeName=worker1 NodeHostname=$host NodeAddr=127.0.0.1 Port=16821 CPUs=1
NodeName=worker2 NodeHostname=$host NodeAddr=127.0.0.1 Port=16822 CPUs=1
PartitionName=worlds Nodes=worker[1-2] Default=YES
PartitionName=empty Nodes=worker[1-2] OverSubscribe=FORCE:100
END
  head -c 128 /dev/urandom > "$temporary/munge.key"
  chmod 600 "$temporary/munge.key"
  start munged munged -F --key-file="$temporary/munge.key" --socket="$temporary/munge.socket" \
    --pid-file="$temporary/munged.pid" --seed-file="$temporary/munged.seed" --log-file="$temporary/munged.log"
  wait_for 20 test -S "$temporary/munge.socket" || fail "munged does not start: $(tail -n 5 "$temporary/munged.log")"
  start slurmctld slurmctld -D
  start_node worker1
  start_node worker2
  wait_for 60 idle || fail "Slurm's nodes do not come up: $(tail -n 5 "$temporary"/{slurmctld,worker1,worker2}.log)"
  sinfo -N -p worlds
}
