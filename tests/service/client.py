#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""The client for controllers as its users have it: installed and copied, examples in C and in C++
for ROS 2 that are built with it and run twice against simulators of each protocol, the same frames
each time, and the same state as the Python package makes with the same controller. ROS 2 is not
installed here: the hardware interface is compiled against stand-in headers. A joint of each
protocol by name, with each kind of set point, a fault and a command that is dropped. Prints TAP.

client.py CMAKE PROGRAM CLIENT_JOINTS"""
import json
import logging
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as xml

from ready import wait_until_ready
from tap import result
import tap

CMAKE, PROGRAM, JOINTS_OF = sys.argv[1], os.path.abspath(sys.argv[2]), sys.argv[3]
SOURCE = pathlib.Path(os.environ["HIL_SOURCE_DIR"])
BUILD = os.environ["HIL_BINARY_DIR"]
WORK = pathlib.Path(tempfile.mkdtemp(prefix="coman-hil-client-"))
PREFIX = WORK / "prefix"
PATIENCE_S = 120
RIGS = ("coman", "coman-foc", "coman-compact", "coman-fd")
# the robot on a stand that holds its pelvis, nothing held, nothing near
BENCH = {"robot": {"fixed_base": True}, "scene": {"engine": "none"}, "initial": {"hold": "none"}}
JOINTS = ["LElbj", "RElbj"]
WARNINGS = "-std=c11 -Wall -Wextra -Wpedantic -Werror"
ROS2 = SOURCE / "examples" / "ros2_control"
# version of the package hardware_interface by ROS 2 release (ros2_stand_in.hpp)
ROS2_VERSIONS = {"Humble": "254", "Jazzy": "446", "Kilted": "516", "Lyrical": "608"}


def run(*command, **keys):
    """Ends with what a command said when it does not succeed."""
    done = subprocess.run([str(word) for word in command], stdin=subprocess.DEVNULL, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=PATIENCE_S,
                          **keys)
    if done.returncode:
        raise AssertionError(f"{command} ended with {done.returncode}: {done.stdout}")
    return done.stdout


class Simulator:
    """A run of a rig, in lockstep or as clock says, with its tables. changes: keys of the rig."""

    def __init__(self, rig, *options, changes=None, clock="lockstep", protocol=""):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix=rig, dir=WORK))
        file = self.folder / "rig.yaml"
        (self.folder / "checked.yaml").write_text(protocol)
        file.write_text(json.dumps({"extends": rig, **BENCH, **(changes or {})}))
        self.ready = self.folder / "ready"
        self.control = self.folder / "control"
        self.log = open(self.folder / "log", "w+")
        self.process = subprocess.Popen(
            [PROGRAM, "run", file, "--transport", "local", "--gateway", "0", "--quiet",
             "--ready", self.ready, "--control", self.control, "--clock", clock, *options],
            cwd=self.folder, stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log)

    def wait(self):
        wait_until_ready(str(self.ready), self.process, PATIENCE_S,
                         (self.folder / "log").read_text)

    def frames(self):
        """All that was on the buses until the last DONE, in one order."""
        lines = (self.folder / "record" / "candump.log").read_text().splitlines()
        last = max(line.split()[0] for line in lines if " 6FF#" in line)
        return sorted(line for line in lines if line.split()[0] <= last)

    def end(self):
        if self.process.poll() is None:
            self.process.terminate()
        return self.process.wait(PATIENCE_S)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()


def build():
    """Installs the client, and builds the examples in each way. The path of each program."""
    run(CMAKE, "--install", BUILD, "--prefix", PREFIX, "--component", "client")
    library = next(PREFIX.rglob("libcoman-hil-client.a")).parent
    environment = dict(os.environ, PKG_CONFIG_PATH=str(library / "pkgconfig"))
    c = shutil.copytree(SOURCE / "examples" / "controller-c", WORK / "c")
    copied = shutil.copytree(c, WORK / "copied")
    copy = WORK / "copy"
    copy.mkdir()
    for name in ("coman_hil_client.c", "coman_hil_client.h"):
        shutil.copy(SOURCE / "client" / name, copy)
    run("make", "-C", c, env=environment)
    run("make", "-C", copied, f"COPY={copy}", f"CFLAGS=-O2 {WARNINGS}")
    return {"installed": c / "elbow", "copied": copied / "elbow", **build_ros2()}


def build_ros2():
    """Builds the hardware interface and a stand-in for its manager against the headers of each
    release of ROS 2; returns the programs by release."""
    folder = WORK / "ros2"
    sources = [*(ROS2 / "src").glob("*.cpp"), *(ROS2 / "include").rglob("*.hpp")]
    for name in re.findall(r"^#include [<\"](\w+/[\w/]+\.h(?:pp)?)", "".join(
            path.read_text() for path in sources), re.M):
        if not (ROS2 / "include" / name).exists():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text('#include "ros2_stand_in.hpp"\n')
    (folder / "CMakeLists.txt").write_text(f"""cmake_minimum_required(VERSION 3.16)
