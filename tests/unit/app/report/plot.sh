#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: plot.sh COMAN-HIL
# The plot command: lists, patterns, an axis a unit, lines thinned out without losing a peak, PNG.
# Prints TAP.
set -u
program=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "${HIL_SOURCE_DIR:?}/tests/service/tap.sh"
tap_show="$work/out $work/err"

cat >"$work/small.csv" <<'END'
time_s,q_LKnee_rad,q_RKnee_rad,q_LHip_rad,torque_LKnee_nm
0,0.1,0.2,0.3,40
0.01,0.2,0.3,0.4,50
END

plot() { "$program" plot "$@" >"$work/out" 2>"$work/err" </dev/null; }

echo 1..9

plot "$work/small.csv" --list && [ "$(tr '\n' ' ' <"$work/out")" = \
    "q_LKnee_rad q_RKnee_rad q_LHip_rad torque_LKnee_nm " ]
result $? "the titles are listed"

plot "$work/small.csv" --signal 'q_?Knee_rad' --signal q_RKnee_rad &&
    [ "$(grep -o '>q_[A-Za-z]*_rad<' "$work/out" | tr '\n' ' ')" = ">q_LKnee_rad< >q_RKnee_rad< " ]
result $? "a pattern chooses signals, each once"

plot "$work/small.csv" --signal '*Knee*' && [ "$(grep -c 'class="axis"' "$work/out")" = 2 ] &&
    grep -q 'angle, rad' "$work/out" && grep -q 'torque, N m' "$work/out" &&
    python3 -c 'import sys, xml.dom.minidom; xml.dom.minidom.parse(sys.argv[1])' "$work/out"
result $? "each unit has an axis of its own"

plot "$work/small.csv" --signal q_LKne_rad
[ $? -eq 2 ] && grep -q 'the nearest is q_LKnee_rad' "$work/err"
result $? "a name that is not there is refused, with the nearest"
plot "$work/small.csv"
[ $? -eq 2 ] && grep -q -- '--list' "$work/err"
result $? "no signal is refused"

plot "$work/small.csv" --signal q_LKnee_rad --from 5 --to 600
[ $? -eq 2 ] && [ ! -s "$work/out" ] &&
    grep -q 'no row from 5 to 600 s, expected times within 0 to 0.01 s' "$work/err" &&
    { plot "$work/small.csv" --signal q_LKnee_rad --from 5 --to 3; [ $? -eq 2 ]; } &&
    grep -q -- '--from: found 5 s behind --to 3 s' "$work/err"
result $? "a time without rows is refused, with the times that there are"

# A hundred thousand points with one peak that lasts for one of them
awk 'BEGIN { print "time_s,a_nm"; for (i = 0; i < 100000; i++)
    printf "%.3f,%.9g\n", i * 1e-3, i == 54321 ? 7 : sin(i * 1e-3) }' >"$work/long.csv"
plot "$work/long.csv" --signal a_nm && python3 - "$work/out" <<'END'
import re, sys
text = open(sys.argv[1]).read()
path = max(re.findall(r' d="([^"]*)"', text), key=len)
points = [tuple(map(float, p.split())) for p in re.split("[ML]", path)[1:]]
x, y = min(points, key=lambda p: p[1])
left, right = points[0][0], points[-1][0]
good = (len(points) < 4500 and path.count("M") == 1 and
        abs((x - left) / (right - left) - 54321 / 99999) < 2e-3 and
        sum(p[1] < y + 50 for p in points) == 1 and
        all(b[0] >= a[0] for a, b in zip(points, points[1:])))
sys.exit(not good)
END
result $? "a long line is thinned out and keeps its peak"

if command -v rsvg-convert >/dev/null; then
    plot "$work/small.csv" --signal 'q_*' --output "$work/plot.png" &&
        [ "$(head -c 4 "$work/plot.png" | tail -c 3)" = PNG ]
    result $? "a name that ends in .png gives a PNG"
else
    result 0 "a name that ends in .png gives a PNG # SKIP no rsvg-convert here"
fi
PATH=/nowhere plot "$work/small.csv" --signal 'q_*' --output "$work/none.png"
[ $? -eq 4 ] && /bin/grep -q librsvg2-bin "$work/err" && [ ! -e "$work/none.png" ]
result $? "without the program that draws it nothing is left behind"
