#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The manipulation task over the five CAN buses: COMAN takes the box from the table in lockstep,
# with elbows stiff and soft, standing and held at its base. Judged from the recordings; what the
# controller says of the grip must be what the plant recorded. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp -r "$HIL_SOURCE_DIR/config" "$work/config"

rig() # NAME < what it says beyond or instead of grasp.yaml
{
    { echo "extends: grasp.yaml"; cat; } >"$work/config/rigs/$1.yaml"
}

run() # NAME RIG OPTION...
{
    local name=$1 file=$work/config/rigs/$2.yaml
    shift 2
    timeout -k 5 60 "$HIL_BINARY_DIR/coman-hil" run "$file" --transport local --quiet \
        --record "$work/$name" "$@" >"$work/$name.out" 2>"$work/$name.err" </dev/null
    echo $? >"$work/$name.status"
}

rig slippery <<'END'
scene: {materials: {wrist: {static_friction: 0.1, dynamic_friction: 0.1}}}
END
rig absent <<'END'
scene:
  bodies:
    - {name: box, mass_kg: 1.5, box_m: [0.15, 0.15, 0.15], xyz_m: [0.40, 0.0, 0.55]}
    - {name: table, static: true, xyz_m: [0.40, 0.0, 0.475]}
END
rig stretched <<'END'
tasks: {grasp: {path: [{name: reach, until_s: 1, arm_rad: [0, 0, 0, 0.5]}]}}
END
rig backward <<'END'
tasks: {grasp: {path: [{name: reach, until_s: 1, arm_rad: [0, 0, 0, 0]},
                       {name: lift, until_s: 1, arm_rad: [0, 0, 0, -0.5]}]}}
END
run lockstep grasp --clock lockstep --task grasp
run again grasp --clock lockstep --task grasp
run light grasp-light --clock free --task grasp
run soft grasp-soft --clock free --task grasp
run locked grasp-locked --clock free --task grasp
for name in slippery absent stretched backward; do
    run $name $name --clock free --task grasp
done
run pathless coman --clock free --task grasp
cmp "$work/lockstep/candump.log" "$work/again/candump.log" >"$work/same" 2>&1 &&
    cmp "$work/lockstep/signals.csv" "$work/again/signals.csv" >>"$work/same" 2>&1
echo $? >"$work/same.status"

PYTHONPATH=$HIL_SOURCE_DIR/tests/service PYTHONDONTWRITEBYTECODE=1 \
    python3 - "$work" <<'END'
import csv, re, sys

from tap import check

work = sys.argv[1]


def said(name):
    return (open(f"{work}/{name}.out").read() + open(f"{work}/{name}.err").read()).strip()


def last_words(name):
    return said(name)[-180:].replace("\n", " ")


def status(name):
    return open(f"{work}/{name}.status").read().strip()


def load(name):
    try:
        with open(f"{work}/{name}/signals.csv") as file:
            return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
    except OSError:
        return []


def rise(row):
    return row["box_z_m"] - 0.55


def press(row, side):
    return row[f"fy_{side}_wrist_on_box_n"] * (1 if side == "right" else -1)


def rub(row):
    return row["fz_right_wrist_on_box_n"] + row["fz_left_wrist_on_box_n"]


def yielded(row):
    return abs(row["q_RElbj_rad"] - row["qm_RElbj_rad"])


def mean(values):
    return sum(values) / len(values)


print("1..14")
rows = load("lockstep")
check(status("lockstep") == "0" and rows, "the run ends with status 0, the task done",
      last_words("lockstep"))
if not rows:
    sys.exit("no recording")
weight = 1.5 * 9.81
touched = next((i for i, r in enumerate(rows) if press(r, "right") > 0), len(rows) - 1)
before = [r["fz_table_on_box_n"] for r in rows[:touched] if r["time_s"] > 0.2]
check(max(abs(f / weight - 1) for f in before) < 0.005,
      "the table carries the box within 0.5 % until the touch",
      f"{min(before):.4f} to {max(before):.4f} N of {weight:.4f} N")
