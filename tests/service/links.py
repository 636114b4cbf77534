#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""usage: links.py FOLDER [SKIPPED...]: that relative links of the Markdown files below a folder
lead to files below it; folders of the names that follow are not looked into. Prints what does
not."""
import os
import re
import sys

LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")


def links(path):
    """Relative links of a file, those in blocks of code left out."""
    with open(path, encoding="utf-8") as file:
        text = re.sub(r"^```.*?^```", "", file.read(), flags=re.S | re.M)
    return [link for link in LINK.findall(text) if not re.match(r"[a-z]+:", link)]


def main(folder, *skipped):
    found, wrong = 0, []
    for here, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if name not in skipped]
        for name in names:
            if not name.endswith(".md"):
                continue
            path = os.path.join(here, name)
            for link in links(path):
                found += 1
                target = os.path.normpath(os.path.join(here, link))
                if not os.path.exists(target) or os.path.relpath(target, folder).startswith(".."):
                    wrong.append(f"{os.path.relpath(path, folder)}: {link}")
    if found == 0:
        wrong.append("no links at all")
    print("\n".join(wrong), end="\n" if wrong else "")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