project(manager LANGUAGES CXX)
find_package(coman-hil-client REQUIRED)
foreach(version {" ".join(ROS2_VERSIONS.values())})
    add_executable(manager${{version}}
        {ROS2}/src/system.cpp {SOURCE}/tests/service/ros2_manager.cpp)
    target_compile_definitions(manager${{version}} PRIVATE STAND_IN_VERSION=${{version}})
    target_compile_features(manager${{version}} PRIVATE cxx_std_17)
    target_compile_options(manager${{version}} PRIVATE -Wall -Wextra -Wpedantic -Werror)
    target_include_directories(manager${{version}} PRIVATE
        {folder} {ROS2}/include {SOURCE}/tests/service)
    target_link_libraries(manager${{version}} PRIVATE coman-hil::client)
endforeach()
""")
    run(CMAKE, "-S", folder, "-B", folder / "build", f"-DCMAKE_PREFIX_PATH={PREFIX}")
    run(CMAKE, "--build", folder / "build")
    return {name: folder / "build" / f"manager{version}" for name, version in ROS2_VERSIONS.items()}


def test_ros2_files(manager):
    """The files of the package name one another."""
    package = xml.parse(ROS2 / "package.xml").getroot()
    plugin = xml.parse(ROS2 / "coman_hil_ros2.xml").getroot().find("class")
    urdf = xml.parse(ROS2 / "urdf" / "left_arm.urdf").getroot()
    tag = urdf.find("ros2_control")
    cmake = (ROS2 / "CMakeLists.txt").read_text()
    source = (ROS2 / "src" / "system.cpp").read_text()
    names = [package.findtext("name"), re.search(r"^project\((\w+)", cmake, re.M)[1],
             plugin.get("name").split("/")[0], plugin.get("type").split("::")[0]]
    result(len(set(names)) == 1 and tag.findtext("hardware/plugin") == plugin.get("name")
           and f"PLUGINLIB_EXPORT_CLASS({plugin.get('type')}, {plugin.get('base_class_type')})"
           in source, "package, plug-in and tag have the names of the class", names)
    missing = {depend.text for depend in package.findall("depend")} \
        ^ (set(re.findall(r"find_package\((\w+)", cmake)) - {"ament_cmake", "coman"})
    result(not missing, "package.xml has the packages that CMake looks for", missing)
    commands = [joint.get("name") for joint in tag.findall("joint")
                if joint.find("command_interface") is not None]
    wanted = {f"{joint.get('name')}/{interface.get('name')}" for joint in tag.findall("joint")
              for interface in joint if interface.tag.endswith("_interface")}
    exported = set(run(manager, "--interfaces", "ready", *(
        joint.get("name") for joint in tag.findall("joint"))).split())
    result(wanted <= exported, "the hardware exports the interfaces of the tag", wanted - exported)
    moved = re.search(r"joints: \[(.*)\]", (ROS2 / "config" / "controllers.yaml").read_text())[1]
    axes = {joint.get("name") for joint in urdf.findall("joint")}
    result(moved.split(", ") == commands and set(commands) <= axes,
           "the controllers command joints that have a command interface", f"{moved}, {commands}")
    launch = ROS2 / "launch" / "left_arm.launch.py"
    compile(launch.read_text(), launch, "exec")
    tokens = set(re.findall(r"@(\w+)@", (ROS2 / "urdf" / "left_arm.urdf").read_text()))
    result(tokens == {param.get("name") for param in tag.findall("hardware/param")} and
           all(f'"{token}":' in launch.read_text() for token in tokens),
           "the launch file fills in all parameters of the tag", tokens)


def test_ros2_real_time(manager):
    with Simulator("coman-compact", clock="real") as simulator:
        simulator.wait()
        text = run(manager, "--real-time", simulator.ready, *JOINTS)
        result(float(re.search(r"([\d.]+) rad at most", text)[1]) > 0.05,
               "the hardware interface moves joints in real time", text)
    with Simulator("coman-compact", "--fault", "motor LElbj jam 0.1..") as simulator:
        simulator.wait()
        text = refused(manager, simulator.ready, "LElbj")
        result(text.startswith("joint LElbj has tripped"), "it reports a trip", text)


def test_ros2_commands(programs):
    """A controller that has no command, and parameters that are no numbers."""
    for name in ROS2_VERSIONS:
        with Simulator("coman-compact") as simulator:
            simulator.wait()
            text = run(programs[name], "--nan", simulator.ready, *JOINTS)
            result("2.000 s" in text, f"{name}: a controller may write no number", text)
        for ticks in ("4x", "-4", "1001"):
            text = refused("env", f"PERIOD_TICKS={ticks}", programs[name], "none", "LElbj")
            result(f'period_ticks: found "{ticks}", expected a whole number' in text,
                   f"{name}: so says the period {ticks}", text)


def drive_in_python(rig):
    """The state after the controller of examples/controller-c, written in Python."""
    import coman_hil
    with coman_hil.Simulator(rig, program=PROGRAM, changes=BENCH) as sim:
        sim.enable(*JOINTS)
        start = {name: sim.joints[name].motor_position_rad for name in JOINTS}
        for tick in range(0, 1500, 4):
            for name in JOINTS:
                target = start[name] + 0.5 * min(1.0, tick / 1000)
                sim.joints[name].voltage_v = 40.0 * (target - sim.joints[name].motor_position_rad)
            sim.step(4)
        return sim.state_hash()


def state_of(simulator):
    import coman_hil
    with coman_hil.Control(str(simulator.control)) as control:
        return control.state_hash()


def drive(program, rig):
    """What a program says of a run that it controls, its state and its frames."""
    with Simulator(rig, "--record", "record") as simulator:
        simulator.wait()
        text = run(program, simulator.ready, *JOINTS)
        state = state_of(simulator)
        simulator.end()
        return text, state, simulator.frames()


def test_rig(rig, programs):
    runs = {name: drive(program, rig) for name, program in programs.items()}
    text, state, frames = runs["copied"]
    moved = [float(way) for way in re.findall(r"tick +15\d\d  \S+ +(\S+) rad", text)]
    result(len(moved) == 2 and all(abs(way - 0.5) < 0.1 for way in moved),
           f"{rig}: the controller in C moves its joints", text)
    result(runs["installed"] == runs["copied"],
           f"{rig}: {len(frames)} frames of the controller in C are the same again",
           runs["installed"][:2] + runs["copied"][:2])
    result(state == drive_in_python(rig), f"{rig}: so is the state of that in Python")
    humble = runs["Humble"]
    result("2.000 s" in humble[0] and all(runs[name] == humble for name in ROS2_VERSIONS),
           f"{rig}: {len(humble[2])} frames of the hardware for ROS 2 are the same in all releases",
           [runs[name][0] for name in ROS2_VERSIONS])


def refused(program, *arguments):
    """What a program says when it fails, as it should."""
    done = subprocess.run([str(word) for word in (program, *arguments)], text=True,
                          capture_output=True, timeout=PATIENCE_S)
    return done.stderr if done.returncode == 1 else f"status {done.returncode}"


def test_refusals(program):
    with Simulator("coman-compact") as simulator:
        simulator.wait()
        for name, say, arguments in (
                ("no table", "none.joints: No such file", (WORK / "none.joints",)),
                ("an unknown joint", 'no joint "LElb"', (simulator.ready, "LElb"))):
            text = refused(program, *arguments)
            result(say in text, f"{name} is an error that says so", text)
        ready = simulator.folder / "copy"
        shutil.copy(simulator.ready, ready)
        simulator.end()
        text = refused(program, ready)
        result("nobody serves the gateway" in text, "so is a run that is over", text)
    with Simulator("coman-compact", "--duration", "0.5") as simulator:
        simulator.wait()
        text = refused(program, simulator.ready)
        result("the run is over" in text or "closed" in text, "so is one that ends", text)
    with Simulator("coman", "--fault", "motor LElbj jam 0.1..") as simulator:
        simulator.wait()
        text = refused(program, simulator.ready)
        result(text.startswith("elbow: LElbj has tripped: mode hardware_fault, faults 0x8"),
               "so is a motor that trips while steps go on", text)


# by rig: what its boards take; whether they report the link's position, a current and a mode; what
# the rig changes so that loops have gains
PROTOCOLS = {
    "coman": ("voltage current", "link current mode"),
    "coman-foc": ("voltage current", "current mode"),
    "coman-compact": ("voltage current", "link current mode"),
    "coman-fd": ("voltage current", "link current mode"),
    "coman-cia402": ("voltage position velocity torque", "link mode"),
    "coman-moteus": ("position velocity torque", "link mode"),
    "coman-odrive": ("position velocity torque", "current mode"),
    "coman-robstride": ("position velocity torque", "mode"),
    "coman-mini-cheetah": ("position velocity torque", "mode"),
}
POINTS = {"voltage": 3, "current": 0.5, "position": -0.2, "velocity": 1, "torque": 3}
REFUSED = re.compile(r"^refused (\w+): .*(takes no \1|loop of its board has gains of 0)", re.M)


def rows_of(text):
    """What client_joints prints: word, tick, link, motor, velocity, current, torque, faults, on,
    mode."""
    rows = [line.split(" ", 9) for line in text.splitlines() if len(line.split(" ")) >= 9]
    return [(row[0], *map(float, row[1:9]), row[9]) for row in rows if row[1].isdigit()]


def test_protocols():
    """A joint of each protocol by name: enabled, held, moved, read, switched off."""
    for rig, (takes, tells) in PROTOCOLS.items():
        with Simulator(rig) as simulator:
            simulator.wait()
            text = run(JOINTS_OF, simulator.ready, "LElbj",
                       *(f"{quantity}={value}" for quantity, value in POINTS.items()))
            rows, good = rows_of(text), True
            for enabled, moved, off in zip(rows[::3], rows[1::3], rows[2::3]):
                way = moved[3] - enabled[3]
                good = good and enabled[8] and moved[8] and (not off[8] or rig == "coman-foc")
                good = good and 0.01 < way * (-1 if moved[0] == "position" else 1) < 1.2
                good = good and abs(enabled[3] + 1.57) < 0.5 and moved[7] == 0
                good = good and ("link" in tells) == (abs(moved[2] - moved[3]) < 0.02)
                good = good and ("current" in tells) == (moved[5] == moved[5])
                good = good and moved[9] != ""
            result(good and [row[0] for row in rows[1::3]] == takes.split() or
                   sorted(row[0] for row in rows[1::3]) == sorted(takes.split()) and good,
                   f"{rig}: {takes} move a joint by its name in C", text)
            refused_here = {match[0] for match in REFUSED.findall(text)}
            result(refused_here == set(POINTS) - set(takes.split()) and "dropped 0 \n" in text,
                   f"{rig}: the others are refused", text)
    for rig, point, at_s in (("coman-cia402", "voltage", 0.3), ("coman-moteus", "torque", 0.1),
                             ("coman-odrive", "torque", 0.1)):
        with Simulator(rig, "--fault", f"supply sag 47 {at_s}..") as simulator:
            simulator.wait()
            text = run(JOINTS_OF, simulator.ready, "LElbj", *(f"{point}=0" for _ in range(4)))
            faults = [row for row in rows_of(text) if row[0] == point and row[7] and not row[8]]
            result(faults and "tripped 1" in text and
                   re.search(r"LElbj does not switch on: mode \"\w+\", faults 0x[1-9a-f]", text),
                   f"{rig}: a fault is read by the joint's name", text)


DESCRIBED = """
name: checked
axes: 2
states:
  - {name: idle, value: 0, law: "off"}
  - {name: run, value: 1, law: torque}
  - {name: broken, value: 2, law: fault}