moved = next(r["time_s"] for r in rows if abs(r["qm_RElbj_rad"]) > 0.003)
check(abs(rows[touched]["time_s"] - moved - 1.06) < 0.06,
      "the wrists touch it about 1.06 s after the arms began to move",
      f"{rows[touched]['time_s'] - moved:.3f} s")
hold = [r for r in rows if r["time_s"] > rows[-1]["time_s"] - 0.5]
check(min(map(rise, hold)) > 0.03 and all(r["fz_table_on_box_n"] == 0 for r in hold),
      "the box is lifted by 3 cm or more and stays off the table",
      f"{1e3 * min(map(rise, hold)):.1f} to {1e3 * max(map(rise, hold)):.1f} mm")
check(all(abs(press(r, "left") / press(r, "right") - 1) < 0.02 for r in hold),
      "both wrists press alike within 2 %",
      f"{press(hold[-1], 'right'):.3f} N and {press(hold[-1], 'left'):.3f} N")
carried = mean([rub(r) for r in hold])
check(abs(carried / weight - 1) < 0.03, "on average friction carries the box's weight within 3 %",
      f"{carried:.3f} N of {weight:.3f} N")
feet = mean([r["fz_LFoot_n"] + r["fz_RFoot_n"] for r in hold])
check(abs(feet / (9.81 * (31.45386 + 1.5)) - 1) < 0.01,
      "on average the feet carry robot and box within 1 %", f"{feet:.2f} N")
told = re.findall(r"press with ([-\d.]+) N and ([-\d.]+) N and carry ([-\d.]+) N", said("lockstep"))
told = [float(n) for n in told[-1]] if told else []
truth = [press(rows[-1], "right"), press(rows[-1], "left"), rub(rows[-1])]
check(told and all(abs(a - b) < 1.0 for a, b in zip(told, truth)),
      "the controller's estimate from the F/T boards is within 1 N of the contact forces",
      f"{told} of {[round(f, 2) for f in truth]}")
check(status("same") == "0", "two lockstep runs are the same byte by byte",
      open(work + "/same").read().strip() or "equal")

stiff, soft = load("light"), load("soft")
if not stiff or not soft:
    sys.exit(last_words("light") + last_words("soft"))
untouched = next(i for i, r in enumerate(soft) if press(r, "right") > 0) - 1
check(press(soft[-1], "right") < 0.5 * press(stiff[-1], "right"),
      "soft elbows press less than stiff ones",
      f"{press(soft[-1], 'right'):.2f} N, {press(stiff[-1], 'right'):.2f} N")
check(yielded(soft[untouched]) < 0.02 and yielded(soft[-1]) > 0.1 and yielded(stiff[-1]) < 0.05,
      "soft elbows follow the motors until the touch and give way then",
      f"{1e3 * yielded(soft[untouched]):.1f} mrad, then {1e3 * yielded(soft[-1]):.1f} mrad; "
      f"stiff {1e3 * yielded(stiff[-1]):.1f} mrad")

locked = load("locked")
check(locked and max(map(rise, locked)) > 0.03 and "base_z_m" not in locked[0] and
      all(r["fz_RFoot_n"] == 0 for r in locked),
      "held at its base, without feet, it lifts the box too",
      f"{1e3 * max(map(rise, locked)):.1f} mm" if locked else last_words("locked"))
check(status("slippery") != "0" and "not lifted: the wrists carry" in said("slippery") and
      status("absent") != "0" and "the grip is lost" in said("absent"),
      "a box that slips and one that is not there are reported as failures",
      last_words("slippery") + " | " + last_words("absent"))
refusals = {
    "stretched": "phase reach needs joint RElbj at 0.500 rad, its limits are",
    "backward": "phase lift ends at 1 s, expected later than the one before",
    "pathless": "grasp: the rig has no path for it",
}
check(all(status(n) != "0" and text in said(n) for n, text in refusals.items()),
      "paths that cannot be followed are refused",
      " | ".join(map(last_words, refusals)))
END
