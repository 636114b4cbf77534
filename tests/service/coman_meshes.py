#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""examples/meshes with a package of our own that has the form of iit-coman-ros-pkg: the robot wears
its meshes, mirrored where the package mirrors them, and has the same hash. Prints TAP.

coman_meshes.py PROGRAM"""
import os
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import tempfile

import tap
from tap import result

SOURCE = pathlib.Path(os.environ["HIL_SOURCE_DIR"])
WORK = pathlib.Path(tempfile.mkdtemp())
CLONE, WORN = WORK / "clone", WORK / "worn"
HEAD = '<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:property name="SF" value="0.5"/>'
LINK = """<link name="{0}"><visual><origin xyz="0 {1} 0" rpy="0 0 ${{SF}}"/><geometry>
<mesh filename="package://coman_urdf/meshes/A.STL" scale="{2}"/></geometry></visual></link>"""
CORNERS = (0, 0, 0, 1, 0, 0, 0, 2, 0)


def make_package():
    urdf = CLONE / "coman_urdf" / "urdf"
    (urdf / "parts").mkdir(parents=True)
    (CLONE / "coman_urdf" / "meshes").mkdir()
    (CLONE / "LICENSE").write_text("a license")
    (CLONE / "coman_urdf" / "meshes" / "A.STL").write_bytes(
        bytes(80) + struct.pack("<I12fH", 1, 0, 0, 1, *CORNERS, 0))
    links = {"coman_base": [LINK.format("base_link", 0, "1 1 1")],
             "parts/legs": [LINK.format("RLowLeg", 0.1, "${SF} ${SF} ${SF}"),
                            LINK.format("LLowLeg", -0.1, "${SF} -${SF} ${SF}")],
             "parts/forearms": [LINK.format("LForearm", "${0.25 + SF}", "1 1 1"), '<joint name="L">'
                                '<parent link="LElb"/><child link="LForearm"/>'
                                '<origin xyz="0 0 ${-1 - SF}"/></joint>'],
             "parts/torso": [], "parts/arms": []}
    for name, parts in links.items():
        (urdf / f"{name}.urdf.xacro").write_text(HEAD + "".join(parts) + "</robot>")


def points(link):
    return struct.unpack_from("<9f", (WORN / "meshes" / f"{link}.stl").read_bytes(), 96)


def output(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    return done.stdout + done.stderr


def main():
    make_package()
    said = output(sys.executable, SOURCE / "examples/meshes/coman_meshes.py", CLONE, WORN)
    result("3 meshes" in said, "bodies of the robot get meshes, other links do not", said)
    result(points("RLowLeg") == tuple(0.5 * value for value in CORNERS)
           and points("LLowLeg") == (0, -1, 0, 0.5, 0, 0, 0, 0, 0),
           "meshes are scaled, and those of the other side mirrored, with their faces outward",
           points("LLowLeg"))
    text = (WORN / "robots" / "coman.yaml").read_text()
    result(re.search(r"body: LElb, .*xyz_m: \[0\.0, 0\.75, -1\.5\]", text),
           "a part of a link that is no body moves with the link's parent", text[-600:])
    checked, shipped = (output(sys.argv[1], "check", rig) for rig in
                        (WORN / "rigs" / "coman-meshes.yaml", "coman"))
    hashes = [re.findall(r"hash (\w+)", text) for text in (checked, shipped)]
    result(hashes[0] and hashes[0] == hashes[1], "the robot is the same", f"{hashes} {checked}")
    print(f"1..{tap.number}")
    return tap.failed > 0


try:
    sys.exit(main())
finally:
    shutil.rmtree(WORK)
