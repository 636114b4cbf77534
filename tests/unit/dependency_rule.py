#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The arrows between the rooms, checked on the #include lines: who may include what, that private
headers stay in their room, that no circle joins two rooms or sub-rooms, and that C++ stands only in
contact/simbody/, in tests and in examples. Prints TAP. A planted violation of each kind shows
that the check would see one."""
import collections
import os
import pathlib
import re
import sys
import tempfile

ROOT = pathlib.Path(os.environ.get("HIL_SOURCE_DIR") or pathlib.Path(__file__).parents[2])

# Low to high. FOLDER: what its files may include of the tree, as regular expressions of whole
# paths. A folder has the rule of the longest name here that it begins with; NAME/* is that of the
# sub-rooms of NAME. dynamics/ is written by the build, and so are embedded texts (manual/) and
# the list of protocols (list/).
BELOW_SIM = (r"(base|canbus|contact|model|model/\w+|faults|boards|boards/\w+|tasks|rt|rig)/[^/]*"
             r"|canbus/wire/[^/]*|contact/mesh/[^/]*|rt/recording/[^/]*")
RULES = {
    "base": r"(base|manual)/[^/]*",
    "client": r"coman_hil_client\.h",
    "canbus": r"(base|canbus|canbus/wire)/[^/]*",
    "contact": r"(base|contact|contact/mesh|contact/native)/[^/]*",
    "contact/mesh": r"(base|contact|contact/mesh)/[^/]*",
    "contact/simbody": r"(base|contact|contact/mesh|contact/simbody)/[^/]*",
    "model": r"(base|model|model/\w+)/[^/]*|contact/(contact|mesh/mesh)\.h|dynamics/builtin\.inc",
    "faults": r"(base|faults)/[^/]*",
    "boards": r"(base|faults|boards)/[^/]*|canbus/frame\.h|model/plant_io\.h|list/protocols\.h",
    "boards/*": r"(base|faults|boards|boards/\w+)/[^/]*|canbus/frame\.h|model/plant_io\.h"
                r"|manual/[^/]*",
    "tasks": r"(base|canbus|tasks)/[^/]*|boards/\w+/protocol\.h|boards/protocol_list\.h",
    "rt": r"(base|canbus|rt|rt/recording)/[^/]*",
    "rig": BELOW_SIM,
    "sim": BELOW_SIM + r"|sim/[^/]*",
    "control": BELOW_SIM + r"|(sim|control)/[^/]*",
    "viewer": r"(base|contact|contact/mesh|model|boards|rig|sim|viewer)/[^/]*"
              r"|canbus/(candump|frame|port)\.h"
              r"|rt/(clock|histogram|requests)\.h|control/(parse|socket)\.h",
    "app/report": r"(base|app/report)/[^/]*",
    "app/identify": r"(base|canbus|model|model/drives|rig|app/report|app/identify)/[^/]*",
    "app/scenario": BELOW_SIM + r"|(sim|app/report|app/scenario)/[^/]*",
    "app/sweep": BELOW_SIM + r"|(sim|app/report|app/scenario|app/sweep)/[^/]*",
    "app/bench": BELOW_SIM + r"|(sim|app/report|app|app/bench)/[^/]*|manual/[^/]*",
    "app": BELOW_SIM + r"|(sim|control|app|app/\w+|app/cli/\w+)/[^/]*"
           r"|viewer/viewer\.h|manual/[^/]*",
}
TOP = {rule.split("/")[0] for rule in RULES}
FOLDERS = TOP | {"tests", "config", "systemd", "docs", "examples"}
CXX = {".cpp", ".hpp", ".cc", ".cxx", ".hh"}
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*(["<])([^">]*)[">]', re.M)


def sources(root):
    """Paths of the rooms' sources, relative to root."""
    for top in sorted(TOP):
        for path in sorted((root / top).rglob("*")):
            if path.suffix in {".c", ".h"} | CXX:
                yield path.relative_to(root)


def includes(root, path):
    """What a file includes of the tree: "repository/relative.h" and <the/same.h>. A bare or ../
    name in quotes is not relative to the root and comes out as it is."""
    for bracket, name in INCLUDE.findall((root / path).read_text()):
        if bracket == '"' or name.split("/")[0] in FOLDERS and "/" in name:
            yield name


def rule_of(folder):
    while folder not in RULES:
        room = os.path.dirname(folder)
        folder = f"{room}/*" if f"{room}/*" in RULES else room
    return RULES[folder]


def foreign_includes(root):
    """A line for each include that the rules do not allow."""
    return [f"{path}: includes {name}" for path in sources(root) for name in includes(root, path)
            if not re.fullmatch(rule_of(str(path.parent)), name)]


def borrowed_privates(root):
    """A line for each private header that is included outside its folder and its sub-folders."""
    return [f"{path}: includes the private {name}"
            for path in sources(root) for name in includes(root, path)
            if re.search(r"(^|/|_)private\.h$", name)
            and not f"{path.parent}/".startswith(os.path.dirname(name) + "/")]


def node_of(path, divided):
    """A room, a sub-room, or in a room with sub-rooms one subject: board.c and board.h
    are board.*"""
    folder = os.path.dirname(path)
    return os.path.splitext(path)[0] + ".*" if folder in divided else folder


def folder_of(node):
    return os.path.dirname(node) if node.endswith(".*") else node


