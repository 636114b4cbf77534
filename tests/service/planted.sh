#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: planted.sh COMAN-HIL
# What somebody has planted where a user writes: no command follows a symbolic link in the place of
# a file, or changes a file by another name of it, and with no mask nothing that is written can be
# written by others. Prints TAP.
set -u
program=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/said"
cd "$work" || exit 1
umask 0

# plant FILE...: links to a file that is not the user's to lose, each by its own way there
plant()
{
    local file
    echo precious >victim
    for file in "$@"; do
        (umask 022 && mkdir -p "$(dirname "$file")")
        ln -sf "$work/victim" "$file"
    done
}
# kept NAME FOLDER: the victim is as it was, nothing is left half, nothing is writable by others
kept()
{
    [ "$(cat victim)" = precious ] && [ -z "$(find "$2" -name '*.part')" ] &&
        [ -z "$(find "$2" -mindepth 1 ! -type l -perm -o+w)" ]
    result $? "$1" "$(find "$2" -mindepth 1 ! -type l -perm -o+w | tr '\n' ' ')"
}
# says STATUS ARGUMENT...
says()
{
    local expected=$1
    shift
    timeout -k 5 60 "$program" "$@" >said 2>&1 </dev/null
    local status=$?
    [ $status -eq "$expected" ] || { echo "status $status of $*" >>said && false; }
}
quick=(--clock free --duration 0.05 --control none --quiet)

echo 1..10

# ---- files that are written at once ----
plant dbc/torso.dbc dbc/coman-torso.dbc eds/leg.eds
says 0 dbc coman --bus torso -o dbc/torso.dbc && says 0 dbc coman -o dbc &&
    [ ! -L dbc/torso.dbc ] && [ ! -L dbc/coman-torso.dbc ] && [ -s dbc/coman-left_leg.dbc ]
result $? "DBC files take the place of links"
kept "and leave what these point to" dbc

mkdir out
says 0 run coman "${quick[@]}" --record first --record-format both &&
    plant out/plot.svg out/plot.png out/plan out/junit.xml out/coman_dynamics.c out/ready &&
    says 0 plot first --signal q_LKneeSag_rad -o out/plot.svg &&
    says 0 plot first --signal q_LKneeSag_rad -o out/plot.png &&
    says 0 generate coman -o out && [ ! -L out/coman_dynamics.c ] &&
    cp "$HIL_SOURCE_DIR"/examples/sweep/*.yaml . &&
    sed -i 's/^samples: .*/samples: 1/' sweep.yaml &&
    sed -i 's/^duration_s: .*/duration_s: 0.05/' squat.yaml &&
    says 0 test --plan sweep.yaml -o out/plan && says 2 run coman "${quick[@]}" --ready out/ready &&
    grep -q 'found the symbolic link out/ready' said && [ -L out/ready ]
result $? "plots, generated code and plans too; --ready leaves a link alone"
kept "and leave what the links point to" out
[ -z "$(find first -mindepth 1 -perm -o+w)" ] && [ "$(stat -c %a first)" = 775 ]
result $? "a recording is not writable by others"

# ---- a recording over planted files ----
plant second/candump.log second/summary.json
says 2 run coman "${quick[@]}" --record second --force && grep -q 'found a symbolic link' said
result $? "a link in the place of a log is refused"
rm second/candump.log
ln victim second/candump.log
says 0 run coman "${quick[@]}" --record second --force && [ -s second/summary.json ] &&
    [ ! -L second/summary.json ] && [ "$(stat -c %h second/candump.log)" = 1 ]
result $? "another name of a file, and a link in the place of the summary, are replaced"
kept "and what they were is as it was" second

# ---- what a failed scenario leaves ----
cat >wrong.yaml <<'END'
name: wrong
description: Fails at once.
rig: coman
duration_s: 0.05
expectations:
  - {name: never, signal: LElbj.voltage, reaches: [5, 6], within_s: 0.02}
END
plant results/wrong/summary.json results/wrong/expectation-1.svg out/junit.xml
says 1 test -o results --junit out/junit.xml wrong.yaml && [ ! -L results/wrong/summary.json ] &&
    [ ! -L results/wrong/expectation-1.svg ] && [ ! -L out/junit.xml ] && kept "a scenario that \
fails writes its recording, plots and JUnit file, and nothing behind links" results ||
    not_ok "a scenario that fails writes its recording, plots and JUnit file"

# ---- the link of somebody else in the place of a folder ----
if [ "$(id -u)" -eq 0 ]; then
    mkdir theirs
    ln -s theirs link
    chown -h nobody link
    says 2 run coman "${quick[@]}" --record link && grep -q 'link of another user' said &&
        says 2 dbc coman -o link && grep -q 'link of another user' said &&
        [ -z "$(ls theirs)" ]
    result $? "a folder behind the link of another user is not written into"
else
    skip "a folder behind the link of another user is not written into" "needs root"
fi
exit $failed
