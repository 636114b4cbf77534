#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""A source or page that a comment names is there, and is the only one of that name (or stands
beside the comment): a reader who looks for it finds it. Prints TAP.

Placeholders in capitals (NAME.h) and headers of the system are left alone."""
import collections
import os
import re
import subprocess

os.chdir(os.environ["HIL_SOURCE_DIR"])
NAME = re.compile(r"(?<![\w./{<*-])((?:[\w.-]+/)*[\w-]+\.(?:c|h|cpp|md|py|sh|mjs))(?![\w/*])")
COMMENT = re.compile(r'"(?:\\.|[^"\\\n])*"|/\*.*?\*/|//[^\n]*', re.S)
SYSTEM = re.compile(r"linux/.*|sys/.*|cmocka\.h|SimTKsimbody\.h")


def problem_of(name, path, files):
    """What is wrong with a name in a comment of a file, or nothing."""
    ends = [file for file in files[os.path.basename(name)] if ("/" + file).endswith("/" + name)]
    beside = os.path.join(os.path.dirname(path), name)
    if len(ends) == 1 or beside in ends or name in ends:
        return None
    return f"stands for {', '.join(ends)}" if ends else "is not there"


def main():
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], check=True,
                            capture_output=True, text=True).stdout.split()
    files = collections.defaultdict(list)
    for path in listed:
        files[os.path.basename(path)].append(path)
    wrong = []
    for path in (path for path in listed if path.endswith((".c", ".h", ".cpp"))):
        with open(path, encoding="utf-8") as file:
            text = file.read()
        for comment in COMMENT.finditer(text):
            for match in NAME.finditer(comment[0]) if comment[0][0] == "/" else ():
                name = match[1]
                if SYSTEM.fullmatch(name) or re.search(r"\b[A-Z]{2,}\.[a-z]", name) and \
                        not name.endswith(".md"):
                    continue
                found = problem_of(name, path, files)
                if found:
                    line = text.count("\n", 0, comment.start() + match.start()) + 1
                    wrong.append(f"{path}:{line}: {name} {found}")
    print("1..1")
    print(f"{'not ok' if wrong else 'ok'} 1 - files_that_comments_name_are_there")
    for line in wrong:
        print(f"# {line}")


main()
