#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""The client for controllers as its users have it: installed and copied, examples in C and in C++
for ROS 2 that are built with it and run twice against simulators of each protocol, the same frames
each time, and the same state as the Python package makes with the same controller. ROS 2 is not
installed here: the hardware interface is compiled against stand-in headers. Prints TAP.

client.py CMAKE PROGRAM"""
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

CMAKE, PROGRAM = sys.argv[1], os.path.abspath(sys.argv[2])
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

    def __init__(self, rig, *options, changes=None, clock="lockstep"):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix=rig, dir=WORK))
        self.tables = self.folder / "tables"
        self.tables.mkdir()
        file = self.folder / "rig.yaml"
        file.write_text(json.dumps({"extends": rig, **BENCH, **(changes or {})}))
        run(PROGRAM, "dbc", file, "-o", self.tables)
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
    return {"installed": c / "elbow", "copied": copied / "elbow", "ROS 2": build_ros2()}


def build_ros2():
    """Builds the hardware interface and a stand-in for its manager; returns the program."""
    folder = WORK / "ros2"
    sources = [*(ROS2 / "src").glob("*.cpp"), *(ROS2 / "include").rglob("*.hpp")]
    for name in re.findall(r"^#include [<\"](\w+/[\w/]+\.hpp)", "".join(
            path.read_text() for path in sources), re.M):
        if not (ROS2 / "include" / name).exists():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text('#include "ros2_stand_in.hpp"\n')
    (folder / "CMakeLists.txt").write_text(f"""cmake_minimum_required(VERSION 3.16)
project(manager LANGUAGES CXX)
find_package(coman-hil-client REQUIRED)
add_executable(manager {ROS2}/src/system.cpp {SOURCE}/tests/service/ros2_manager.cpp)
target_compile_features(manager PRIVATE cxx_std_17)
target_compile_options(manager PRIVATE -Wall -Wextra -Wpedantic -Werror)
target_include_directories(manager PRIVATE {folder} {ROS2}/include {SOURCE}/tests/service)
target_link_libraries(manager PRIVATE coman-hil::client)
""")
    run(CMAKE, "-S", folder, "-B", folder / "build", f"-DCMAKE_PREFIX_PATH={PREFIX}")
    run(CMAKE, "--build", folder / "build")
    return folder / "build" / "manager"


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
    exported = set(run(manager, "--interfaces", "tables", "ready", *(
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
        text = run(manager, "--real-time", simulator.tables, simulator.ready, *JOINTS)
        result(float(re.search(r"([\d.]+) rad at most", text)[1]) > 0.05,
               "the hardware interface moves joints in real time", text)
    with Simulator("coman-compact", "--fault", "motor LElbj jam 0.1..") as simulator:
        simulator.wait()
        text = refused(manager, simulator.tables, simulator.ready, "LElbj")
        result(text.startswith("joint LElbj has tripped"), "it reports a trip", text)


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
        text = run(program, simulator.tables, simulator.ready, *JOINTS)
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
    again = drive(programs["ROS 2"], rig)
    result(again == runs["ROS 2"] and "2.000 s" in again[0],
           f"{rig}: {len(again[2])} frames of the hardware for ROS 2 are the same again", again[0])


def refused(program, *arguments):
    """What a program says when it fails, as it should."""
    done = subprocess.run([str(word) for word in (program, *arguments)], text=True,
                          capture_output=True, timeout=PATIENCE_S)
    return done.stderr if done.returncode == 1 else f"status {done.returncode}"


def test_refusals(program):
    with Simulator("coman-compact") as simulator:
        simulator.wait()
        for name, say, arguments in (
                ("a folder without tables", "found no file of", (WORK, simulator.ready)),
                ("no folder", "No such file", (WORK / "none", simulator.ready)),
                ("an unknown joint", 'no joint "LElb"',
                 (simulator.tables, simulator.ready, "LElb"))):
            text = refused(program, *arguments)
            result(say in text, f"{name} is an error that says so", text)
        ready = simulator.folder / "copy"
        shutil.copy(simulator.ready, ready)
        simulator.end()
        text = refused(program, simulator.tables, ready)
        result("nobody serves the gateway" in text, "so is a run that is over", text)
    with Simulator("coman-compact", "--duration", "0.5") as simulator:
        simulator.wait()
        text = refused(program, simulator.tables, simulator.ready)
        result("the run is over" in text or "closed" in text, "so is one that ends", text)
    with Simulator("coman", "--fault", "motor LElbj jam 0.1..") as simulator:
        simulator.wait()
        text = refused(program, simulator.tables, simulator.ready)
        result(text.startswith("elbow: LElbj has tripped: mode hardware_fault, faults 0x8"),
               "so is a motor that trips while steps go on", text)


def hash_of(data):
    """FNV-1a of 64 bits."""
    value = 0xcbf29ce484222325
    for byte in data:
        value = (value ^ byte) * 0x100000001b3 % 2 ** 64
    return f"{value:016x}"


def test_tables(program):
    """Tables that were written before the rig changed."""
    assert hash_of(b"foobar") == "85944171f73967e8"     # of the authors' list
    with Simulator("coman") as simulator:
        simulator.wait()
        words = dict(word.split("=", 1) for word in shlex.split(simulator.ready.read_text()))
        hashes = dict(word.split("=") for word in words["tables"].split())
        expected = {path.stem.split("-", 1)[1]: hash_of(path.read_bytes())
                    for path in simulator.tables.iterdir()}
        result(hashes == expected, f"the file of --ready has the hashes of {len(expected)} tables",
               f"{hashes}, expected {expected}")
        text = refused(program, simulator.tables, simulator.ready, "LElbj")
        result(text == "status 0", "a client with them drives", text)
    # the same rig with twice the ticks of the encoders in a turn of a joint
    old = simulator.tables
    with Simulator("coman", changes={"motors": {"joint_ticks_per_rev": 8192}}) as simulator:
        simulator.wait()
        text = refused(program, old, simulator.ready, "LElbj")
        result(text.startswith(f"elbow: {min(old.iterdir())} is older than the rig of the run, or "
                               "of another rig: coman-hil dbc RIG -o "),
               "tables that are older than the rig are an error that names the file", text)
        text = refused(program, simulator.tables, simulator.ready, "LElbj")
        result(text == "status 0", "written anew they are taken", text)

def main():
    sys.path.insert(0, str(SOURCE / "python"))
    try:
        programs = build()
        result(True, "the examples are built with what is installed, and with two copied files")
        for rig in RIGS:
            test_rig(rig, programs)
        test_ros2_files(programs["ROS 2"])
        test_ros2_real_time(programs["ROS 2"])
        test_tables(programs["copied"])
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
