#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# run.sh PLAN [OPTION...]: runs the cases of a plan by GNU parallel; started again it goes on.
set -eu
plan=$1
shift
cases=$(($(wc -l <"$plan") - 1))
seq "$cases" | parallel --will-cite --joblog "$plan.joblog" --resume-failed --retries 3 "$@" \
    "${COMAN_HIL:-coman-hil}" test --case {} "$plan"
