#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# cases.sh PLAN CASES: those of the task; CASES_PER_TASK comes with the job's environment.
set -u
first=$(((SLURM_ARRAY_TASK_ID - 1) * CASES_PER_TASK + 1))
last=$((first + CASES_PER_TASK - 1))
[ "$last" -le "$2" ] || last=$2
exec "${COMAN_HIL:-coman-hil}" test --case "$first-$last" --jobs "${SLURM_CPUS_PER_TASK:-1}" "$1"
