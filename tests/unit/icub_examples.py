#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The files of examples/icub against the rig and the robot that they are for: every number that
yarprobotinterface takes from them, with factors from the protocol. Prints TAP."""
import math
import os
import pathlib
import re
import sys
import xml.etree.ElementTree as ElementTree

ROOT = pathlib.Path(os.environ.get("HIL_SOURCE_DIR") or pathlib.Path(__file__).parents[2])
FILES = ROOT / "examples" / "icub"
RIG = (ROOT / "config" / "rigs" / "coman.yaml").read_text()
ROBOT = (ROOT / "config" / "robots" / "coman.yaml").read_text()
PWM_FULL_SCALE = 1333  # of a BLL board, 100 % of the supply
INCLUDE = "{http://www.w3.org/2001/XInclude}include"
failures = 0
count = 0


def result(good, name, why=""):
    global failures, count
    count += 1
    failures += not good
    print(f"{'ok' if good else 'not ok'} {count} - {name}")
    if not good and why:
        print("# " + str(why).replace("\n", "\n# "))


def rig_number(key):
    return float(re.search(rf"^  {key}: +([\d.]+)", RIG, re.M)[1])


def rig_buses():
    """Name, number of the interface and boards of each bus; a board is a mapping in braces."""
    text = RIG[RIG.index("\nbuses:\n"):RIG.index("\nlockstep:\n")]
    for name, interface, boards in re.findall(
            r"- name: (\w+)\n +interface: can(\d+)\n +boards:\n((?: +[-a-z].*\n)+)", text):
        yield {"name": name, "interface": int(interface), "boards": [
            {"kind": re.search(r"kind: (\w+)", board)[1],
             "address": int(re.search(r"address: (\w+)", board)[1], 0),
             "names": re.findall(r"\w+", (re.search(r"(?:axes|joints): \[(.*?)\]", board)
                                          or ["", ""])[1]),
             "sensor": (re.search(r"sensor: (\w+)", board) or ["", ""])[1],
             "period_s": float((re.search(r"period_s: ([\d.]+)", board) or ["", "0"])[1])}
            for board in re.findall(r"\{([^}]*)\}", boards)]}


def joint_limits(joint):
    """Lower and upper limit in rad."""
    text = ROBOT[ROBOT.index(f"  - name: {joint}\n    paper_index:"):]
    return [float(number) for number in
            re.search(r"limits: \{lower_rad: ([-\d.]+), upper_rad: ([-\d.]+),", text).groups()]


def values(device, name):
    """The list that a parameter is; GROUP/NAME of a group, else in whatever group."""
    group, _, name = name.rpartition("/")
    within = [g for g in device.iter("group") if g.get("name") == group] if group else [device]
    found = [p for place in within for p in place.iter("param") if p.get("name") == name]
    assert len(found) == 1, f"{len(found)} parameters {name}"
    return found[0].text.split()


def numbers(device, name):
    return [float(text) if "x" not in text else int(text, 16) for text in values(device, name)]


def near(found, expected, digits=6):
    """Written with so many digits."""
    return abs(found - expected) <= 0.5 * 10 ** (math.floor(math.log10(expected)) + 1 - digits)


def motor_complaints(device, bus):
    boards = [b for b in bus["boards"] if b["kind"] == "motor"]
    torque = next(b for b in bus["boards"] if b["kind"] == "torque")
    axes = [axis for board in boards for axis in board["names"]]
    same = {  # what each axis must have
        "fullscalePWM": PWM_FULL_SCALE,
        "ampsToSensor": 1000,  # mA
        "TorqueMax": rig_number("torque_full_scale_nm"),
        "motorOverloadCurrents": rig_number("current_limit_a") * 1000,
        "motorPwmLimit": PWM_FULL_SCALE, "Shifts": 8, "Zeros": 0,
        "POS_PIDS/kp": 600, "POS_PIDS/kd": 1000, "POS_PIDS/ki": 0, "POS_PIDS/shift": 8,
        "TRQ_PIDS/kp": 80, "TRQ_PIDS/kd": 0, "TRQ_PIDS/ki": 0, "TRQ_PIDS/shift": 8,
        **{f"{group}/{name}": value for group in ("POS_PIDS", "TRQ_PIDS") for name, value in
           (("maxOutput", PWM_FULL_SCALE), ("maxInt", PWM_FULL_SCALE), ("ko", 0),
            ("stictionUp", 0), ("stictionDwn", 0))},
        "IMPEDANCE/stiffness": 1, "IMPEDANCE/damping": 0.01,
        "broadcast_pos": 1, "broadcast_fault": 1, "broadcast_canprint": 1,
        "broadcast_rotor_pos": 1}

    if numbers(device, "CanDeviceNum") != [bus["interface"]]:
        yield "CanDeviceNum"
    if numbers(device, "CanAddresses") != [board["address"] for board in boards]:
        yield "CanAddresses"
    if numbers(device, "Joints") != [len(axes)] or values(device, "AxisName") != axes:
        yield "Joints or AxisName"
    if numbers(device, "AxisMap") != list(range(len(axes))):
        yield "AxisMap"
    for name, value in same.items():
        if numbers(device, name) != [value] * len(axes):
            yield f"{name} is not {value} for each axis"
    if not all(near(ticks, rig_number("joint_ticks_per_rev") / 360)
               for ticks in numbers(device, "Encoder")):
        yield "Encoder"
    if not all(near(ticks, rig_number("motor_ticks_per_link_rev") / 360)
               for ticks in numbers(device, "Rotor")):
        yield "Rotor"

    # Axis by axis: where its torque comes from, and its limits, which the host's must not leave
    for i, axis in enumerate(axes):
        if axis == "spare":
            continue
        lower, upper = joint_limits(axis)
        if numbers(device, "TorqueId")[i] != torque["address"]:
            yield f"TorqueId of {axis}"
        if torque["names"][int(numbers(device, "TorqueChan")[i])] != axis:
            yield f"TorqueChan of {axis}"
        low, high = (math.radians(numbers(device, name)[i]) for name in ("jntPosMin", "jntPosMax"))
        if not 0 <= low - lower < math.radians(0.2) or \
                not 0 <= upper - high < math.radians(0.2):
            yield f"limits of {axis}"


def sensor_complaints(device, bus, board):
    if numbers(device, "canDeviceNum") != [bus["interface"]]:
        yield "canDeviceNum"
    if numbers(device, "canAddress") != [board["address"]]:
        yield "canAddress"
    if numbers(device, "period") != [board["period_s"] * 1000] or \
            numbers(device, "channels") != [6] or numbers(device, "useCalibration") != [1]:
        yield "period, channels or useCalibration"


def limb_complaints(bus):
    limb = bus["name"]
    devices = {d.get("name"): d
               for d in ElementTree.parse(FILES / f"{limb}.xml").getroot().iter("device")}
    yield from motor_complaints(devices[f"{limb}_mc"], bus)
    for board in bus["boards"]:
        if board["kind"] != "motor":
            name = board["sensor"] if board["kind"] == "ft" else f"{limb}_torque"
            yield from sensor_complaints(devices[name], bus, board)

    # What serves the joints maps the real ones, which come first
    joints = sum(axis != "spare" for board in bus["boards"] if board["kind"] == "motor"
                 for axis in board["names"])
    remapper = devices[f"{limb}_remapper"]
    if numbers(remapper, "joints") != [joints] or \
            remapper.find("paramlist/elem").text != f"(0 {joints - 1} 0 {joints - 1})":
        yield "the remapper"


def included(name):
    return [element.get("href") for element in ElementTree.parse(FILES / name).iter(INCLUDE)]


buses = list(rig_buses())
print("1..8")
for each in buses:
    complaints = list(limb_complaints(each))
    result(not complaints, f"{each['name']}.xml is that limb of the rig", "\n".join(complaints))
# YARP takes a href without a folder for a folder of that name
result(included("coman.xml") == [f"./{bus['name']}.xml" for bus in buses],
       "coman.xml has all limbs")
result(included("one-leg.xml") == ["./left_leg.xml"], "one-leg.xml has a leg")
calibrator = ElementTree.parse(FILES / "left_leg_calibrator.xml").getroot()
result(numbers(calibrator, "calibrationType") == [3] * 6
       and 0 not in numbers(calibrator, "calibration2")
       and numbers(calibrator, "calibration3") == [0] * 6, "left_leg_calibrator.xml calibrates")
sys.exit(failures > 0)
