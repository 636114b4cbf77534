#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""COMAN with its own meshes on the page.

    python3 coman_meshes.py CLONE FOLDER
    coman-hil run FOLDER/rigs/coman-meshes.yaml --http 0 --task squat

CLONE is a clone of iit-coman-ros-pkg of ADVRHumanoids. Its license, BSD-3-Clause, allows to use and
to pass on the meshes with its notice; coman-hil ships none. This reads the visual shapes from the
URDF of the package, writes each mesh in m for the body that wears it, and adds them to the robot
file that ships. Visual shapes change neither the dynamics nor the hash of the robot."""
import pathlib
import re
import struct
import sys
import xml.etree.ElementTree as xml

HERE = pathlib.Path(__file__).resolve().parent
CONFIG = [HERE.parents[1] / "config", pathlib.Path("/usr/share/coman-hil")]
# bodies of the robot file, and links that the robot file has no body for, with their parents
PARTS = ("coman_base", "parts/torso", "parts/legs", "parts/arms", "parts/forearms")
CARRIED = {"LForearm": "LElb", "RForearm": "RElb"}


def numbers(text, values):
    """The numbers of an attribute: ${...} is an expression of properties."""
    def value(match):
        words = re.findall(r"[A-Za-z_]\w*|[-+*/().\d]+|\S", match[1])
        if not all(word in values or re.fullmatch(r"[-+*/().\d]+", word) for word in words):
            raise ValueError(f"found {match[0]}, expected an expression of " + ", ".join(values))
        return repr(eval(" ".join(repr(values.get(word, 0)) if word in values else word
                                  for word in words), {"__builtins__": {}}))
    return [float(word) for word in re.sub(r"\$\{(.*?)\}", value, text).split()]


def read_package(clone):
    """{link: (file, scale, xyz, rpy)} and {link: xyz in its parent}."""
    trees = [xml.parse(clone / "coman_urdf" / "urdf" / f"{part}.urdf.xacro") for part in PARTS]
    values = {}
    for tree in trees:
        for item in tree.iter("{http://ros.org/wiki/xacro}property"):
            if re.fullmatch(r"[-+.\deE]+", item.get("value") or ""):
                values[item.get("name")] = float(item.get("value"))
    worn, places = {}, {}
    for tree in trees:
        for link in tree.iter("link"):
            mesh = link.find("visual/geometry/mesh")
            if mesh is not None and link.get("name") not in worn:
                origin = link.find("visual/origin")
                name = mesh.get("filename").removeprefix("package://")
                worn[link.get("name")] = (
                    clone / name, numbers(mesh.get("scale"), values),
                    numbers(origin.get("xyz"), values), numbers(origin.get("rpy"), values))
        for joint in tree.iter("joint"):
            if joint.find("child") is not None and joint.find("origin") is not None:
                places[joint.find("child").get("link")] = numbers(joint.find("origin").get("xyz"),
                                                                  values)
    return worn, places


def write_scaled(source, scale, target):
    """Writes a binary STL with its points scaled; a mirror turns the corners round."""
    data = source.read_bytes()
    count = struct.unpack_from("<I", data, 80)[0]
    if len(data) != 84 + 50 * count:
        raise ValueError(f"{source}: found {len(data)} bytes, expected a binary STL of {count} "
                         "facets")
    mirrored = scale[0] * scale[1] * scale[2] < 0
    out = bytearray(b"scaled to m".ljust(80, b"\0") + struct.pack("<I", count))
    for i in range(count):
        points = struct.unpack_from("<9f", data, 84 + 50 * i + 12)
        corners = [[points[3 * c + k] * scale[k] for k in range(3)] for c in range(3)]
        if mirrored:
            corners.reverse()
        out += struct.pack("<12fH", 0, 0, 0, *sum(corners, []), 0)  # viewers compute the normals
    target.write_bytes(out)


def main(clone, folder):
    config = next(path for path in CONFIG if (path / "robots" / "coman.yaml").exists())
    robot = (config / "robots" / "coman.yaml").read_text()
    bodies = set(re.findall(r"^  - name: (\w+)", robot.partition("\nbodies:")[2], re.M))
    worn, places = read_package(clone)
    for name in ("robots", "rigs", "meshes"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    lines = []
    for link, (source, scale, xyz, rpy) in sorted(worn.items()):
        body = CARRIED.get(link, link)
        if body not in bodies:
            continue
        if link in CARRIED:
            xyz = [a + b for a, b in zip(xyz, places[link])]
        write_scaled(source, scale, folder / "meshes" / f"{link}.stl")
        lines.append(f"  - {{name: {link}, body: {body}, shape: mesh, file: ../meshes/{link}.stl, "
                     f"xyz_m: {[round(v, 9) for v in xyz]}, rpy_rad: {[round(v, 9) for v in rpy]}, "
                     "color: [0.72, 0.74, 0.78, 1.0]}")
    (folder / "robots" / "coman.yaml").write_text(
        robot.rstrip() + "\n\n# examples/meshes/coman_meshes.py; iit-coman-ros-pkg, BSD-3-Clause\n"
        "visuals:\n" + "\n".join(lines) + "\n")
    rig = folder / "rigs" / "coman-meshes.yaml"
    rig.write_text(
        "extends: coman\nname: coman-meshes\nrobot: {file: ../robots/coman.yaml}\n")
    (folder / "meshes" / "LICENSE").write_bytes((clone / "LICENSE").read_bytes())
    print(f"{len(lines)} meshes: coman-hil run {rig} --http 0 --task squat")


if len(sys.argv) != 3:
    sys.exit(__doc__)
main(*map(pathlib.Path, sys.argv[1:]))