def circles(root):
    """The rooms, sub-rooms and subjects that a circle of includes joins, a line each. Subjects of
    one folder may know each other."""
    paths = [str(path) for path in sources(root)]
    divided = {os.path.dirname(os.path.dirname(path)) for path in paths}
    reach = collections.defaultdict(set)
    for path in paths:
        for name in includes(root, path):
            if (root / name).exists() and node_of(path, divided) != node_of(name, divided):
                reach[node_of(path, divided)].add(node_of(name, divided))
    # The transitive closure: what a node reaches through others
    grown = True
    while grown:
        grown = False
        for to in reach.values():
            size = len(to)
            to |= set().union(*(reach.get(other, set()) for other in to))
            grown = grown or len(to) > size
    rings = {node: {other for other in to if node in reach.get(other, ())}
             for node, to in reach.items()}
    return [f"{node} stands in a circle with {', '.join(sorted(ring - {node}))}"
            for node, ring in sorted(rings.items())
            if len({folder_of(other) for other in ring}) > 1]


def foreign_cxx(root):
    """C++ outside its places."""
    return [str(path.relative_to(root)) for path in sorted(root.rglob("*"))
            if path.suffix in CXX
            and not path.relative_to(root).parts[0] in {"tests", "examples", "build", ".git"}
            and path.relative_to(root) != pathlib.Path("contact/simbody/simbody.cpp")]


number = failures = 0


def result(name, findings):
    """One test point: ok when there are no findings."""
    global number, failures
    number += 1
    failures += bool(findings)
    print(f"{'not ok' if findings else 'ok'} {number} - {name}")
    for line in findings:
        print(f"# {line}")


def planted(name, check, files):
    """A tree with just these files must be found wrong."""
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for file, text in files.items():
            (root / file).parent.mkdir(parents=True, exist_ok=True)
            (root / file).write_text(text + "\n")
        result(name, [] if check(root) else [f"{files} was not seen"])


PLANTED = [
    ("base_knows_nobody", "base/x.c", "canbus/frame.h"),
    ("the_client_can_be_copied", "client/x.c", "base/error.h"),
    ("contact_knows_no_model", "contact/x.h", "model/robot.h"),
    ("canbus_knows_no_boards", "canbus/wire/x.c", "boards/board.h"),
    ("model_calls_contact_through_its_headers_only", "model/x.c", "contact/contact_private.h"),
    ("boards_see_no_plant_beyond_plant_io", "boards/x.c", "model/plant.h"),
    ("faults_know_no_board", "faults/x.c", "boards/board.h"),
    ("boards_know_no_protocol", "boards/x.c", "boards/icub/board.h"),
    ("boards_see_no_can_port", "boards/icub/x.c", "canbus/port.h"),
    ("tasks_see_no_boards_beyond_the_protocol", "tasks/x.c", "boards/board.h"),
    ("the_loop_knows_no_rig", "rt/x.h", "rig/rig.h"),
    ("the_loop_knows_no_robot", "rt/x.c", "model/plant.h"),
    ("a_rig_knows_no_simulator", "rig/x.c", "sim/simulator.h"),
    ("a_simulator_knows_no_command", "sim/x.c", "base/../app/cli/commands.h"),
    ("the_page_knows_no_loop", "viewer/x.c", "rt/loop.h"),
    ("the_page_knows_no_command", "viewer/x.c", "app/cli/commands.h"),
    ("control_knows_no_page", "control/x.c", "viewer/viewer.h"),
    ("reports_know_no_simulator", "app/report/x.c", "sim/simulator.h"),
    ("control_knows_no_command", "control/x.c", "app/cli/commands.h"),
    ("nobody_includes_tests", "rt/x.c", "tests/physics/near.h"),
    ("includes_are_repository_relative", "model/symbolic/x.c", "../robot.h"),
]


def main():
    print(f"1..{len(PLANTED) + 10}")
    result("rooms_include_only_what_they_may", foreign_includes(ROOT))
    result("private_headers_stay_in_their_room", borrowed_privates(ROOT))
    result("no_circle_joins_two_rooms_or_sub_rooms", circles(ROOT))
    result("cpp_stands_only_in_contact_simbody_tests_and_examples", foreign_cxx(ROOT))
    for name, file, include in PLANTED:
        planted(name, foreign_includes, {file: f'#include "{include}"'})
    planted("angle_brackets_are_seen", foreign_includes,
            {"tasks/x.c": "#include <model/plant_io.h>"})
    planted("blanks_are_seen", foreign_includes, {"boards/x.c": '  #  include  "model/plant.h"'})
    planted("a_borrowed_private_header_is_seen", borrowed_privates,
            {"app/cli/x.c": '#include "app/scenario/private.h"'})
    planted("a_circle_of_a_room_and_its_sub_room_is_seen", circles,
            {"boards/board.h": '#include "boards/icub/table.h"',
             "boards/icub/table.h": '#include "boards/field.h"', "boards/field.h": "",
             "boards/icub/bus.c": '#include "boards/board.h"'})
    planted("a_circle_of_two_sub_rooms_is_seen", circles,
            {"app/report/a.h": '#include "app/scenario/b.h"',
             "app/scenario/c.c": '#include "app/report/a.h"', "app/scenario/b.h": ""})
    planted("cpp_elsewhere_is_seen", foreign_cxx, {"model/x.cpp": "int x;"})
    return failures > 0


sys.exit(main())
