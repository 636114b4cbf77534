#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""The client for controllers as its users have it: installed and copied, examples in C and C++ that
are built with it and run twice against simulators of each protocol, the same frames each time, and
the same state as the Python package makes with the same controller. Prints TAP.

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


def run(*command, **keys):
    """Ends with what a command said when it does not succeed."""
    done = subprocess.run([str(word) for word in command], stdin=subprocess.DEVNULL, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=PATIENCE_S,
                          **keys)
    if done.returncode:
        raise AssertionError(f"{command} ended with {done.returncode}: {done.stdout}")
    return done.stdout


class Simulator:
    """A run of a rig in lockstep, with its tables. changes: keys of the rig."""

    def __init__(self, rig, *options, changes=None):
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
             "--ready", self.ready, "--control", self.control, "--clock", "lockstep", *options],
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
    run(CMAKE, "-S", SOURCE / "examples" / "controller-cpp", "-B", WORK / "cpp",
        f"-DCMAKE_PREFIX_PATH={PREFIX}", "-DCMAKE_CXX_FLAGS=-Wpedantic -Werror")
    run(CMAKE, "--build", WORK / "cpp")
    return {"installed": c / "elbow", "copied": copied / "elbow", "C++": WORK / "cpp/controller"}


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
    again = drive(programs["C++"], rig)
    result(again == runs["C++"] and "2.000 s" in again[0],
           f"{rig}: {len(again[2])} frames of the controller in C++ are the same again", again[0])


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
