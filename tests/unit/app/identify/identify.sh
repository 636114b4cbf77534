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
echo "1..25"

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

awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) q = $i == "q_pivot_rad" ? i : q }
    NR > 1 { $q *= 57.29578 } { print }' OFS=, "$work/record/signals.csv" >"$work/degrees.csv"
"$hil" identify "$work/start/rigs/arm.yaml" --recording "$work/degrees.csv" --free R_ohm \
    >"$work/out" 2>&1
[ $? -eq 2 ] &&
    grep -q 'but joint pivot turns from -3.2 to 3.2 rad: are they in radians' "$work/out"
result $? "angles in degrees are refused"

"$hil" identify "$work/start/rigs/arm.yaml" --recording "$work/record/signals.csv" \
    --free R_ohm,R_ohm >"$work/out" 2>&1
[ $? -eq 2 ] && grep -q 'found "R_ohm" again, expected it once' "$work/out" && {
    "$hil" identify "$work/start/rigs/arm.yaml" --recording "$work/record/signals.csv" \
        --free R_ohm --joint pviot >"$work/out" 2>&1
    [ $? -eq 2 ]
} && grep -q 'found no joint "pviot", expected each .* as "pivot"' "$work/out"
result $? "a number that is free twice and a joint that is not there are refused"

"$hil" identify coman --recording "$work/record/signals.csv" --free R_ohm >"$work/out" 2>&1
[ $? -eq 2 ] && grep -q '23 electric drives on a floating base, expected 1 to 16' "$work/out"
result $? "a robot on a floating base is refused"

"$hil" validate --report "$work/bench" >"$work/out" 2>&1 &&
    grep -q '^passed xl330' "$work/out" && [ -s "$work/bench/index.html" ] &&
    [ "$(wc -l <"$work/out")" -ge 5 ] && [ -s "$work/bench/zeroerr-erob80-50-diagram-1.svg" ]
result $? "the measured benches are within their limits, and a page with diagrams is there"

mkdir -p "$work/config" && cp -r "$source/config/." "$work/config/"
sed -i 's/, crc32: "[0-9a-f]*"//' "$work/config/validation/xl330.yaml"
"$hil" validate "$work/config/validation/xl330.yaml" >"$work/out" 2>&1
[ $? -eq 1 ] && grep -q '^unchecked xl330' "$work/out" &&
    [ "$(grep -c 'warning: found no key "crc32" for .*kp.*csv, expected "[0-9a-f]\{8\}"' \
        "$work/out")" -eq 8 ]
result $? "recordings without a checksum warn, and the bench does not pass"

"$hil" identify --bench robotis-xh430 --recording "$work/record/signals.csv" >"$work/out" 2>&1
[ $? -eq 2 ] && grep -q 'found a bench of points' "$work/out"
result $? "a bench of points is no bench of recordings"

# The walk-through of docs/identify.md on a drive whose numbers are known: excite, record what
# candump records, identify from other numbers, compare
mkdir -p "$work/guess"
cp -r "$source/config/robots" "$source/config/rigs" "$source/config/drives" "$work/guess/"
sed -i 's/R_ohm: [0-9.]*/R_ohm: 3.4/; s/NK\([tw]\)\(.*\): [0-9.]*/NK\1\2: 0.4/
    s/load_\(motor\|external\): [0-9.]*/load_\1: 0.15/; s/J_kg_m2: [0-9.]*/J_kg_m2: 0.0025/
    s/Dm_nm_s_rad: [0-9.]*/Dm_nm_s_rad: 0.02/' "$work/guess/drives/robotis-xl330-m288.yaml"
free=R_ohm,NKt_nm_a,J_kg_m2,load_motor,Dm_nm_s_rad
timeout -k 5 60 "$hil" run xl330-pendulum --transport local --clock free --duration 16 \
    --task excite --joint pivot --set excite.amplitude_v=5 --control none --record "$work/excite" \
    >"$work/out" 2>&1 </dev/null && ! grep -qi under "$work/excite/events.log"
result $? "a drive of 7.4 V is excited"

