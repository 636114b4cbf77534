#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: ctl.py COMAN-HIL
A user's session with a running simulator: in Python over the control socket, with the ctl command,
and two runs of one rig at once. Prints TAP."""
import json
import os
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import time

from ready import wait_until_ready

PATIENCE_S = 60
PROGRAM = sys.argv[1]
RIG = os.environ["HIL_SOURCE_DIR"] + "/config/rigs/coman.yaml"


class Run:
    """a simulator on local buses"""

    def __init__(self, work, *options, name="run", places=None):
        self.env = dict(os.environ, XDG_RUNTIME_DIR=places or work)
        for variable in ("COMAN_HIL_CONTROL", "RUNTIME_DIRECTORY", "NOTIFY_SOCKET"):
            self.env.pop(variable, None)
        self.err = work + "/" + name + ".err"
        self.out = work + "/" + name + ".out"
        self.ready, self.known = work + "/" + name + ".ready", None
        with open(self.err, "w") as err, open(self.out, "w") as out:
            self.process = subprocess.Popen(
                [PROGRAM, "run", RIG, "--transport", "local", "--ready", self.ready,
                 *options], env=self.env, stdin=subprocess.DEVNULL, stdout=out, stderr=err)

    def says(self, what, file=None):
        """the line with this in what it prints"""
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            with open(file or self.err) as log:
                for line in log:
                    if what in line and line.endswith("\n"):
                        return line.strip()
            if self.process.poll() is not None:
                with open(file or self.err) as log:
                    return next((line.strip() for line in log if what in line), None)
            time.sleep(0.02)
        return None

    def places(self):
        """where it can be talked to, once it can"""
        if not self.known:
            self.known = wait_until_ready(self.ready, self.process, PATIENCE_S,
                                          lambda: open(self.err).read())
        return self.known

    def path(self):
        return self.places()["control"]

    def ctl(self, *words):
        return subprocess.run([PROGRAM, "ctl", *words], env=self.env, stdin=subprocess.DEVNULL,
                              capture_output=True, text=True, timeout=PATIENCE_S)

    def ends(self):
        try:
            return self.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            return None

    def kill(self):
        self.process.kill()
        self.process.wait()


class Client:
    """the protocol as a user would write it"""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect(path)
        self.file = self.socket.makefile("r")
        self.id = 0
        self.rows = []

    def ask(self, cmd, **keys):
        self.id += 1
        self.socket.sendall((json.dumps({"id": self.id, "cmd": cmd, **keys}) + "\n").encode())
        while True:
            line = json.loads(self.file.readline())
            if "values" in line:
                self.rows.append(line)
            else:
                assert line["id"] == self.id, line
                return line


class Frames:
    """a bus, through the gateway, as text"""

    def __init__(self, port, bus):
        self.socket = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
        for text, answer in (("", b"< hi >"), ("< open %s >" % bus, b"< ok >"),
                             ("< rawmode >", b"< ok >")):
            self.socket.sendall(text.encode())
            heard = b""
            while answer not in heard:
                heard += self.socket.recv(4096)

    def report(self, *boards):
        """these boards are to send position, status and current from now on"""
        for board in boards:
            self.socket.sendall(b"< send %03X 5 49 0D 02 00 00 >" % board)
        self.socket.sendall(b"< echo >")  # when it is answered, all before it is on the bus
        self.socket.settimeout(PATIENCE_S)
        heard = b""
        while b"< echo >" not in heard:
            heard += self.socket.recv(65536)

    def boards(self, last=None):
        """which boards have sent telemetry, with how many frames, until nothing more comes; the
        last of the bus is waited for until it has sent many"""
        count, text, end = {}, "", time.monotonic() + PATIENCE_S
        self.socket.settimeout(0.3)
        while time.monotonic() < end:
            try:
                text += self.socket.recv(65536).decode()
            except socket.timeout:
                if last is None or count.get(last, 0) > 40:
                    break
            *whole, text = text.split(">")
            for frame in whole:
                ident = int(frame.split("frame ")[1].split()[0], 16) if "frame " in frame else 0
                if ident >> 8 == 1:
                    count[ident >> 4 & 15] = count.get(ident >> 4 & 15, 0) + 1
        return count


number = 0


def result(name, good, what=""):
    global number
    number += 1
    print("ok" if good else "not ok", number, "-", name, flush=True)
    if not good:
        for line in str(what).splitlines()[-20:]:
            print("#", line, flush=True)


def session(work):
    """with everything that a session may want"""
    run = Run(work, "--clock", "real", "--gateway", "0", "--hold", "always", "--fault",
              "silent: board left_leg/1 off manual")
    try:
        path = run.path()
        mode = stat.S_IMODE(os.stat(path).st_mode)
        result("run opens a socket for its owner alone", path == work + "/coman-hil/coman.sock"
               and mode == 0o600,
               (path, oct(mode)))
        client = Client(path)
        port = int(run.places()["gateway_port"])
        paused = client.ask("pause")
        stepped = client.ask("step", count=10)
        result("it stands still, and runs ten ticks",
               paused["ok"] and stepped["ok"] and stepped["tick"] == paused["tick"] + 10
               and client.ask("status")["tick"] == stepped["tick"], (paused, stepped))

        kept = client.ask("checkpoint", slot=2)
        calm = client.ask("step", count=40)
        back = client.ask("restore", slot=2)
        again = client.ask("step", count=40)
        result("from a checkpoint it goes the same way again",
               kept["ok"] and back["state_hash"] == kept["state_hash"]
               and back["tick"] == kept["tick"]
               and again == dict(calm, id=again["id"]), (kept, calm, back, again))

        frames = Frames(port, "left_leg")
        heard = []
        for on in (False, True, False):
            client.ask("fault", name="silent", on=on)
            client.ask("step", count=1000)  # a board without power boots for a while after it
            frames.boards()
            frames.report(1, 2)
            client.ask("step", count=200)
            heard.append(frames.boards(last=2))
        active = client.ask("list", what="faults")["faults"][0]
        result("a fault is on and off in the frames",
               all(h.get(2, 0) > 40 for h in heard) and heard[0].get(1, 0) > 40
               and heard[1].get(1, 0) == 0
               and heard[2].get(1, 0) > 40 and active["name"] == "silent" and not active["active"],
               heard)

        was = client.ask("get", name="joint.LKneeSag.position_kp")
        client.ask("set", name="joint.LKneeSag.position_kp", value=77)
        now = client.ask("get", name="joint.LKneeSag.position_kp")
        wrong = client.ask("set", name="joint.LKneSag.position_kp", value=77)
        result("a gain is read, set, and read back; a wrong name names the nearest",
               was["ok"] and now["value"] == 77 and wrong["code"] == "input"
               and "joint.LKneeSag.position_kp" in wrong["error"], (was, now, wrong))

        client.ask("subscribe", signals=["q_LKneeSag_rad", "fz_*"], period_ms=10)
        start = client.ask("status")["tick"]
        client.ask("step", count=200)
        total = client.ask("unsubscribe")
        ticks = [row["tick"] for row in client.rows]
        result("a subscription has a row at every tenth tick",
               total["rows"] == 20 and total["missed"] == 0 and len(ticks) == 20
               and all(t % 10 == 0 and t > start for t in ticks), (total, ticks))

        resumed = client.ask("resume")
        reached = client.ask("wait", tick=resumed["tick"] + 50)
        result("it goes on in real time", reached["ok"] and reached["tick"] >= resumed["tick"] + 50,
               (resumed, reached))
        stopped = client.ask("stop")
        result("it stops, well", stopped["ok"] and run.ends() == 0 and not os.path.exists(path),
               stopped)
    finally:
        run.kill()


def push(work):
    """a robot that nobody holds"""
    run = Run(work, "--clock", "real", "--hold", "none", "--control", work + "/here", name="push")
    try:
        client = Client(run.path())
        client.ask("pause")
        client.ask("reset")
        client.ask("checkpoint")
        calm = client.ask("step", count=200)
        client.ask("restore")
        client.ask("push", body="Waist", force_n=[20, 0, 0], duration_s=0.05)
        pushed = client.ask("step", count=200)
        client.ask("restore", slot=0)
        again = client.ask("step", count=200)
        result("a push moves the robot, and without it all is as before",
               calm["tick"] == 200 and calm["state_hash"] != pushed["state_hash"]
               and calm["state_hash"] == again["state_hash"], (calm, pushed, again))
        client.ask("stop")
        result("the path may be chosen", run.path() == work + "/here" and run.ends() == 0,
               run.path())
    finally:
        run.kill()


def command(work):
    """as a person types it"""
    env = dict(os.environ, XDG_RUNTIME_DIR=work)
    env.pop("COMAN_HIL_CONTROL", None)
    nobody = subprocess.run([PROGRAM, "ctl", "hello"], env=env, capture_output=True, text=True,
                            timeout=PATIENCE_S)
    others = nobody.returncode == 0  # a service that root may see
    result("without a simulator it says how to start one",
           others or (nobody.returncode == 3 and "coman-hil run RIG" in nobody.stderr), nobody)
    run = Run(work, "--clock", "real", "--hold", "always", name="command")
    try:
        path = run.path()
        at = ("--socket", path)
        run.ctl("wait", "tick=1")
        answer = run.ctl("status")
        result("status is a table", answer.returncode == 0
               and "coman: running, clock real x1" in answer.stdout
               and "LKneeSag" in answer.stdout and "left_leg" in answer.stdout, answer)
        answer = run.ctl("statistics", *at)
        result("statistics have the phases", answer.returncode == 0 and "plant" in answer.stdout
               and "p99" in answer.stdout, answer)
        answer = run.ctl("subscribe", "q_LKneeSag_rad", "fz_LFoot_n", "--rows", "5", "--csv", *at)
        lines = answer.stdout.splitlines()
        result("rows come as CSV", answer.returncode == 0 and len(lines) == 6
               and lines[0] == "time_s,q_LKneeSag_rad,fz_LFoot_n" and lines[1].count(",") == 2,
               answer)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
            listener.bind(("127.0.0.1", 0))
            listener.settimeout(20)
            answer = run.ctl("subscribe", "q_LKneeSag_rad", "torque_LKneeSag_nm", "--rows", "5",
                             "--udp", f"127.0.0.1:{listener.getsockname()[1]}", *at)
            rows = [json.loads(listener.recv(65536)) for _ in range(5)]
        result("rows come as UDP datagrams", answer.returncode == 0 and not answer.stdout and
               all(list(r) == ["timestamp", "q_LKneeSag_rad", "torque_LKneeSag_nm"] and
                   abs(b["timestamp"] - a["timestamp"] - 0.01) < 1e-9
                   for r, a, b in zip(rows, rows, rows[1:])), (answer, rows))
        answers = [run.ctl(*words, *at)
                   for words in (("pause",), ("step", "7"), ("checkpoint", "3"),
                                 ("push", "Waist", "force_n=10,0,0"), ("set", "supply_v=40"),
                                 ("restore", "3"), ("resume",))]
        result("what changes something says when",
               all(a.returncode == 0 and ": tick " in a.stdout for a in answers),
               answers)
        run.ctl("pause", *at)
        pushes = [run.ctl("push", "Waist", *words, *at)
                  for words in (("force_n=6,8,0", "moment_nm=0,0,2"), (), (),
                                ("force_n=1,0,0", "duration_s=9"), ("duration_s=1",))]
        run.ctl("resume", *at)
        said = ("push: tick", "ended the push of 10 N and 2 Nm on Waist\n",
                "no push acted on Waist", "push: tick", "ended the push of 1 N and 0 Nm on Waist\n")
        result("a push without force and moment says which push it ended",
               all(a.returncode == 0 and a.stdout.startswith(text) and ": tick " in a.stdout
                   for a, text in zip(pushes, said)), pushes)
        answer = run.ctl("get", "supply_v", *at)
        result("a tunable has value, unit and range", answer.returncode == 0
               and " V " in answer.stdout, answer)
        wrong = [(run.ctl(*words), status, text) for words, status, text in (
            (("statsu",), 2, '"status"'),
            (("set", "suply_v=40"), 2, '"supply_v"'),
            (("set", "supply_v=40V"), 2, 'found "40V", expected a number'),
            (("get", "suply*"), 2, 'found nothing that "suply*" matches'),
            (("list", "bodies", "Wasit*"), 2, "coman-hil ctl list bodies"),
            (("push", "Waist", "force=1,0,0"), 2, "force_n"),
            (("step", "0"), 2, "expected a whole number"),
            (("restore", "2"), 1, "no checkpoint"),
            (("pause", "now"), 2, "expected no argument"),
            (("status", "--socket", "/nowhere"), 3, "/nowhere"))]
        result("what is wrong is said, with its exit status",
               all(a.returncode == status and text in a.stderr for a, status, text in wrong), wrong)
        answer = run.ctl("--json", "hello", *at)
        result("--json prints the answer as it is",
               json.loads(answer.stdout)["pid"] == run.process.pid, answer)

        follower = subprocess.Popen([PROGRAM, "ctl", "subscribe", "q_*", *at], env=run.env,
                                    stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(3):
            follower.stdout.readline()
        follower.send_signal(signal.SIGINT)
        follower.communicate(timeout=PATIENCE_S)
        result("Ctrl-C ends a subscription cleanly", follower.returncode == 0, follower.returncode)
        answer = run.ctl("stop", *at)
        result("stop ends the run", answer.returncode == 0 and run.ends() == 0, answer)
    finally:
        run.kill()


def places(work):
    """two runs of one rig; a path of one's own; what a killed run leaves"""
    runs = [Run(work, "--hold", "always", name="one")]
    try:
        first = runs[0].path()
        runs.append(Run(work, "--hold", "always", name="two"))
        second = runs[1].path()
        answer = runs[0].ctl("hello", "--json")
        result("a second run of a rig gets a socket of its own, and is found first",
               second == work + "/coman-hil/coman-2.sock"
               and json.loads(answer.stdout)["pid"] == runs[1].process.pid
               and first in answer.stderr, answer)
        third = Run(work, "--control", first, name="three")
        runs.append(third)
        result("a place that is taken is refused when it was asked for",
               third.ends() == 3 and third.says("a running process listens at"), third.says(""))
        runs[0].kill()
        left = os.path.exists(first)
        fourth = Run(work, "--hold", "always", name="four")
        runs.append(fourth)
        result("what a killed run has left is replaced", left and fourth.path() == first,
               fourth.path())
        fifth = Run(work, "--control", "none", "--hold", "always", name="five")
        runs.append(fifth)
        fifth.process.send_signal(signal.SIGTERM)
        fifth_ended = fifth.ends() is not None
        result("--control none opens none", fifth_ended and not fifth.says("control: /"),
               fifth.says(""))
        sixth = Run(work, "--ticks", "100", "--clock", "free", name="six", places="/proc/self/no")
        runs.append(sixth)
        result("a default place that cannot be had is no end: another is, or a notice says why",
               sixth.ends() == 0 and (sixth.says("control: /")
                                      or sixth.says("notice: control socket: cannot make")),
               sixth.says(""))
    finally:
        for run in runs:
            run.kill()


def main():
    print("1..27")
    for part in (session, push, command, places):
        with tempfile.TemporaryDirectory() as work:
            part(work)


main()
