#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The page at the end of a run: what clients are told, that those who stay are served until they
go, that nobody else is waited for, and that the next run has the same addresses. Prints TAP."""
import os
import signal
import stat
import subprocess
import sys

from page_client import PATIENCE_S, WORK, Page, Simulator, ask_http, header, token
from tap import check


def told(page):
    """The message about the end, and what comes behind it at once."""
    message = page.until(lambda message: isinstance(message, dict)
                         and message.get("type") == "end")
    return (None, message) if isinstance(message, tuple) else (message, None)


def run_to_end(page):
    """Nobody else drives the clock: the run has its length when this page wants it to."""
    page.send({"id": "steps", "cmd": "step", "count": 500})


def judge_stay():
    folder = os.path.join(WORK.name, "recording")
    with Simulator("coman", "--clock", "lockstep", "--record", folder, "--duration", "0.5") as run:
        page = Page(run.port, run.control, stay=True)
        page.ask("watch", rate_hz=60, signals=["q_RKneeSag_rad"], rows=True)
        run_to_end(page)
        end, _ = told(page)
        check(end and end["stays"] and not end["failed"] and end["task"] is None
              and abs(end["time_s"] - 0.5) < 1e-9, "a page is told how the run ended", end)
        check(run.process.poll() is None, "and is served on")
        state = page.state(where=lambda message: header(message)["flags"] & 4)
        check(header(state)["tick"] == 500, "with the last state", header(state)["tick"])
        bearer = [f"Authorization: Bearer {token(run.look)}"]
        names = [file["name"] for file in end["files"]]
        files = {name: ask_http(run.port, f"/recording/{name}", headers=bearer) for name in names}
        same = [open(os.path.join(folder, name), "rb").read() == files[name][1] for name in names]
        check({"signals.csv", "summary.json", "events.log"} <= set(names) and all(same),
              "the files of the recording are there", names)
        found = [ask_http(run.port, path, headers=keys)[0] for path, keys in (
            ("/recording/signals.csv", []), ("/recording/nothing", bearer),
            ("/recording/../recording/signals.csv", bearer))]
        check(found == [401, 404, 404], "and nothing else", found)
        late = Page(run.port, run.look, stay=True)
        check(told(late)[0] == end, "who comes late is told too")
        refused = late.ask("send", bus="torso", frame_id=1, data="")
        check(refused["code"] in ("ended", "right"), "nothing can be done any more", refused)
        check("state hash" in run.text(), "the summary is printed before the wait")
        page.close()
        late.close()
        check(run.process.wait(PATIENCE_S) == 0, "when the last page is closed the program ends")


def judge_stop(how):
    with Simulator("coman", "--clock", "lockstep", "--duration", "0.5") as run:
        page = Page(run.port, run.control, stay=True)
        run_to_end(page)
        told(page)
        page.ask("watch", rate_hz=60)
        last = header(page.state())
        check(last["tick"] == 500 and last["flags"] & 4, "who looks only then sees the end", last)
        begun = run.process.poll() is None
        if how == "ctl stop":
            page.ask("stop")
        else:
            run.process.send_signal(signal.SIGTERM)
        status = run.process.wait(PATIENCE_S)
        check(begun and status == 0, f"{how} ends the wait", status)


def judge_no_wait():
    with Simulator("coman", "--clock", "real", "--duration", "2") as run:
        check(run.process.wait(PATIENCE_S) == 0, "a run whose page nobody opened does not wait")
    with Simulator("coman", "--clock", "lockstep", "--duration", "0.5") as run:
        page = Page(run.port, run.control)
        run_to_end(page)
        end, _ = told(page)
        check(end and not end["stays"] and told(page)[1] == ("closed", 1001)
              and run.process.wait(PATIENCE_S) == 0,
              "nor is a client waited for that does not stay", end)
    with Simulator("coman", "--clock", "lockstep", "--duration", "0.5", "--http-linger",
                   "0") as run:
        page = Page(run.port, run.control, stay=True)
        run_to_end(page)
        check(run.process.wait(PATIENCE_S) == 0, "nor anybody with --http-linger 0")
    with Simulator("coman", "--clock", "real") as run:
        page = Page(run.port, run.look, stay=True)
        run.process.send_signal(signal.SIGTERM)
        end, _ = told(page)
        check(end["text"] == "stopped" and not end["stays"]
              and run.process.wait(PATIENCE_S) == 0, "nor after a run that was stopped", end)


def judge_tokens():
    """In a folder of its own, whose state is kept below the one for this test."""
    place = os.path.join(WORK.name, "tokens")
    with Simulator("coman", "--clock", "lockstep", "--token-file", place) as run:
        first = run.look, run.control
        run.stop()
    check(stat.S_IMODE(os.stat(place).st_mode) == 0o600, "only the owner may read the tokens")
    with Simulator("coman", "--clock", "lockstep", "--token-file", place) as run:
        check((run.look, run.control) == first, "the next run has the same addresses", run.look)
        run.stop()
    with Simulator("coman", "--clock", "lockstep", "--token-file", "none") as run:
        check(token(run.look) != token(first[0]), "without a file they are new")
        run.stop()
    with Simulator("coman", "--clock", "lockstep") as run:
        first = run.look
        run.stop()
    with Simulator("coman", "--clock", "lockstep") as run:
        check(token(run.look) == token(first), "by default they are those of the directory")
        run.stop()
    os.chmod(place, 0o644)
    link = place + ".link"
    os.symlink(place, link)
    for path, why in ((place, "that others may read"), (link, "that is a link")):
        result = subprocess.run(
            [os.path.join(os.environ["HIL_BINARY_DIR"], "coman-hil"), "run", "coman", "--transport",
             "local", "--clock", "free", "--ticks", "10", "--http", "0", "--control", "none",
             "--token-file", path], capture_output=True, text=True, timeout=PATIENCE_S)
        check(result.returncode in (2, 3) and "--token-file" in result.stderr,
              f"a file {why} is refused", result.stderr.splitlines()[-1:])


def main():
    print("1..23")
    os.environ["XDG_STATE_HOME"] = os.path.join(WORK.name, "state")
    judge_stay()
    judge_stop("SIGTERM")
    judge_stop("ctl stop")
    judge_no_wait()
    judge_tokens()
    return 0


sys.exit(main())
