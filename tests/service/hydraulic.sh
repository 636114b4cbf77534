#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Hydraulic joints over the buses: a leg held over every protocol and identified by a sweep, a
# quadruped that stands and squats, pressures in recording, frames and DBC, and a protocol that has
# nothing for a valve. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
program=$HIL_BINARY_DIR/coman-hil
cp -r "$HIL_SOURCE_DIR/config" "$work/config"
rigs=$work/config/rigs
tap_show="$work/out $work/err"

run() {
    timeout -k 5 100 "$program" run "$@" --transport local --clock free --control none --quiet \
        >"$work/out" 2>"$work/err" </dev/null
}

echo 1..12

# the leg, its two axes on one board, or on two where a board has one
for protocol in icub compact cia402; do
    {
        printf 'extends: hyq-leg.yaml\nname: leg\nprotocol: %s\n' $protocol
        printf 'tasks: {hold: {duration_s: 2.0, tolerance_rad: 0.01}}\n'
        if [ $protocol != icub ]; then
            printf 'buses:\n  - {name: leg, interface: can0, boards: [\n'
            printf '    {kind: motor, address: 1, axes: [hip, knee]}]}\n'
        fi
    } >"$rigs/$protocol.yaml"
    run "$rigs/$protocol.yaml" --task hold --duration 8 && grep -q 'held for 2.0 s' "$work/out"
    result $? "the leg holds its pose within 10 mrad over $protocol"
done
{
    printf 'extends: hyq-leg.yaml\nname: leg\nprotocol: foc\n'
    printf 'motors: {rotor_poles: 8, status_period_s: 0.01}\n'
    printf 'buses:\n  - {name: leg, interface: can0, boards: [\n'
    printf '    {kind: motor, address: 1, axes: [hip]}, {kind: motor, address: 2, axes: [knee]},\n'
    printf '    {kind: torque, address: 0x0c, joints: [hip, knee], period_s: 0.005}]}\n'
    printf 'tasks: {hold: {duration_s: 2.0, tolerance_rad: 0.01}}\n'
} >"$rigs/foc.yaml"
run "$rigs/foc.yaml" --task hold --duration 8 && grep -q 'held for 2.0 s' "$work/out"
result $? "the leg holds its pose within 10 mrad over foc"

printf 'extends: hyq-leg.yaml\nname: leg\nprotocol: %s\n' \
    ../protocols/mini-cheetah.yaml >"$rigs/cheetah.yaml"
sed -n '/^buses/,$p' "$rigs/foc.yaml" >>"$rigs/cheetah.yaml"
run "$rigs/cheetah.yaml" --task hold --duration 8
[ $? -eq 2 ] &&
    grep -q 'cheetah.yaml:6:.*: found hydraulic joint "hip", expected one with a' "$work/err"
result $? "a protocol that switches on into a law of torque is refused with the joint"

# a valve is a source of speed: V to angle falls as 1/f, and lags by 90 degrees
run "$rigs/hyq-leg.yaml" --task sweep --joint knee --duration 60 --report "$work/sweep" \
    --set sweep.points=3 --set sweep.from_hz=2 --set sweep.to_hz=8 --set sweep.amplitude_v=1.0 \
    --set sweep.measure_periods=3
result $? "a sweep identifies the knee"
python3 - "$work/sweep/sweep.csv" >"$work/out" 2>&1 <<'END'
import csv, sys
rows = list(csv.DictReader(open(sys.argv[1])))
print(rows)
gain = [float(r["link_rad_per_v"]) for r in rows]
lag = [float(r["link_deg"]) for r in rows]
assert len(rows) == 3 and all(float(r["torque_nm_per_v"]) > 0 for r in rows)
assert abs(gain[0] / gain[2] / 4 - 1) < 0.15, gain
assert all(-100 < x < -80 for x in lag), lag
END
result $? "its knee is an integrator of the voltage"

# the quadruped
run "$rigs/hyq.yaml" --task hold --duration 20 --record "$work/stand" &&
    grep -q 'held for 10.0 s' "$work/out"
result $? "HyQ stands for ten seconds"
python3 - "$work/stand" >"$work/out" 2>&1 <<'END'
import csv, sys
rows = list(csv.DictReader(open(sys.argv[1] + "/signals.csv")))
row = {name: float(value) for name, value in rows[-1].items()}
legs = ("lf", "rf", "lh", "rh")
# held by closed valves: what the chambers carry is what the joint bears, by the areas and a lever
bore, rod = 2.0106e-4, 1.2252e-4
for leg in legs:
    p, r = (row[f"{side}_pressure_{leg}_kfe_pa"] for side in ("piston", "rod"))
    torque = row[f"torque_{leg}_kfe_nm"]
    assert 2e5 <= r < 1.7e7 and 2e5 <= p < 1.7e7, (leg, p, r)
    lever = abs(torque) / (p * bore - r * rod)
    assert 0.035 < lever < 0.046, (leg, lever)
    assert abs(row[f"valve_opening_{leg}_kfe"]) < 0.03
assert 1.55e7 < row["hydraulic_supply_pa"] < 1.7e7
assert max(abs(row[f"base_{axis}_m"] - float(rows[0][f"base_{axis}_m"])) for axis in "xyz") < 2e-3

# the frame that left with the last row tells the same pressures
t, frame = float(rows[-1]["time_s"]), None
for line in open(sys.argv[1] + "/candump.log"):
    stamp, bus, data = line.split()[:3]
    if bus == "can0" and data.startswith("102#") and float(stamp[1:-1]) <= t + 1e-9:
        frame = int.from_bytes(bytes.fromhex(data[4:]), "little")
found = (frame >> 34 & 0x1fff) * 0.05e5, (frame >> 47 & 0x1fff) * 0.05e5
truth = row["piston_pressure_lf_kfe_pa"], row["rod_pressure_lf_kfe_pa"]
print(found, truth)
assert all(abs(a - b) < 0.3e5 for a, b in zip(found, truth)), (found, truth)
END
result $? "its pressures are those of its load, in the recording and in the frames"

run "$rigs/hyq.yaml" --task follow --trajectory "$HIL_SOURCE_DIR/examples/hyq-squat.csv" \
    --duration 20 --set follow.tolerance_rad=0.06 --record "$work/squat" &&
    grep -q 'followed 8.00 s' "$work/out"
result $? "HyQ squats along a file within 60 mrad"
python3 - "$work/squat" >"$work/out" 2>&1 <<'END'
import csv, sys
rows = list(csv.DictReader(open(sys.argv[1] + "/signals.csv")))
heights = [float(r["base_z_m"]) for r in rows]
print(min(heights), max(heights), heights[-1])
assert 0.10 < max(heights) - min(heights) < 0.14
assert abs(heights[-1] - heights[0]) < 0.01
assert all(abs(float(r["base_qx"])) + abs(float(r["base_qy"])) < 0.02 for r in rows)
END
result $? "its trunk goes down by 12 cm, twice, and stays level"

"$program" dbc "$rigs/hyq.yaml" --bus left_front >"$work/out" 2>"$work/err" &&
    grep -q 'SG_ lf_kfe_piston_pressure : 34|13@1+ (0.05,0) .* "bar"' "$work/out" &&
    grep -q 'SG_ lf_kfe_valve_opening : .* (0.0001,0)' "$work/out"
result $? "the DBC has pressures in bar, and the valve"

exit $failed
