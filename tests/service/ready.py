# SPDX-License-Identifier: Apache-2.0
"""The file that `coman-hil run --ready FILE` and `coman-hil replay --ready FILE` write."""
import os
import shlex
import time


def wait_until_ready(path, process, patience_s, text):
    """The lines of the file by their names, once it is there; text(): what the program has said."""
    end = time.monotonic() + patience_s
    while not os.path.exists(path):
        assert process.poll() is None and time.monotonic() < end, text()
        time.sleep(0.01)
    with open(path) as file:
        return dict(word.split("=", 1) for word in shlex.split(file.read()))
