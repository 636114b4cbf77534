# SPDX-License-Identifier: Apache-2.0
"""./dev removes what was built at another place; ./dev mutate tells which tests kill. Prints
TAP."""
import collections
import os
import pathlib
import re
import subprocess
import sys
import tempfile

TREE = pathlib.Path(os.environ["HIL_SOURCE_DIR"])
sys.path[:0] = [str(TREE / "tools"), str(TREE / "tests/service")]
sys.dont_write_bytecode = True
import mutate  # noqa: E402  (the tools are no package)
from tap import check  # noqa: E402

STALE = re.search(r"^drop_stale\(\) \{\n.*?^\}\n", (TREE / "dev").read_text(), re.M | re.S)[0]


def kept(where, names, link=False):
    """Whether a build survives in a tree at `where` whose cache names this tree and build."""
    tree = pathlib.Path(where)
    folder = tree / "build" / "release"
    (tree / "elsewhere").mkdir(parents=True)
    if link:
        (tree / "build").symlink_to("elsewhere")
    folder.mkdir(parents=True)
    (folder / "CMakeCache.txt").write_text(
        "CMAKE_CACHEFILE_DIR:INTERNAL=%s\nCMAKE_HOME_DIRECTORY:INTERNAL=%s\n" % names(tree, folder))
    done = subprocess.run(["bash", "-euo", "pipefail", "-c", STALE + "drop_stale release\n"
                           "drop_stale none"], cwd=tree, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert folder.exists() == (done.stdout == ""), done.stdout
    return folder.exists()


print("1..3")
with tempfile.TemporaryDirectory() as place:
    other = pathlib.Path(place, "other", "build", "release")
    other.mkdir(parents=True)
    found = [kept(place + "/own", lambda tree, folder: (folder, tree)),
             kept(place + "/linked", lambda tree, folder: (folder.resolve(), tree), link=True),
             kept(place + "/copied", lambda tree, folder: (other, other.parents[1])),
             kept(place + "/moved", lambda tree, folder: ("/gone/build/release", "/gone")),
             kept(place + "/build", lambda tree, folder: (folder, other.parents[1]))]
check(found == [True, True, False, False, False], "a build of a copied or moved tree is removed",
      found)

tests = [mutate.Test("a_own", "p", 0, 1.0), mutate.Test("b", "p", 3, 1.0),
         mutate.Test(mutate.SAME_BITS, "coman-hil", 5, 1.0)]
killers = [mutate.killer_of(mutate.Verdict(word, by), tests)
           for word, by in (("killed", "a_own"), ("killed by time", "b"), ("killed", ""),
                            ("killed", mutate.SAME_BITS), ("survived", ""))]
check(killers == ["own test", "others", "others", "same_bits alone", ""],
      "a kill is of the mirrored test, of another, or of same_bits alone", killers)

verdicts = [(None, mutate.Verdict("killed", "x", killer)) for killer in killers[:4]]
verdicts += [(None, ("survived", "")), (None, mutate.Verdict("equivalent"))]
rooms = mutate.counts_of_rooms({"app/x.c": {"verdicts": verdicts}})
rows = [[cell.strip() for cell in line.split("|")[1:-1]]
        for line in mutate.table_of(rooms).split("\n")]
row = collections.OrderedDict(zip(rows[0], rows[2]))
check(len({len(line) for line in rows}) == 1 and row["room"] == "app" and row["killed"] == "4"
      and [row[f"by {killer}"] for killer in mutate.KILLERS] == ["1", "2", "1"]
      and row["survived"] == "1" and row["killed %"] == "80", "the table has a column for each",
      rows)
