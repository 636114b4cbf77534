#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# submit.sh PLAN [OPTION...]: the cases of a plan as an array job, then the merge.
set -eu
plan=$1
shift
here=$(dirname "$(readlink -f "$0")")
cases=$(($(wc -l <"$plan") - 1))
export CASES_PER_TASK="${CASES_PER_TASK:-20}"
tasks=$(((cases + CASES_PER_TASK - 1) / CASES_PER_TASK))
array=$(sbatch --parsable --requeue --array="1-$tasks" --output="$plan.%a.log" --open-mode=append \
    "$@" "$here/cases.sh" "$plan" "$cases")
sbatch --parsable --dependency="afterok:$array" --output="$plan.merge.log" "$@" \
    --wrap "${COMAN_HIL:-coman-hil} test --merge $plan"
