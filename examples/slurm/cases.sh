#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# cases.sh PLAN CASES: those of the task; CASES_PER_TASK comes with the job's environment.
set -u
failed=0
k=$(((SLURM_ARRAY_TASK_ID - 1) * CASES_PER_TASK + 1))
last=$((k + CASES_PER_TASK - 1))
[ "$last" -le "$2" ] || last=$2
while [ "$k" -le "$last" ]; do
    "${COMAN_HIL:-coman-hil}" test --case "$k" "$1" || failed=1
    k=$((k + 1))
done
exit "$failed"