# near FILE: the numbers of the drive that ships, within 2 %
near() {
    awk -v share=0.02 'FNR == NR { truth[$1] = $2; next }
        $1 in truth && /#.*(known|rough)/ { off = $2 / truth[$1] - 1; n++
            if (off > share || off < -share) { print $1, $2, truth[$1]; bad = 1 } }
        END { exit bad || n < 5 }' "$source/config/drives/robotis-xl330-m288.yaml" "$1"
}
timeout -k 5 100 "$hil" identify "$work/guess/rigs/xl330-pendulum.yaml" --free $free \
    --recording "$work/excite/candump.log" -o "$work/found.yaml" >"$work/out" 2>&1 &&
    near "$work/found.yaml" >>"$work/out"
result $? "its numbers come back within 2 % from what candump -l writes"

# The same frames as candump -ta prints them, among those of another interface
awk '{ split($3, f, "#"); data = ""; n = length(f[2]) / 2
    for (i = 1; i <= n; i++) data = data " " substr(f[2], 2 * i - 1, 2)
    printf " %s  %s  %s   [%d] %s\n %s  can7  100   [8]  00 00 00 00 00 00 00 00\n", \
        $1, $2, f[1], n, data, $1 }' "$work/excite/candump.log" >"$work/printed"
timeout -k 5 100 "$hil" identify "$work/guess/rigs/xl330-pendulum.yaml" --free $free \
    --recording "$work/printed" -o "$work/again.yaml" >"$work/out" 2>&1 &&
    [ "$(grep -v '#.*\(printed\|candump\)' "$work/again.yaml" | grep -c .)" -gt 5 ] &&
    near "$work/again.yaml" >>"$work/out"
result $? "and from what it prints"

sed 's/ can0 / can7 /' "$work/excite/candump.log" >"$work/other.log"
"$hil" identify xl330-pendulum --free R_ohm --recording "$work/other.log" >"$work/out" 2>&1
[ $? -eq 2 ] && grep -q 'found 0 angles of joint pivot (pivot_motor_position)' "$work/out"
result $? "a log of another interface is refused"

sed '1s/^(/ [/' "$work/excite/candump.log" >"$work/damaged.log"
"$hil" identify xl330-pendulum --free R_ohm --recording "$work/damaged.log" >"$work/out" 2>&1
[ $? -eq 2 ] && grep -q 'damaged.log:1: found no column .*; it was read as CSV' "$work/out"
result $? "a log with a damaged begin is said to be taken for CSV"

cp "$source/config/rigs/xl330-pendulum.yaml" "$work/alone.yaml"
"$hil" check "$work/alone.yaml" >"$work/out" 2>&1
[ $? -eq 2 ] && grep -q 'alone.yaml:7:15: .*xl330-pendulum.yaml: cannot be read' "$work/out"
result $? "a rig that was copied without its robot is told its line"

# Other protocols: percent every millisecond and angles every four; a bridge that is told
cp -r "$work/guess" "$work/other"
sed -i 's/J_kg_m2: [0-9.]*/J_kg_m2: 0.003/' "$work/other/drives/robotis-xl330-m288.yaml"
for protocol in icub cia402 foc; do
    sed "s/^protocol: .*/protocol: $protocol/" "$source/config/rigs/xl330-pendulum.yaml" \
        >"$work/guess/rigs/$protocol.yaml"
    timeout -k 5 60 "$hil" run "$work/guess/rigs/$protocol.yaml" --transport local --clock free \
        --duration 16 --task excite --joint pivot --set excite.amplitude_v=5 --control none \
        --record "$work/$protocol" >"$work/out" 2>&1 </dev/null
    cp "$work/guess/rigs/$protocol.yaml" "$work/other/rigs/"
    timeout -k 5 100 "$hil" identify "$work/other/rigs/$protocol.yaml" --free J_kg_m2 \
        --recording "$work/$protocol/candump.log" -o "$work/$protocol.yaml" >"$work/out" 2>&1 &&
        awk '/J_kg_m2:/ { j = $2 } END { exit !(j > 0.00245 && j < 0.00255) }' \
            "$work/$protocol.yaml"
    result $? "a log of $protocol is read"
