#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: tasks.sh COMAN-HIL
# Tasks sweep, excite, follow and pose from the command line: options, reports, what is refused.
# Prints TAP.
set -u
program=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "${HIL_SOURCE_DIR:?}/tests/service/tap.sh"
tap_show="$work/out $work/err"

run() {
    "$program" run coman --clock free --transport local --control none --quiet \
        --duration 30 "$@" >"$work/out" 2>"$work/err" </dev/null
}

# refused TEXT ARGUMENT...: status 2, and standard error says TEXT
refused() {
    local text=$1
    shift
    run "$@"
    [ $? -eq 2 ] && grep -qF -- "$text" "$work/err"
}

echo 1..14

run --task sweep --joint LElbj --report "$work/sweep" --set sweep.points=2 --set sweep.from_hz=4 \
    --set sweep.to_hz=8 --set sweep.settle_s=0 --set sweep.measure_periods=2 &&
    grep -q "joint LElbj: 2 frequencies, 4 to 8 Hz" "$work/out"
result $? "a sweep measures the frequencies that it is given"
[ "$(grep -c . "$work/sweep/sweep.csv")" = 3 ] && [ -s "$work/sweep/index.html" ] &&
    python3 - "$work/sweep" <<'END'
import csv, sys, xml.dom.minidom
rows = list(csv.DictReader(open(sys.argv[1] + "/sweep.csv")))
assert [float(r["frequency_hz"]) for r in rows] == [4, 8], rows
assert all(float(r["rotor_coherence"]) > 0.99 for r in rows), rows
for name in ("angle-1", "angle-2", "angle-3", "torque-1"):
    xml.dom.minidom.parse(f"{sys.argv[1]}/bode-{name}.svg")
END
result $? "its report has a table, plots and a page"

printf 'time_s,LElbj_deg\n0,-30\n0.4,-35\n0.8,-30\n' >"$work/wave.csv"
run --task follow --trajectory "$work/wave.csv" --report "$work/follow" &&
    grep -q "followed 0.80 s, largest errors:" "$work/out" &&
    grep -q "^LElbj,yes," "$work/follow/follow.csv" &&
    grep -q "^RElbj,no," "$work/follow/follow.csv"
result $? "a file is followed, with the errors of every joint"

"$program" run coman --clock free --transport local --control none --quiet --task hold \
    --duration 3 >"$work/out" 2>"$work/err" </dev/null &&
    grep -q "^task hold, before its end: holding for 0\.[0-9] s, largest deviations: " "$work/out"
result $? "a run that ends before its task says how far that is"
"$program" run coman --clock free --transport local --control none --quiet --task pose \
    --set pose.LElbj_rad=-0.9 --set pose.rate_rad_s=1 --duration 4 --record "$work/pose" \
    >"$work/out" 2>"$work/err" </dev/null &&
    awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == "q_LElbj_rad") column = i }
             END { exit !(column && $column > -0.95 && $column < -0.85) }' "$work/pose/signals.csv"
result $? "a pose that is set is reached, and the task goes on"
refused "pose.LElbj_rad: found \"9\", expected -" --task pose --set pose.LElbj_rad=9
result $? "an angle beyond the joint's limits is refused"
run --task excite --joint LElbj --set excite.amplitude_rad=0.3 --set excite.duration_s=6 \
    --record "$work/excite" && grep -q "joint LElbj: 6.0 of 6.0 s, 8 sines" "$work/out" &&
    python3 - "$work/excite/signals.csv" <<'END'
import csv, sys
rows = [{k: float(v) for k, v in r.items()} for r in csv.DictReader(open(sys.argv[1]))]
elbow = [r["q_LElbj_rad"] for r in rows]
middle = elbow[0]
assert 0.1 < max(abs(q - middle) for q in elbow) < 0.31, (min(elbow), max(elbow), middle)
assert abs(elbow[-1] - middle) < 0.02, (elbow[-1], middle)
END
result $? "an excitation stays within its amplitude and ends where it began"
run --task excite --joint LElbj --set excite.amplitude_rad=3
[ $? -eq 1 ] && grep -q "3 rad to both sides of .* is beyond its limits" "$work/out" "$work/err"
result $? "an excitation beyond the joint's limits is not begun"
refused "found no joint, expected one by --joint" --task sweep
result $? "a sweep without a joint is refused"
refused "sweep: the rig has no joint Elbow, expected one of WaistLat, WaistSag" --task sweep \
    --joint Elbow
result $? "a joint that is not there is refused with those that are"
refused "sweep: the rig has no joint LElb, expected LElbj" --task sweep --joint LElb
result $? "with the nearest one"
refused "sweep.points: found \"0\", expected a whole number, 1 to 200" \
    --task sweep --joint LElbj --set sweep.points=0
result $? "a setting out of its range is refused with the range"
refused "found no trajectory, expected a file by --trajectory" --task follow
result $? "to follow nothing is refused"
refused "found --joint with the task hold, expected it with sweep and excite only" --task hold \
    --joint LElbj
result $? "an option of another task is refused"
printf 'time_s,LElbj_deg\n0,-30\n0.4,-350\n' >"$work/wave.csv"
refused "wave.csv:3: column 2 (LElbj_deg): found" --task follow --trajectory "$work/wave.csv"
result $? "an angle beyond a limit is refused with its line"
exit $failed
