#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The scenarios that come with the program: all pass, each fails under its mutations, what
# fails leaves a recording and plots. Prints TAP.
# usage: scenarios.sh [NAME...]: of these scenarios; of all without one
set -u
program=$HIL_BINARY_DIR/coman-hil
scenarios=$HIL_SOURCE_DIR/config/scenarios
files=("$scenarios"/*.yaml)
if [ $# -gt 0 ]; then
    files=("${@/#/$scenarios/}")
    files=("${files[@]/%/.yaml}")
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/out $work/err"

# run STATUS ARGUMENT...
run()
{
    local expected=$1
    shift
    timeout -k 5 800 "$program" test "$@" >"$work/out" 2>"$work/err" </dev/null
    [ $? -eq "$expected" ]
}

# totals FILE: tests, failures and errors of a JUnit file that keeps the rules of the schemas
totals() { python3 "$HIL_SOURCE_DIR/tests/service/junit.py" "$1"; }

names()
{
    python3 -c 'import sys, xml.etree.ElementTree as tree
print(*sorted(c.get("name") for c in tree.parse(sys.argv[1]).iter("testcase")), sep="\n")' "$1"
}

echo 1..13

name="there are at least twenty scenarios"
if [ "$(find "$scenarios" -name '*.yaml' | wc -l)" -ge 20 ]
then ok "$name"; else not_ok "$name"; fi

name="all pass, every mutation makes its scenario fail, and every expectation fails under some"
if run 0 --mutate --junit "$work/all.xml" --output "$work/results" "${files[@]}" &&
    [[ "$(totals "$work/all.xml")" =~ ^[1-9][0-9]+\ 0\ 0$ ]] && [ ! -e "$work/results" ]
then ok "$name"; else not_ok "$name"; fi
echo "# $(tail -1 "$work/out")"

# ---- a scenario that fails ----
mkdir -p "$work/config/scenarios"
cp -r "$HIL_SOURCE_DIR/config/rigs" "$HIL_SOURCE_DIR/config/robots" \
    "$HIL_SOURCE_DIR/config/meshes" "$work/config"
cat >"$work/config/scenarios/wrong.yaml" <<'END'
name: wrong
description: Expects <what> is "not" & never will be.
rig: ../rigs/coman.yaml
hold: always
host: enabled
parameters:
  volts: {values: [1, 2]}
duration_s: 0.3
stimuli:
  - {label: drive, after: ready, voltage: {joint: LElbj, volts: ${volts}}, for_s: 0.1}
expectations:
  - {name: "one <volt>", after: drive, signal: LElbj.voltage, reaches: [0.99, 1.01], within_s: 0.05}
  - {name: quiet bus, frame: {bus: left_arm, id: 0x121}, never: true}
  - {name: a log line, event: nobody says this}
END

name="what fails is told with time and value, in the status, in JUnit, and as log and plots"
stayed="one <volt>: LElbj.voltage stayed between 0 and 2.* until 0.0[0-9]* s"
if run 1 --to-the-end --output "$work/results" --junit "$work/wrong.xml" \
    "$work/config/scenarios/wrong.yaml" &&
    [ "$(totals "$work/wrong.xml")" = "2 2 0" ] &&
    grep -q '^FAIL  wrong \[volts=2\]' "$work/out" &&
    grep -q "$stayed, expected it to reach 0.99 to 1.01" "$work/out" &&
    grep -q 'quiet bus: frames seen 1 times until 0.0[0-9]* s, expected 0 to 0' "$work/out" &&
    grep -q '#' "$work/results/wrong-2/candump.log" &&
    grep -q '<svg' "$work/results/wrong-2/expectation-1.svg" &&
    grep -q '<svg' "$work/results/wrong-1/expectation-3.svg" &&
    [ ! -e "$work/results/wrong-1/expectation-1.svg" ]
then ok "$name"; else not_ok "$name"; fi

name="its recording says what it was of, and the page plays it, with the rig that the case had"
sed -e 's/^name: wrong/name: changed/' -e '/^hold:/i\
changes:\
  supply_v: ${volts}' -e 's/values: \[1, 2\]/values: [30, 31]/' \
    "$work/config/scenarios/wrong.yaml" >"$work/config/scenarios/changed.yaml"
replays()
{
    timeout -k 5 60 "$program" replay "$1" --http 0 --ready "$work/ready" 2>"$work/err" &
    local pid=$! turn
    for ((turn = 0; turn < 300; turn++)); do
        [ -e "$work/ready" ] || ! kill -0 $pid 2>/dev/null && break
        sleep 0.1
    done
    [ -e "$work/ready" ] && grep -q 'recording: .* of the rig' "$work/err"
    local good=$?
    kill -INT $pid 2>/dev/null
    wait $pid
    return $good
}
if run 1 --output "$work/results" "$work/config/scenarios/changed.yaml" &&
    python3 -c 'import json, sys
one = json.load(open(sys.argv[1])); two = json.load(open(sys.argv[2]))
assert one["scenario_file"].endswith("wrong.yaml") and one["values"] == {"volts": "2"}, one
assert two["values"] == {"volts": "31"} and two["ticks"] > 0 and two["rig"], two' \
        "$work/results/wrong-2/summary.json" "$work/results/changed-2/summary.json" &&
    replays "$work/results/wrong-2" && replays "$work/results/changed-2"
then ok "$name"; else not_ok "$name"; fi

name="a run ends at its first failure, and says what was not judged"
sed 's/^name: wrong/name: early/' "$work/config/scenarios/wrong.yaml" \
    >"$work/config/scenarios/early.yaml"
if run 1 --output "$work/results" --junit "$work/early.xml" "$work/config/scenarios/early.yaml" &&
    [ "$(totals "$work/early.xml")" = "2 2 0" ] &&
    grep -q 'the run ended there: [12] of 3 expectations not judged' "$work/out" &&
    [ "$(wc -l <"$work/results/early-1/signals.csv")" -lt \
        "$(wc -l <"$work/results/wrong-1/signals.csv")" ]
then ok "$name"; else not_ok "$name"; fi

name="what cannot be recorded fails all the same, and says why there is no recording"
mkdir -p "$work/full/wrong-1" && ln -s /dev/full "$work/full/wrong-1/signals.csv" &&
    : >"$work/file"
failed_unrecorded()
{
    run 1 --to-the-end --output "$1" --junit "$work/bare.xml" \
        "$work/config/scenarios/wrong.yaml" &&
        [ "$(totals "$work/bare.xml")" = "2 2 0" ] &&
        grep -q 'quiet bus: frames seen' "$work/out" &&
        grep -q "not recorded: .*$2" "$work/out"
}
if failed_unrecorded "$work/file/no" "Not a directory" &&
    failed_unrecorded "$work/full" "No space left on device"
then ok "$name"; else not_ok "$name"; fi

name="a run whose STEP never comes is ended, the others go on"
sed -e 's/^name: wrong/name: hangs/' -e '/^hold:/i\
clock: lockstep\
wall_limit_s: 0.5\
faults: ["bus torso loss 1 id=0x6f0"]' \
    "$work/config/scenarios/wrong.yaml" >"$work/config/scenarios/hangs.yaml"
if run 1 --output "$work/results" --junit "$work/hangs.xml" "$work/config/scenarios/hangs.yaml" \
    "$scenarios/brown_out.yaml" &&
    [ "$(totals "$work/hangs.xml")" = "3 0 2" ] && grep -q 'no STEP has come for 0.5 s' "$work/out"
then ok "$name"; else not_ok "$name"; fi

name="the seed of the command line is that of the run, and equal seeds make equal runs"
hash_of()
{
    python3 -c 'import sys, xml.etree.ElementTree as tree
print(*[p.get("value") for p in tree.parse(sys.argv[1]).iter("property")
        if p.get("name").endswith((" seed", " state_hash"))])' "$1"
}
if run 0 --seed 7 --junit "$work/a.xml" "$scenarios/noisy_sensors_squat.yaml" &&
    run 0 --seed 7 --jobs 1 --junit "$work/b.xml" "$scenarios/noisy_sensors_squat.yaml" &&
    run 0 --junit "$work/c.xml" "$scenarios/noisy_sensors_squat.yaml" &&
    [[ "$(hash_of "$work/a.xml")" = 7\ * ]] &&
    [ "$(hash_of "$work/a.xml")" = "$(hash_of "$work/b.xml")" ] &&
    [ "$(hash_of "$work/a.xml")" != "$(hash_of "$work/c.xml")" ]
then ok "$name"; else not_ok "$name"; fi

name="names that the rig does not have are refused with the nearest one"
sed 's/LElbj.voltage/LElbj.voltag/' "$work/config/scenarios/wrong.yaml" \
    >"$work/config/scenarios/named.yaml"
if run 2 "$work/config/scenarios/named.yaml" &&
    grep -q 'named.yaml:12:5: found signal "LElbj.voltag".*expected "voltage"' "$work/err" &&
    sed -i 's/voltag,/voltage,/; s/bus: left_arm/bus: can3/' \
        "$work/config/scenarios/named.yaml" && run 2 "$work/config/scenarios/named.yaml" &&
    grep -q 'found unknown bus "can3", expected torso, left_leg, right_leg, left_arm or right_arm' \
        "$work/err"
then ok "$name"; else not_ok "$name"; fi

name="results that cannot be written are refused before anything runs"
if run 3 --junit "$work/no/results.xml" "$work/config/scenarios/wrong.yaml" &&
    [ ! -s "$work/out" ] && grep -q "no/results.xml" "$work/err" &&
    : >"$work/old.xml" && run 1 --junit "$work/old.xml" --output "$work/results" \
        "$work/config/scenarios/early.yaml" && [ "$(totals "$work/old.xml")" = "2 2 0" ]
then ok "$name"; else not_ok "$name"; fi

name="a stimulus that repeats faster than the ticks come is refused"
cat >"$work/config/scenarios/fast.yaml" <<'END'
name: fast
description: A frame every half tick.
rig: ../rigs/coman.yaml
duration_s: 1.0
stimuli:
  - {at_s: 0.2, frame: {bus: torso, id: 0x70f, data: ff}, every_s: 0.0005, for_s: 0.1}
expectations:
  - {name: it is there, signal: time_s, between: [0, 2]}
END
if run 2 "$work/config/scenarios/fast.yaml" &&
    grep -q 'fast.yaml:6:5: found every_s 0.0005, expected the tick of 0.001 s or more' "$work/err"
then ok "$name"; else not_ok "$name"; fi

name="a fault of a stimulus has neither a time nor a name of its own"
for fault in 'motor LElbj jam 2..3' 'motor LElbj jam 0..' 'knee: motor LElbj jam'; do
    cat >"$work/config/scenarios/timed.yaml" <<END
name: timed
description: A fault that has its time twice.
rig: ../rigs/coman.yaml
duration_s: 1.0
stimuli:
  - {at_s: 0.2, fault: "$fault"}
expectations:
  - {name: it is there, signal: time_s, between: [0, 2]}
END
    run 2 "$work/config/scenarios/timed.yaml" &&
        grep -q "timed.yaml:6:5: found fault \"$fault\" with a .*, expected one without" \
            "$work/err" || break
done
if [ $? -eq 0 ]; then ok "$name"; else not_ok "$name"; fi

# who only looks changes nothing
cat >"$work/config/scenarios/looks.yaml" <<'END'
name: looks
description: Looks at a squat.
rig: ../rigs/coman.yaml
task: squat
duration_s: 2.0
expectations:
  - {name: it squats, signal: task.status, between: [0, 0]}
  - {name: frames pass, frame: {bus: left_leg, id: 0x111}}
END
name="a scenario that only looks ends in the state in which run ends"
if run 0 --junit "$work/looks.xml" "$work/config/scenarios/looks.yaml" &&
    "$program" run "$scenarios/../rigs/coman.yaml" --transport local --clock free --task squat \
    --duration 2 \
        --quiet --record "$work/run" >"$work/out" 2>"$work/err" &&
    [ "$(hash_of "$work/looks.xml" | cut -d' ' -f2)" = \
      "$(python3 -c 'import json, sys
print(json.load(open(sys.argv[1]))["state_hash"])' "$work/run/summary.json")" ]
then ok "$name"; else not_ok "$name"; fi