faults: {over_current: {bit: 0}, stale: {bit: 1}}
frames:
  - name: SWITCH
    from: host
    id: 0x100
    by: address
    reply: STATUS
    fields:
      - {name: axis, bits: 8, target: axis}
      - {name: state, bits: 8, target: state}
  - name: SET
    from: host
    extended: true
    id: 0x2000
    by: address
    fields:
      - {name: kind, bits: 8, value: 0x5a}
      - {name: axis, bits: 4, target: axis}
      - {name: number, bits: 4, counter: true}
      - {name: torque, bits: 16, type: signed, order: big, target: torque, scale: 0.01}
      - {name: sum, bits: 8, checksum: crc8_sae_j1850}
  - name: STATUS
    from: board
    id: 0x300
    by: slot
    period_s: 0.002
    on_change: true
    fields:
      - {name: state, bits: 8, source: state}
      - {name: faults, bits: 8, source: faults}
      - {name: position, bits: 32, type: signed, source: motor_position, scale: 1.0e-5}
host:
  "off": [SWITCH]
  "on": [SWITCH]
  command: [SET]
"""


def test_described():
    """A protocol of a user's file with constant, counter, checksum and big-endian torque."""
    buses = [{"name": "arm", "interface": "can0", "boards": [
        {"kind": "motor", "address": 3, "axes": ["LShSag", "LElbj"]}]}]
    changes = {"personality": "described", "protocol": "checked.yaml", "buses": buses,
               "lockstep": {"bus": "arm"}, "undriven": [
                   "WaistLat", "WaistSag", "WaistYaw", "LShLat", "LShYaw", "RShSag", "RShLat",
                   "RShYaw", "RElbj", *(side + joint for side in "LR" for joint in (
                       "HipSag", "HipLat", "HipYaw", "KneeSag", "AnkLat", "AnkSag"))]}
    with Simulator("coman-described", changes=changes, protocol=DESCRIBED) as simulator:
        simulator.wait()
        text = run(JOINTS_OF, simulator.ready, "LElbj", "torque=3", "voltage=1",
                   "arm,arm_0x03_SET,torque,1")
        rows = rows_of(text)
        result(len(rows) == 3 and 0.01 < rows[1][3] - rows[0][3] < 1.2 and "dropped 0 \n" in text
               and "takes no voltage" in text,
               "a joint of a user's protocol, whose frames have a counter and a checksum", text)
        text = run(JOINTS_OF, simulator.ready, "LElbj", "arm,arm_0x03_SET,sum,3")
        result(re.search(r"^dropped 1 .*frame SET \(id 0x2003\): checksum is 0x03, expected", text,
                         re.M), "the run tells the command that a board dropped, and why", text)


def main():
    sys.path.insert(0, str(SOURCE / "python"))
    try:
        programs = build()
        result(True, "the examples are built with what is installed, and with two copied files")
        for rig in RIGS:
            test_rig(rig, programs)
        for name in ("Humble", "Lyrical"):
            test_ros2_files(programs[name])
            test_ros2_real_time(programs[name])
        test_ros2_commands(programs)
        test_protocols()
        test_described()
        test_refusals(programs["copied"])
    except (AssertionError, subprocess.TimeoutExpired) as error:
        result(False, "everything ends well", error)
    print(f"1..{tap.number}")
    sys.exit(tap.failed > 0)


logging.getLogger("canmatrix").setLevel(logging.CRITICAL)    # formats that it cannot read
try:
    import can          # of the Python package
    import canmatrix    # likewise
except ImportError as missing:
    print(f"1..0 # SKIP {missing} (Debian packages python3-can, python3-canmatrix)")
    sys.exit(0)
try:
    main()
finally:
    shutil.rmtree(WORK)
