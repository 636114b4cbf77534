#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""The docs state the figures of docs/figures.csv, which other tests hold against what they measure
(tests/figure.h). Prints TAP."""
import os
import sys

sys.path.insert(0, os.environ["HIL_SOURCE_DIR"] + "/tools")
import figures  # noqa: E402

wrong = figures.check()
print("1..1")
print(f"{'not ok' if wrong else 'ok'} 1 - the_docs_state_the_figures_of_the_table")
for line in wrong:
    print(f"# {line}")
