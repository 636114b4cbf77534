#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# A sweep run by GNU parallel with a program that fails at first, and by a Slurm of two nodes here:
# what they merge is byte for byte what one after another gives. Prints TAP.
set -u
work=$(mktemp -d)
daemons=()
finish()
{
    [ ${#daemons[@]} -eq 0 ] || kill -9 "${daemons[@]}" 2>/dev/null
    wait 2>/dev/null
    rm -rf "$work"
}
trap finish EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/out $work/ctl.log $work/n1.log $work/slurm/*.log"
examples=$HIL_SOURCE_DIR/examples
export COMAN_HIL=$HIL_BINARY_DIR/coman-hil

# sweep FOLDER: a short one of twelve cases
sweep()
{
    mkdir -p "$work/$1" && cp "$examples"/sweep/*.yaml "$work/$1" && cd "$work/$1" || exit 1
    sed -i 's/^samples: .*/samples: 12/' sweep.yaml
    sed -i 's/^duration_s: .*/duration_s: 0.05/; s/\[-0.4, 0.4\]/[-0.4, 0.4], within_s: 0.04/' \
        squat.yaml
    "$COMAN_HIL" test --plan sweep.yaml --output a.plan >"$work/out" 2>&1
}

same()
{
    for end in xml csv html; do
        cmp -s "$work/serial/a.plan.$end" "a.plan.$end" || return 1
    done
}

sweep serial
for k in $(seq 12); do "$COMAN_HIL" test --case "$k" a.plan >>"$work/out" 2>&1 || break; done
"$COMAN_HIL" test --merge a.plan >>"$work/out" 2>&1
result $? "twelve cases one after another"

name="GNU parallel tries again what has failed, and its results merge into the same bytes"
if command -v parallel >/dev/null; then
    sweep parallel
    cat >flaky <<'END'
#!/bin/sh
# the first time of every other case it has no result
[ $(($3 % 2)) -eq 0 ] || [ -e "tried.$3" ] || { touch "tried.$3"; exit 7; }
exec "$HIL_BINARY_DIR/coman-hil" "$@"
END
    chmod +x flaky
    COMAN_HIL=./flaky timeout -k 5 60 "$examples/parallel/run.sh" a.plan --jobs 2 \
        >"$work/out" 2>&1 </dev/null && "$COMAN_HIL" test --merge a.plan >>"$work/out" 2>&1 &&
        [ -e tried.11 ] && same
    result $? "$name"
else
    skip "$name" "GNU parallel is not installed: ./dev setup --cluster"
fi

name="Slurm runs them on two nodes, one of which dies, and merges the same bytes"
if ! command -v slurmctld >/dev/null || ! command -v slurmd >/dev/null; then
    skip "$name" "Slurm is not installed: ./dev setup --cluster"
elif [ "$(id -u)" -ne 0 ]; then
    skip "$name" "slurmd wants to be root"
else
    sweep slurm
    port=$((20000 + $$ % 20000))
    mkdir -p "$work/state" "$work/n1" "$work/n2"
    cat >"$work/slurm.conf" <<END
ClusterName=test
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmctldPort=$port
SlurmUser=root
AuthType=auth/none
CredType=cred/none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
MpiDefault=none
ReturnToService=2
SlurmdTimeout=10
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/%n
SlurmctldPidFile=$work/ctl.pid
SlurmdPidFile=$work/%n.pid
SlurmctldLogFile=$work/ctl.log
SlurmdLogFile=$work/%n.log
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SchedulerParameters=batch_sched_delay=0,sched_interval=1
NodeName=n1 NodeHostname=$(hostname -s) NodeAddr=127.0.0.1 Port=$((port + 1)) CPUs=1
NodeName=n2 NodeHostname=$(hostname -s) NodeAddr=127.0.0.1 Port=$((port + 2)) CPUs=1
PartitionName=all Nodes=n1,n2 Default=YES MaxTime=10 State=UP
END
    export SLURM_CONF=$work/slurm.conf
    slurmctld -D >/dev/null 2>&1 &
    daemons+=($!)
    for node in n1 n2; do
        slurmd -D -N $node >/dev/null 2>&1 &
        daemons+=($!)
    done
    for _ in $(seq 100); do sinfo -h -o %t 2>/dev/null | grep -q idle && break; sleep 0.2; done
    CASES_PER_TASK=3 "$examples/slurm/submit.sh" a.plan >"$work/out" 2>&1
    kill -9 "${daemons[2]}" # n2
    scontrol update NodeName=n2 State=DOWN Reason=killed >>"$work/out" 2>&1
    for _ in $(seq 200); do [ -e a.plan.html ] && break; sleep 0.2; done
    squeue >>"$work/out" 2>&1
    same
    result $? "$name"
fi
echo "1..$number"
exit $failed
