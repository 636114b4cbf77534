#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The paper's section 7: WALK-MAN squats four times, 30 cm in 7 s, driven over its five CAN buses by
# the controller that squats COMAN. Judged from the recording and the frames on the bus by a second
# model of the robot, in statics, made here from the robot's file. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

rig=$HIL_SOURCE_DIR/config/rigs/walkman.yaml

run() { # name, rig, options
    name=$1 file=$2
    shift 2
    timeout -k 5 100 "$HIL_BINARY_DIR/coman-hil" run "$file" --transport local --task squat \
        --quiet \
        --record "$work/$name" "$@" >"$work/$name.out" 2>"$work/$name.err" </dev/null
    echo $? >"$work/$name.status"
}
run free "$rig" --clock free --record-period 1
run lockstep "$rig" --clock lockstep

# the same with steps that are exact: to compare with, and for accelerations that can be
# differentiated
mkdir -p "$work/config/rigs"
ln -s "$HIL_SOURCE_DIR/config/robots" "$HIL_SOURCE_DIR/config/meshes" "$work/config"
sed 's/^integrator: implicit.*/integrator: dopri5\ntolerance: 1.0e-9/' "$rig" \
    >"$work/config/rigs/exact.yaml"
run exact "$work/config/rigs/exact.yaml" --clock free --record-period 1 --duration 6

PYTHONPATH=$HIL_SOURCE_DIR/tests/service PYTHONDONTWRITEBYTECODE=1 \
    python3 - "$work" "$HIL_SOURCE_DIR" <<'END'
import math, re, sys

from tap import check

work, source = sys.argv[1:]
G, DEPTH, PERIOD, CYCLES, THIGH, SHANK = 9.81, 0.30, 7.0, 4, 0.356, 0.4


# ---- vectors and turns ----
def add(a, b, k=1.0):
    return [x + k * y for x, y in zip(a, b)]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def apply(M, v):
    return [dot(row, v) for row in M]


def transposed(M):
    return [list(column) for column in zip(*M)]


def times(A, B):
    return [[dot(row, column) for column in zip(*B)] for row in A]


def turn(axis, angle):
    n = math.sqrt(dot(axis, axis))
    x, y, z = (c / n for c in axis)
    c, s = math.cos(angle), math.sin(angle)
    return [[c + x * x * (1 - c), x * y * (1 - c) - z * s, x * z * (1 - c) + y * s],
            [y * x * (1 - c) + z * s, c + y * y * (1 - c), y * z * (1 - c) - x * s],
            [z * x * (1 - c) - y * s, z * y * (1 - c) + x * s, c + z * z * (1 - c)]]


def of_quaternion(w, x, y, z):
    return turn([x, y, z], 2 * math.atan2(math.sqrt(x * x + y * y + z * z),
                                          w)) if x or y or z else turn([0, 0, 1], 0)


# ---- the robot, from its file ----
text = open(source + "/config/robots/walkman.yaml").read()
numbers = lambda s: [float(x) for x in s.split(",")]
section = lambda name: re.search(rf"^{name}:\n(.*?)(?=^\w)", text, re.M | re.S).group(1)
mass, com = {}, {}
for item in re.split(r"^  - name: ", section("bodies"), flags=re.M)[1:]:
    name = item.split()[0]
    mass[name] = float(re.search(r"mass_kg: (\S+)", item).group(1))
    com[name] = numbers(re.search(r"com_m: \[(.*?)\]", item).group(1))
joints = []
for item in re.split(r"^  - name: ", section("joints"), flags=re.M)[1:]:
    rpy = re.search(r"rpy_rad: \[(.*?)\]", item)
    yaw = numbers(rpy.group(1))[2] if rpy else 0.0  # no other turn is in the file
    joints.append((item.split()[0],
                   *(re.search(rf"{key}: (\w+)", item).group(1) for key in ("parent", "child")),
                   numbers(re.search(r"axis: \[(.*?)\]", item).group(1)),
                   numbers(re.search(r"xyz_m: \[(.*?)\]", item).group(1)), turn([0, 0, 1], yaw)))
