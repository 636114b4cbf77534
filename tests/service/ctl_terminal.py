#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: ctl_terminal.py COMAN-HIL
A control socket that is not ours answers coman-hil ctl with escape sequences wherever a text or a
name can stand: none reaches the terminal. Prints TAP."""
import json
import os
import socket
import subprocess
import sys
import tempfile
import threading

from tap import check

ESC = "\x1b]0;owned\x07\x1b[31m\x9b5m\x7f\r"
PATIENCE_S = 30


def evil(value):
    """The same answer with an escape sequence in every name and text."""
    if isinstance(value, dict):
        return {(k if k in KNOWN else k + ESC): evil(v) for k, v in value.items()}
    if isinstance(value, list):
        return [evil(v) for v in value]
    return value + ESC if isinstance(value, str) else value


ANSWERS = {
    "hello": {"ok": True, "program": "p", "version": "1", "rig": "r", "file": "f"},
    "status": {"ok": True, "rig": "r", "file": "f", "clock": "c", "robot_hash": "h",
               "task": {"name": "n", "status": "s", "message": "m"}, "recording": "d",
               "faults": ["a"], "buses": [{"name": "b", "state": "s"}],
               "joints": {"knee": 1.0}, "contacts": {"foot": 2.0}},
    "statistics": {"ok": True, "phases": {"plant": {"count": 1}}, "overruns_by": {"plant": 3}},
    "list": {"ok": True, "faults": [{"name": "n", "line": "l", "active": True}],
             "signals": ["a", "b"], "tunables": [{"name": "n", "unit": "u"}]},
    "subscribe": {"ok": True, "signals": ["a", "b"]},
    "pause": {"ok": True, "state_hash": "h"},
    "get": {"ok": False, "error": "refused", "code": "input"},
}
KNOWN = {"ok", "program", "version", "rig", "file", "clock", "robot_hash", "task", "name", "status",
         "message", "recording", "faults", "buses", "state", "joints", "contacts", "phases",
         "overruns_by", "unit", "tunables", "count", "line", "active", "signals", "state_hash",
         "error", "code"}
ROW = {"tick": 1, "time_s": 0.5, "values": [1, 2], "note": "n"}


def serve(server):
    """Each client's request gets its answer, half of them with the bytes themselves and not as
    the escapes of JSON."""
    while True:
        try:
            client = server.accept()[0]
        except OSError:
            return
        with client, client.makefile("rwb") as stream:
            command = json.loads(stream.readline())["cmd"]
            answer = [evil(ANSWERS.get(command, ANSWERS["pause"]))]
            if command == "subscribe":
                answer.append(evil(ROW))
            for line in answer:
                raw = json.dumps(line, ensure_ascii=True)
                if RAW[0]:
                    raw = raw.replace("\\u001b", "\x1b").replace("\\u009b", "\x9b")
                stream.write(raw.encode("latin-1" if RAW[0] == 2 else "utf-8") + b"\n")
            stream.flush()


RAW = [0]


def obeyed(text):
    """What a terminal would obey."""
    return [b for b in text.replace(b"\n", b"").replace(b"\t", b"")
            if b < 0x20 or b == 0x7f] or (b"\xc2\x9b" in text) or (b"\x9b" in text)


def main():
    print("1..2")
    with tempfile.TemporaryDirectory() as work, socket.socket(socket.AF_UNIX) as server:
        server.bind(work + "/control")
        server.listen()
        threading.Thread(target=serve, args=(server,), daemon=True).start()
        for extra, name in (([], "nothing that a terminal obeys is printed"),
                            (["--json"], "nor with --json, which prints lines as they come")):
            bad, shown = [], 0
            for raw in (0, 1, 2):
                RAW[0] = raw
                for command in (["hello"], ["status"], ["statistics"], ["list", "faults"],
                                ["subscribe", "a"], ["pause"], ["get", "x"]):
                    done = subprocess.run(
                        [sys.argv[1], "ctl", "--socket", work + "/control", "--rows", "1", *extra,
                         *command], capture_output=True, timeout=PATIENCE_S, check=False)
                    shown += (b"?]0;owned?" in done.stdout + done.stderr
                              or b"u001b" in done.stdout)
                    if obeyed(done.stdout + done.stderr):
                        bad.append((raw, command, done.stdout[:200], done.stderr[:200]))
            check(not bad and shown >= 7, name, f"{shown} shown, {bad[:2]}")
        os.unlink(work + "/control")


main()