done

sed -i 's/_rad: -3.2, upper_rad: 3.2/_rad: -0.2, upper_rad: 0.2/' \
    "$work/other/robots/xl330-pendulum.yaml"
timeout -k 5 60 "$hil" run "$work/other/rigs/xl330-pendulum.yaml" --transport local --clock free \
    --duration 16 --task excite --joint pivot --set excite.amplitude_v=7 --control none \
    >"$work/out" 2>&1 </dev/null
[ $? -eq 1 ] && grep -q 'joint pivot: .* rad is at its limits, -0.2 to 0.2 rad' "$work/out"
result $? "an excitation ends where the joint reaches a limit"

cat >"$work/guess/rigs/oil.yaml" <<'END'
name: a
source: b
license: c
drive: ../drives/hyq.yaml
points: [{what: x, voltage_v: 1, speed_rad_s: 0, find: load_nm, value: 1}]
END
"$hil" validate "$work/guess/rigs/oil.yaml" >"$work/out" 2>&1
[ $? -eq 2 ] && grep -q 'oil.yaml:4:8: found a hydraulic drive' "$work/out"
result $? "points of a hydraulic drive are refused"

# The measured actuator behind a spring, whose recordings do not ship
COMAN_HIL_DATA=$work "$hil" validate sea-rmd-x8 >"$work/out" 2>&1
[ $? -eq 1 ] && grep -q '^missing sea-rmd-x8 .*commit 755c1e1' "$work/out"
result $? "a bench without its recordings says how to get them"

for kind in SEAStepResponse/sr_sea-3-1-55-100 SEAMotorBandwidth/bw_sea-0.5-2-8-40 \
    SEABandwidthClosedLoop/bw_sea_cl-2-1-22; do
    mkdir -p "$work/clone/Python/TestData/${kind%/*}"
    printf ',time,torque_in,torque_ati,torque_sea\n0,0.123456789,3,2.5,1e-9\n' \
        >"$work/clone/Python/TestData/$kind"
done
python3 "$source/config/validation/sea-rmd-x8.py" "$work/clone" "$work/made" >"$work/out" 2>&1 &&
    [ "$(cd "$work/made" && echo *)" = "chirp-0.5nm-2.csv closed-chirp-2nm.csv step-3nm.csv" ] &&
    [ "$(tail -1 "$work/made/step-3nm.csv")" = 0.123457,3,2.5,1e-09 ]
result $? "its script converts the recordings of the repository"

# A state of 8 samples, and one of less torque at the same speed, at the limit of the voltage
mkdir -p "$work/dyno/Logs"
awk 'BEGIN { OFS = ","; for (i = 1; i <= 8; i++) print i, -0.5, -10, 18, i, 1
    print 9, 0, 0, 0, 0, 0; for (i = 1; i <= 8; i++) print i, -0.4, -10, 18, i, 1 }' \
    >"$work/dyno/Logs/u8_pro_emap.csv"
for log in _2 _regen; do
    cp "$work/dyno/Logs/u8_pro_emap.csv" "$work/dyno/Logs/u8_pro_emap$log.csv"
done
python3 "$source/config/validation/dyno-u8.py" "$work/dyno" "$work/states" >"$work/out" 2>&1 &&
    [ "$(tail -1 "$work/states/fit.csv")" = -0.5,-10,18,5.5,6 ] &&
    [ "$(tail -1 "$work/states/limit.csv")" = -0.4,-10,18,5.5,6 ] &&
    cmp <(head -1 "$source/config/validation/data/dyno-u8/regen.csv") \
        <(head -1 "$work/states/regen.csv")
result $? "the script of the dynamometer converts its recordings"

if [ ! -d "${HIL_MEASURED:-}/sea-rmd-x8" ]; then
    skip "the measured actuator is within its limits" "HIL_MEASURED names no folder of recordings"
else
    COMAN_HIL_DATA=$HIL_MEASURED timeout -k 5 250 "$hil" validate sea-rmd-x8 sea-rmd-x8-closed \
        >"$work/out" 2>&1
    result $? "the measured actuator is within its limits"
fi