TOTAL = sum(mass.values())
WEIGHT = TOTAL * G
DISTAL = {}
for item in re.split(r"^  - name: ", section("ft_sensors"), flags=re.M)[1:]:
    xx, xy, xz, yy, yz, zz = numbers(re.search(r"inertia_kg_m2: \[(.*?)\]", item).group(1))
    DISTAL[item.split()[0]] = (float(re.search(r"mass_kg: (\S+)", item).group(1)),
                               numbers(re.search(r"com_m: \[(.*?)\]", item).group(1)),
                               [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
SENSOR = numbers(re.search(r"name: r_leg_ft, body: RFoot, xyz_m: \[(.*?)\]", text).group(1))


def place(row):
    """Origin and orientation of each body; point and axis of each joint."""
    where = {"Waist": ([row["base_x_m"], row["base_y_m"], row["base_z_m"]],
                       of_quaternion(*(row["base_q" + c] for c in "wxyz")))}
    axes = {}
    for name, parent, child, axis, xyz, fixed in joints:
        p, R = where[parent]
        p, R = add(p, apply(R, xyz)), times(R, fixed)
        axes[name] = (p, apply(R, axis))
        where[child] = (p, times(R, turn(axis, row[f"q_{name}_rad"])))
    return where, axes


def centre_of(where, body):
    return add(where[body][0], apply(where[body][1], com[body]))


def centre_of_mass(where):
    total = [0.0, 0.0, 0.0]
    for body in mass:
        total = add(total, centre_of(where, body), mass[body] / TOTAL)
    return total


def knee_torque(where, axes):
    """Statics of what is above the right knee: half the robot less both shanks and feet, borne by a
    vertical force through the whole-body center of mass under the right foot."""
    p, axis = axes["RKneeSag"]
    moment = [0.0, 0.0, 0.0]
    for body in ("RLowLeg", "RFootmot", "RFoot"):
        moment = add(moment, cross(add(centre_of(where, body), p, -1), [0, 0, -mass[body] * G]))
    under = [centre_of_mass(where)[0], where["RFoot"][0][1], 0.0]
    moment = add(moment, cross(add(under, p, -1), [0, 0, WEIGHT / 2]))
    return -dot(moment, axis)


def reference(t):
    """Joint angles of the hips straight above the ankles at the height of t, from the law of
    cosines."""
    top = math.sqrt(THIGH ** 2 + SHANK ** 2 + 2 * THIGH * SHANK * math.cos(1.0018557101334753))
    down = DEPTH / 2 * (1 - math.cos(2 * math.pi * t / PERIOD)) if 0 < t < PERIOD * CYCLES else 0.0
    H = top - down
    knee = math.pi - math.acos((THIGH ** 2 + SHANK ** 2 - H * H) / (2 * THIGH * SHANK))
    return -math.asin(SHANK * math.sin(knee) / H), knee


# ---- what was recorded ----
print("1..13")
for clock in ("free", "lockstep"):
    status = open(f"{work}/{clock}.status").read().strip()
    said = [line for line in open(f"{work}/{clock}.out").read().splitlines()
            if line.startswith("task squat")]
    check(status == "0" and said, f"four cycles are done in {clock}, the status is 0",
          f"status {status}, {said}")


def lines(clock):
    try:
        with open(f"{work}/{clock}/signals.csv") as file:
            return file.read().split("\n")[:-1]
    except OSError:
        return []


raw = lines("free")
if len(raw) < 30000:
    sys.exit("no whole recording")
title = raw.pop(0).split(",")
parse = lambda line: dict(zip(title, map(float, line.split(","))))
start = next(i for i, line in enumerate(raw)
             if float(line.split(",")[title.index("voltage_RKneeSag_v")]) != 0)
begin = 0.001 * (start + 1) + 2.0  # the controller stands for two seconds first
rows = [parse(line) for line in raw[9::10]]
same = lines("lockstep")[1:]
check(same == raw[9::10][:len(same)] and len(same) > 3000,
      "lockstep goes the same way, to the last digit",
      f"{len(same)} rows")

squat = [r for r in rows if begin <= r["time_s"] < begin + PERIOD * CYCLES]
stand = [r for r in rows if r["time_s"] >= begin + PERIOD * CYCLES + 0.3]
height = {"t": [], "z": []}
for r in squat:
    lean = r["q_RHipSag_rad"] + r["q_RKneeSag_rad"] + r["q_RAnkSag_rad"]
    height["t"].append(r["time_s"] - begin)
    height["z"].append(THIGH * math.cos(r["q_RKneeSag_rad"] + r["q_RAnkSag_rad"]) +
                       SHANK * math.cos(r["q_RAnkSag_rad"]))
depths = []
for cycle in range(CYCLES):
    one = [z for t, z in zip(height["t"], height["z"])
           if cycle * PERIOD <= t < (cycle + 1) * PERIOD]
    depths.append(max(one) - min(one))
check(all(abs(d - DEPTH) < 0.01 for d in depths),
      "by the link encoders the hips sink by 30 cm within 1 cm, each time",
      " ".join(f"{1e3 * d:.1f} mm" for d in depths))

errors = [r["q_RHipSag_rad"] - reference(r["time_s"] - begin)[0] for r in squat]
rms = math.sqrt(sum(e * e for e in errors) / len(errors))
check(rms < 0.015 and max(map(abs, errors)) < 0.03, "the hip tracks its reference",
      f"{1e3 * rms:.1f} mrad RMS, {1e3 * max(map(abs, errors)):.1f} mrad at most")

tilt = [math.asin(2 * (r["base_qw"] * r["base_qy"] - r["base_qx"] * r["base_qz"])) for r in squat +
        stand]
move = max(math.hypot(r["base_x_m"] - squat[0]["base_x_m"], r["base_y_m"] - squat[0]["base_y_m"])
           for r in squat)
check(max(map(abs, tilt)) < 0.05 and move < 0.05, "the trunk stays upright and in its place",
      f"{max(map(abs, tilt)):.3f} rad, {1e3 * move:.1f} mm")

# ---- against statics and Newton ----
static = [knee_torque(*place(r)) for r in squat[::10]]
found = [r["torque_RKneeSag_nm"] for r in squat[::10]]
away = math.sqrt(sum((a - b) ** 2 for a, b in zip(static, found)) / len(found))
check(away < 0.02 * max(map(abs, static)),
      "the knee's torque is that of statics within 2 % of its peak (RMS)",
      f"{away:.2f} N m RMS; from {max(found):.1f} to {min(found):.1f} N m, "
      f"statics {max(static):.1f} to {min(static):.1f}")

feet = lambda r: r["fz_RFoot_n"] + r["fz_LFoot_n"]
mean = sum(map(feet, stand)) / len(stand)
check(abs(mean - WEIGHT) < 0.005 * WEIGHT, "standing, the ground carries the weight",
      f"{mean:.2f} N of {WEIGHT:.2f} N")

# over a window of two times `half` the second difference of the center of mass is its acceleration
# averaged with a triangle's weights, exactly; the force is averaged with the same
half, worst, largest = 25, 0.0, 0.0
whole = [r for r in rows if begin - 1 <= r["time_s"]]
z = [centre_of_mass(place(r)[0])[2] for r in whole]
for i in range(half, len(whole) - half, 5):
    acceleration = (z[i + half] - 2 * z[i] + z[i - half]) / (0.01 * half) ** 2
    force = sum(feet(whole[i + k]) * (half - abs(k)) for k in range(-half, half + 1)) / half ** 2
    worst = max(worst, abs(force - TOTAL * (G + acceleration)))
    largest = max(largest, abs(force - WEIGHT))
check(worst < 0.001 * WEIGHT,
      "moving, it is m (g + a) of the center of mass within a thousandth of the weight",
      f"{worst:.3f} N off at most, where m a is up to {largest:.2f} N")

# ---- against exact steps ----
exact = lines("exact")[1:]
if len(exact) < 6000:
    sys.exit("no exact recording")
pairs = [(parse(a), parse(b)) for a, b in zip(raw[200::10], exact[200::10])]
worst = max(math.sqrt(sum((a[k] - b[k]) ** 2 for a, b in pairs) / len(pairs)) for k in title
            if k.startswith("q_"))
off = math.sqrt(sum((feet(a) - feet(b)) ** 2 for a, b in pairs) / sum(feet(b) ** 2 for _,
                                                                      b in pairs))
check(worst < 2e-3 and off < 0.02,
      "steps of a millisecond err by less than 2 mrad and 2 % of the feet's force (RMS)",
      f"{len(pairs)} rows: worst joint {worst:.1e} rad, force {100 * off:.2f} %")


# ---- what the boards say ----
FULL_N, FULL_NM, KNEE_NM = 2000.0, 200.0, 250.0


def said_on(clock, bus, *ids):
    """Counts of three channels by id and ms."""
    found = {id: {} for id in ids}
    for line in open(f"{work}/{clock}/candump.log"):
        stamp, name, frame = line.split()[:3]
        if name == bus and frame[:3] in found:
            data = bytes.fromhex(frame[4:])
            found[frame[:3]][round(float(stamp[1:-1]) * 1e3)] = [
                int.from_bytes(data[k:k + 2], "little") - 32768 for k in (0, 2, 4)]
    return found


# the wrench that the state has, moved to the sensor, less what hangs below it takes: weight and
# inertia, with accelerations by differences over 2 ms, good enough when the first swaying is over
frames = said_on("exact", "can2", "3EA", "3EB")
sensor_mass, sensor_com, sensor_inertia = DISTAL["r_leg_ft"]
worst_n = worst_nm = 0.0
compared = 0
for ms in sorted(frames["3EA"])[::3]:
    if ms < 3000 or ms not in frames["3EB"] or ms >= len(exact):
        continue
    r = parse(exact[ms - 1])
    (p0, R0), (p, R), (p1, R1) = (place(parse(exact[k]))[0]["RFoot"] for k in (ms - 2, ms - 1, ms))
    hung = add(SENSOR, sensor_com)
    back = transposed(R)
    path = [add(a, apply(B, hung)) for a, B in ((p0, R0), (p, R), (p1, R1))]
    acceleration = [(a - 2 * b + c) * 1e6 for a, b, c in zip(*path)]
    spins = [times(R, transposed(R0)), times(R1, back)]
    rates = [[(T[2][1] - T[1][2]) * 500, (T[0][2] - T[2][0]) * 500, (T[1][0] - T[0][1]) * 500]
             for T in spins]
    angular = apply(back, [(b - a) * 1e3 for a, b in zip(*rates)])
    force = [r[f"f{c}_RFoot_n"] for c in "xyz"]
    moment = add([r[f"m{c}_RFoot_nm"] for c in "xyz"], cross(apply(R, SENSOR), force), -1)
    takes = apply(back, [-sensor_mass * a for a in add([0, 0, G], acceleration)])
    force, moment = add(apply(back, force), takes), add(apply(back, moment),
                                                        cross(sensor_com, takes))
    moment = add(moment, apply(sensor_inertia, angular), -1)
    for k in range(3):
        worst_n = max(worst_n, abs(frames["3EA"][ms][k] * FULL_N / 32768 - force[k]))
        worst_nm = max(worst_nm, abs(frames["3EB"][ms][k] * FULL_NM / 32768 - moment[k]))
    compared += 1
check(compared > 100 and worst_n < FULL_N / 32768 and worst_nm < FULL_NM / 32768,
      "F/T frames are the ground's wrench moved to the sensor, less what hangs below it, "
      "within one count",
      f"{compared} frames, {worst_n:.4f} N of {FULL_N / 32768:.4f}, "
      f"{worst_nm:.5f} N m of {FULL_NM / 32768:.5f}")

vertical = [said_on("free", bus, id)[id] for bus, id in (("can1", "3DA"), ("can2", "3EA"))]
off = [(vertical[0][ms][2] + vertical[1][ms][2]) * FULL_N / 32768 -
       (feet(parse(raw[ms - 1])) - 2 * sensor_mass * G)
       for ms in sorted(vertical[0])[::5] if 1000 < ms <= len(raw) and ms in vertical[1]]
check(len(off) > 300 and max(map(abs, off)) < 0.001 * WEIGHT,
      "through the squat the F/T boards' vertical forces are the feet's less 4.46 kg, "
      "within a thousandth of the weight",
      f"{len(off)} frames, {max(map(abs, off)):.3f} N at most")

knee = said_on("free", "can2",
               "3BB")["3BB"]  # the fourth joint of the board is its second frame's first channel
off = [knee[ms][0] * KNEE_NM / 32768 - parse(raw[ms - 1])["torque_RKneeSag_nm"]
       for ms in sorted(knee)[::25] if ms > 100]
check(len(off) > 100 and max(map(abs, off)) < KNEE_NM / 32768,
      "the knee's torque frames are its spring's torque, within one count",
      f"{len(off)} frames, {max(map(abs, off)):.5f} N m of {KNEE_NM / 32768:.5f}")
END
