#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: module.py COMAN-HIL
A robot that is not built in: its run is numeric, with a compiler or without, and says which command
makes its module; that command does, a run then takes it, and the doctor says both. Prints TAP."""
import os
import re
import shutil
import subprocess
import sys
import tempfile

from tap import result

PROGRAM = sys.argv[1]
RIG = "arm/rigs/arm.yaml"
ROBOT = """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><mass value="2"/><origin xyz="0.2 0 0"/>
<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="lower"><inertial><mass value="1"/><origin xyz="0.2 0 0"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="40" velocity="3"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/>
<origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="40" velocity="3"/></joint></robot>
"""


class Bench:
    def __init__(self, work):
        self.work, self.path = work, os.environ["PATH"]

    def call(self, *words):
        """Status, standard output and standard error."""
        done = subprocess.run(
            [PROGRAM, *words], cwd=self.work, stdin=subprocess.DEVNULL, capture_output=True,
            text=True, timeout=100,
            env=dict(os.environ, PATH=self.path, XDG_CACHE_HOME=self.work + "/cache"))
        return done.returncode, done.stdout, done.stderr

    def run(self, rig=RIG):
        """What it says of its dynamics, and its state hash."""
        _, out, err = self.call("run", rig, "--transport", "local", "--clock", "free", "--ticks",
                                "50", "--control", "none", "--hold", "none")
        found = re.search("dynamics: (.*)", err)
        bits = re.search("state hash +(.*)", out)
        return found and found[1], bits and bits[1]

    def doctor(self):
        return self.call("doctor", RIG, "--local", "--measure", "0")[1]

    def left(self):
        return sorted(name for _, _, names in os.walk(self.work + "/cache") for name in names)

    def write(self, name, text):
        with open(f"{self.work}/{name}", "w") as file:
            file.write(text)


def without_a_module(bench):
    path, bench.path = bench.path, bench.work
    bare, bits_bare = bench.run()
    status, _, err = bench.call("generate", "--module", RIG)
    result(status == 4 and "no C compiler" in err and not bench.left(),
           "without a compiler the module is refused", f"{status}, {err}, {bench.left()}")
    bench.path = path
    said, bits = bench.run()
    result(bits and bits == bits_bare and said == bare and "numeric" in said and not bench.left(),
           "a run is numeric, with a compiler as without", f"{said}, {bits}, {bits_bare}")
    _, bits_generic = bench.run("slow.yaml")
    result(bits == bits_generic, "to the bits of dynamics: generic", bits_generic)
    result("numeric" in bench.doctor(), "the doctor says so", bench.doctor())
    command = re.search("coman-hil (generate .*) makes one", said or "")
    return command[1].split() if command else ["generate"]


def with_a_module(bench, command):
    status, out, err = bench.call(*command)
    result(status == 0 and "compiling" in err and "now" in out and len(bench.left()) == 1,
           "the command that it names makes the module", f"{command}, {status}, {out}{err}")
    said, bits = bench.run()
    result(said and "generated dynamics" in said and bits, "which a run then takes", said)
    result("made beforehand" in bench.doctor(), "the doctor says that too", bench.doctor())
    status, out, err = bench.call(*command)
    result(status == 0 and "already" in out and "compiling" not in err, "once is enough", out + err)
    said, heavy = bench.run("heavy.yaml")
    result(said and "generated dynamics" in said and heavy != bits,
           "it serves a rig that adds masses", f"{said}, {heavy}")
    status, _, err = bench.call("run", "slow.yaml", "--transport", "local", "--ticks", "1",
                                "--control", "none", "--clock", "free")
    result(status == 0 and "as the rig says" in err, "but not one with dynamics: generic", err)
    module = f"{bench.work}/cache/coman-hil/{(bench.left() or [''])[0]}"
    os.truncate(module, os.path.getsize(module) // 2)
    said, _ = bench.run()
    result(said and "numeric" in said and "damaged" in said, "a damaged one is not loaded", said)
    bench.call(*command)
    result(bench.run()[1] == bits, "and is made anew, to the same bits", bench.run())


def main():
    print("1..15")
    with tempfile.TemporaryDirectory() as work:
        bench = Bench(work)
        bench.write("arm.urdf", ROBOT)
        status, out, err = bench.call("import", "arm.urdf", "-o", "arm")
        result(status == 0 and f"coman-hil generate --module {RIG}\n" in out,
               "an arm is imported, and the command suggested", out + err)
        bench.write("heavy.yaml", f"extends: {RIG}\nrobot: {{added_mass_kg: {{lower: 1}}}}\n")
        bench.write("slow.yaml", f"extends: {RIG}\ndynamics: generic\n")
        command = without_a_module(bench)
        if shutil.which("cc"):
            with_a_module(bench, command)
        _, out, _ = bench.call("generate", "--module", "coman")
        result("built in" in out, "COMAN needs none", out)
        status, _, err = bench.call("generate", "--module", "coman", "--lanes", "2")
        result(status == 2 and "--lanes" in err, "what a module does not take is refused", err)


main()
