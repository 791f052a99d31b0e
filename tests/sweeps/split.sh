#!/bin/sh
# A sweep of more than 1,000 points: whole; interrupted, killed and taken up again; split by GNU parallel; and split over two
# nodes of a Slurm of its own on the loopback interface. The tables must have the same bytes. Then a fault campaign by GNU parallel
# and on Slurm; and the Job of Kubernetes against its schema (read.py).
#
#   split.sh ROLLWALK-BENCH SWEEP.toml DIR        as root, with GNU parallel, Slurm, MUNGE, and read.py's modules in PYTHONPATH
set -eu
bench=$1 sweep=$2 out=$3

same() {
    for file in results.csv results.svg; do
        cmp "$out/whole/$file" "$out/$1/$file"
    done
    echo "$1: the same bytes"
}

campaign() {
    "$bench" fault-campaign --seeds 30 --loss 3 --out "$@"
}

same_campaign() {
    cmp "$out/campaign/fault-campaign.json" "$out/$1/fault-campaign.json"
    cmp "$out/campaign/fault-campaign.md" "$out/$1/fault-campaign.md"
    echo "$1: the same bytes"
}

rm -rf "$out"
mkdir -p "$out/state" "$out/munge"
start=$(date +%s.%N)
"$bench" explore "$sweep" -o "$out/whole"
points=$(($(wc -l < "$out/whole/results.csv") - 1))
echo "$start $(date +%s.%N) $points $(nproc)" |
    awk '{ printf "%d points, %.1f a second and core, on %d cores\n", $3, $3 / ($2 - $1) / $4, $4 }'
[ "$points" -ge 1000 ]

timeout -s INT 8 "$bench" explore "$sweep" -o "$out/broken" && exit 1
timeout -s KILL 8 "$bench" explore "$sweep" -o "$out/broken" && exit 1
[ ! -e "$out/broken/results.csv" ]
"$bench" explore "$sweep" -o "$out/broken"
same broken

"$bench" explore "$sweep" -o "$out/parallel" --engine parallel --shards 4
same parallel
campaign "$out/campaign"
campaign "$out/campaign-parallel" --engine parallel --shards 4
same_campaign campaign-parallel

"$bench" explore "$sweep" -o "$out/whole" --engine kubernetes --shards 4 --dry-run
python3 "$(dirname "$0")/read.py" "$out/whole/kubernetes.yaml"

# MUNGE and Slurm with files of their own: nothing of the machine's configuration is touched.
host=$(hostname)
stop() {
    for pid in "$out"/*.pid; do [ -e "$pid" ] && kill "$(cat "$pid")" || true; done
}
trap stop EXIT
chmod 700 "$out/munge"
dd if=/dev/urandom of="$out/munge/key" bs=1 count=1024 2> "$out/dd.log"
chmod 400 "$out/munge/key"
munged --force --key-file="$out/munge/key" --socket="$out/munge/socket" --pid-file="$out/munged.pid" \
    --log-file="$out/munge/log" --seed-file="$out/munge/seed"
cat > "$out/slurm.conf" << CONF
ClusterName=loopback
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=16817
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$out/munge/socket
StateSaveLocation=$out/state
SlurmdSpoolDir=$out/spool.%n
SlurmctldPidFile=$out/slurmctld.pid
SlurmdPidFile=$out/slurmd.%n.pid
SlurmctldLogFile=$out/slurmctld.log
SlurmdLogFile=$out/slurmd.%n.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
ReturnToService=2
NodeName=node1 NodeHostname=$host NodeAddr=127.0.0.1 Port=17001 CPUs=1
NodeName=node2 NodeHostname=$host NodeAddr=127.0.0.1 Port=17002 CPUs=1
PartitionName=all Nodes=node1,node2 Default=YES State=UP
CONF
export SLURM_CONF="$out/slurm.conf"
slurmctld -c
slurmd -N node1
slurmd -N node2
"$bench" explore "$sweep" -o "$out/slurm" --engine slurm --shards 4
same slurm
campaign "$out/campaign-slurm" --engine slurm --shards 4
same_campaign campaign-slurm
