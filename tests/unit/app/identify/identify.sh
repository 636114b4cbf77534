#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# coman-hil identify and validate from the command line: a drive comes back from a recording of a
# run of it, its file is read again, the measured bench passes, and what cannot be is refused.
# Prints TAP.
set -u
hil=$1
source=${HIL_SOURCE_DIR:?}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$source/tests/service/tap.sh"
tap_show=$work/out
echo "1..7"

# arm FOLDER OHM: a pendulum on a drive of the catalogue with friction by load
arm() {
    mkdir -p "$work/$1/robots" "$work/$1/rigs" "$work/$1/drives"
    cp "$source/config/drives/cubemars-ak80-6.yaml" "$work/$1/drives/"
    sed "s/drive: robotis.*/drive: {file: cubemars-ak80-6, coulomb_nm: 0.1, load_motor: 0.1, \
load_external: 0.1, backlash_rad: 0.0, J_kg_m2: 0.02, R_ohm: $2}/; s/torque_nm: 2.0/torque_nm: 20.0/
        s/mass_kg: 0.49/mass_kg: 4.0/; s/-0.1\]/-0.2]/" \
        "$source/config/robots/xl330-pendulum.yaml" >"$work/$1/robots/xl330-pendulum.yaml"
    sed 's/supply_v: .*/supply_v: 48.0/; s/full_scale_nm: .*/full_scale_nm: 40.0/
        s/limit_a: .*/limit_a: 80.0/' \
        "$source/config/rigs/xl330-pendulum.yaml" >"$work/$1/rigs/arm.yaml"
}

# run DIR MS: records the true arm
run() {
    timeout -k 5 60 "$hil" run "$work/true/rigs/arm.yaml" --transport local --clock free \
        --duration 4 --task sweep --joint pivot --control none --record "$work/$1" \
        --record-period "$2" >"$work/out" 2>&1 </dev/null
}

arm true 1.0
arm start 1.5
run record 1
timeout -k 5 100 "$hil" identify "$work/start/rigs/arm.yaml" --joint pivot --recording \
    "$work/record/signals.csv" --free R_ohm,load_motor -o "$work/true/drives/found.yaml" \
    --report "$work/page" >"$work/out" 2>&1
result $? "a drive is identified from a recording of a run"

awk '/R_ohm:/ { r = $2 } /load_motor:/ { l = $2 }
    END { exit !(r > 0.999 && r < 1.001 && l > 0.0999 && l < 0.1001) }' \
    "$work/true/drives/found.yaml" >"$work/out" 2>&1
result $? "its numbers come back"

sed -i 's/drive: {file: cubemars.*/drive: found/' "$work/true/robots/xl330-pendulum.yaml"
"$hil" check "$work/true/rigs/arm.yaml" >"$work/out" 2>&1 && [ -s "$work/page/index.html" ]
result $? "its file is a drive's, and a page is there"

run sparse 10
"$hil" identify "$work/start/rigs/arm.yaml" --recording "$work/sparse/signals.csv" --free R_ohm \
    >"$work/out" 2>&1
[ $? -eq 2 ] && grep -q 'expected one a tick' "$work/out"
result $? "a recording with fewer rows than ticks is refused"

"$hil" identify coman --recording "$work/record/signals.csv" --free R_ohm >"$work/out" 2>&1
[ $? -eq 2 ] && grep -q 'expected one joint' "$work/out"
result $? "a robot of many joints is refused"

"$hil" validate --report "$work/bench" >"$work/out" 2>&1 &&
    grep -q '^passed xl330' "$work/out" && [ -s "$work/bench/index.html" ] &&
    [ "$(wc -l <"$work/out")" -ge 5 ] && [ -s "$work/bench/zeroerr-erob80-50-diagram-1.svg" ]
result $? "the measured benches are within their limits, and a page with diagrams is there"

"$hil" identify --bench robotis-xh430 --recording "$work/record/signals.csv" >"$work/out" 2>&1
[ $? -eq 2 ] && grep -q 'found a bench of points' "$work/out"
result $? "a bench of points is no bench of recordings"
