#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Overload and loss on local buses: a stolen processor, a stopped process, disks that are full,
slow, dead or taken away, clients that flood the gateway. The promises stand in rt/loop.h,
rt/recording/recorder.h and canbus/gateway.h; what needs a kernel with CAN is in overload_vcan.py.
Prints TAP."""
import os
import random
import re
import resource
import shutil
import signal
import socket
import struct
import subprocess
import sys
import threading
import time

from overload_run import (CONFIG, NORMAL, WORK, Run, changed_rig, check_clock, check_grid,
                          check_recording,
                          check_telemetry, lines, log, main)

STEP, DONE = 0x6F0, 0x6FF


# ---- a stolen processor ----

class Thieves:
    """Work of others on one processor; without stress-ng the stops below are all there is."""

    def __init__(self):
        self.cpu = str(max(os.sched_getaffinity(0)))
        self.process = None

    def __enter__(self):
        if shutil.which("stress-ng"):
            self.process = subprocess.Popen(
                ["stress-ng", "--quiet", "--cpu", "4", "--taskset", self.cpu, "--timeout", "30"],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                start_new_session=True)
        return self

    def __exit__(self, *unused):
        if self.process:
            self.process.send_signal(signal.SIGINT)
            self.process.wait()


def stops(run, count, hold_s):
    for _ in range(count):
        if run.process.poll() is not None:
            return
        run.process.send_signal(signal.SIGSTOP)
        time.sleep(hold_s)
        run.process.send_signal(signal.SIGCONT)
        time.sleep(0.08)


def stolen(policy, status):
    with Thieves() as thieves:
        run = Run("--transport", "local", "--clock", "real", "--task", "squat", "--duration", "2",
                  "--overrun", policy,
                  rig=changed_rig("normal", [NORMAL]), prefix=["taskset", "-c", thieves.cpu])
        if policy != "stop":  # a busy machine may have ended it already
            run.wrote("signals.csv", 20000)  # rows: the loop runs
        stops(run, 8, 0.03)
        summary = run.end(status)
    check_clock(summary, policy)
    check_recording(run, summary)
    frames = log(run.path("candump.log"))
    check_grid(frames, summary["ticks"])
    assert re.search(r"s: overrun by \d+\.\d+ ms in phase", run.text())
    return summary, frames


def test_a_stolen_processor_costs_ticks_with_skip_and_nothing_else():
    summary, frames = stolen("skip", 0)
    assert summary["ticks"] == 2000 and summary["end"] == "ran its length"
    assert summary["overruns"]["total"] >= 8 and summary["dropped_deadlines"] >= 8 * 20
    check_telemetry(frames, "can1", 0x111, 4000)


def test_with_slip_the_late_ticks_are_run():
    summary, frames = stolen("slip", 0)
    assert summary["ticks"] == 2000 and summary["late_ticks"] >= 8 * 20
    check_telemetry(frames, "can1", 0x111, 4000)


def test_with_stop_the_run_ends_and_says_so():
    summary, _ = stolen("stop", 1)
    assert summary["end"] == "stopped by overruns" and summary["ticks"] < 2000


def test_a_stopped_process_counts_one_pause_and_does_not_run_after_it():
    run = Run("--transport", "local", "--clock", "real", "--task", "squat", "--duration", "1")
    run.wrote("signals.csv", 20000)
    run.process.send_signal(signal.SIGSTOP)
    time.sleep(3.0)
    run.process.send_signal(signal.SIGCONT)
    summary = run.end()
    check_clock(summary)
    check_recording(run, summary)
    assert summary["ticks"] == 1000
    assert summary["pauses"] >= 1 and summary["pause_ticks"] >= 2900, summary["pause_ticks"]
    assert "counted as a pause, goes on at the next deadline" in run.text()
    frames = log(run.path("candump.log"))
    check_grid(frames, 1000)
    check_telemetry(frames, "can1", 0x111, 4000)
    # virtual time stood still for both sides of the bus: no command timed out
    assert summary["boards"]["timeouts"] == 0


# ---- the gateway ----

class Client:
    """A client of the gateway: socketcand's protocol by hand."""

    def __init__(self, port, bus=None, raw=False):
        self.socket = socket.create_connection(("127.0.0.1", port), 20)
        self.text = b""
        self.hear(b"< hi >")
        if bus:
            self.say(b"< open %s >" % bus.encode())
            self.hear(b"< ok >")
        if raw:
            self.say(b"< rawmode >")
            self.hear(b"< ok >")

    def say(self, text):
        self.socket.sendall(text)

    def hear(self, what):
        """Everything up to and with what is waited for."""
        while what not in self.text:
            more = self.socket.recv(65536)
            assert more, "the gateway has hung up"
            self.text += more
        heard, _, self.text = self.text.partition(what)
        return heard

    def send(self, identifier, data):
        self.say(b"< send %X %d %s >" %
                 (identifier, len(data), " ".join("%02x" % b for b in data).encode()))

    def step(self, tick, ticks):
        self.send(STEP, struct.pack("<IH", tick, ticks))
        self.hear(b"< frame 6FF ")
        self.hear(b">")

    def close(self):
        self.socket.close()


class Flood:
    """A client that sends a frame for nobody as fast as it can, until it is told to stop; then
    everything that it has sent is on the bus."""

    def __init__(self, port, bus):
        self.client = Client(port, bus)
        self.stopped = threading.Event()
        self.sent = 0
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        heap = b"< send 7AA 8 1 2 3 4 5 6 7 8 >" * 500
        try:
            while not self.stopped.is_set():
                self.client.say(heap)
                self.sent += 500
            self.client.say(b"< echo >")
            self.client.hear(b"< echo >")
        except OSError:
            pass  # the simulator has ended first

    def stop(self):
        self.stopped.set()
        self.thread.join()
        self.client.close()


def resident_kb(process):
    with open("/proc/%d/status" % process.pid) as file:
        return int(re.search(r"^VmRSS:\s+(\d+) kB", file.read(), re.M)[1])


def patient_client(port, bus):
    """One that comes again when all places are taken by those whose end was not noticed yet."""
    for _ in range(100):
        try:
            return Client(port, bus, raw=True)
        except (AssertionError, OSError):
            time.sleep(0.02)
    raise AssertionError("no place at the gateway")


def hostile_crowd(port, seed):
    """Connections that come and go, garbage, and readers that do not read. Returns those that
    stay."""
    dice = random.Random(seed)
    for _ in range(60):
        try:
            guest = socket.create_connection(("127.0.0.1", port), 20)
            guest.sendall(bytes(dice.choice(b"<> open can1 rawmode send 7AA 1 ff\n")
                                for _ in range(300)))
            guest.close()
        except OSError:
            pass
    return [patient_client(port, "can%d" % (1 + n)) for n in range(3)]


def lockstep_session(disturb=None):
    """300 ticks driven over the gateway with one motor on; disturb(step, run, port) is called
    between the steps. The run and its summary."""
    run = Run("--transport", "local", "--clock", "lockstep", "--hold", "always", "--gateway", "0",
              "--quiet")
    port = run.port()
    client = Client(port, "can0", raw=True)
    tick = 0
    for step in range(30):
        if step == 1:
            client.send(0x001, bytes.fromhex("490D000000"))
            client.send(0x001, bytes.fromhex("0950"))
        if step > 2:
            client.send(0x001, bytes.fromhex("72A600"))
        if disturb:
            disturb(step, run, port)
        client.step(tick, 10)
        tick += 10
    client.close()
    run.process.send_signal(signal.SIGTERM)
    return run, run.end()


def test_in_lockstep_a_stopped_process_simply_goes_on():
    def stop(step, run, unused):
        if step == 10:
            run.process.send_signal(signal.SIGSTOP)
            threading.Timer(1.5, run.process.send_signal, [signal.SIGCONT]).start()

    quiet, expected = lockstep_session()
    stopped, summary = lockstep_session(stop)
    assert summary["state_hash"] == expected["state_hash"]
    assert summary["ticks"] == 300 and summary["pauses"] == 0
    with open(quiet.path("candump.log"), "rb") as a, open(stopped.path("candump.log"), "rb") as b:
        assert a.read() == b.read()


def test_clients_that_flood_the_gateway_change_nothing_and_take_no_memory():
    floods, crowd, resident = [], [], []

    def flood(step, run, port):
        if step == 3:
            floods.extend(Flood(port, "can%d" % n) for n in (1, 2, 3, 4))
            crowd.extend(hostile_crowd(port, 7))
        if 3 < step < 28:
            time.sleep(0.04)
        if step in (10, 27):
            resident.append(resident_kb(run.process))
        if step == 20:
            crowd.extend(hostile_crowd(port, 8))
        if step == 28:
            for one in floods:
                one.stop()

    _, expected = lockstep_session()
    run, summary = lockstep_session(flood)
    for one in crowd:
        one.close()
    sent = sum(one.sent for one in floods)
    told = re.search(r"^gateway: (\d+) clients, (\d+) refused, (\d+) disconnected; "
                     r"(\d+) frames to the buses, (\d+) rejected", run.text(), re.M)
    assert told, run.text()
    print("# %d frames of floods; the gateway had %s clients, refused %s, disconnected %s; "
          "resident %s kB" % (sent, told[1], told[2], told[3], resident))
    # the state is that of a quiet run to the last bit: no frame of the controller's was displaced
    assert summary["state_hash"] == expected["state_hash"]
    assert summary["ticks"] == expected["ticks"] == 300
    assert summary["boards"]["unknown"] == 0
    assert summary["boards"]["timeouts"] == expected["boards"]["timeouts"]
    # every frame that a client got onto a bus was received or counted as lost
    received = sum(bus["rx_frames"] for bus in summary["buses"])
    lost = sum(bus["rx_dropped"] for bus in summary["buses"])
    assert sent > 100000 and int(told[4]) >= sent, (sent, told[4])
    assert received + lost == int(told[4]), (received, lost, told[4])
    with open(run.path("events.log"), encoding="ascii") as events:
        assert lost == 0 or " warning lost " in events.read()
    assert lost == 0 or "frames on receiving" in run.text(), "a warning, also of a quiet run"
    assert int(told[3]) >= 3, "readers that do not read are cut off"
    assert resident[1] - resident[0] < 4096, resident
    check_recording(run, summary)


def test_clients_that_flood_a_real_time_run_do_not_end_it():
    run = Run("--transport", "local", "--clock", "real", "--task", "squat", "--duration", "2",
              "--gateway", "0")
    port = run.port()
    floods = [Flood(port, "can%d" % n) for n in range(5)]
    run.wrote("signals.csv", 60000)
    for one in floods:
        one.stop()
    status = run.process.wait()
    summary = run.end(3 if status == 3 else 0)
    assert summary["ticks"] == 2000 and summary["end"] == "ran its length"
    check_clock(summary)
    check_recording(run, summary)
    # the recorder may be too slow for all that, and then says so
    dropped = summary["recorder"]["frames_dropped"]
    assert (dropped > 0) == (status == 3), (dropped, status)
    assert dropped == 0 or "the disk does not keep up" in run.text()
    assert summary["boards"]["foreign"] > 10000 and summary["boards"]["unknown"] == 0


# ---- disks ----

def limit_files():
    resource.setrlimit(resource.RLIMIT_FSIZE,
                       (300000, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))


def test_a_file_that_may_not_grow_ends_with_a_whole_line_and_the_run_goes_on():
    for clock in ("free", "real"):
        run = Run("--transport", "local", "--clock", clock, "--task", "squat", "--duration", "1.5",
                  prepare=limit_files)
        summary = run.end(3)
        assert summary["ticks"] == 1500
        check_recording(run, summary)
        assert summary["recorder"]["frames_unwritten"] > 0
        assert summary["recorder"]["frames_dropped"] == 0
        assert os.stat(run.path("candump.log")).st_size > 300000 - 256
        assert re.search(r"cannot write \S+/candump\.log: .* the run goes on: File too large",
                         run.text()), run.text()


def test_a_disk_that_is_too_small_is_told_with_what_is_missing():
    script = ('mount -t tmpfs -o size=256k none "$0" || exit 77\n'
              '"$@"; status=$?\n'
              'mkdir "$0.kept" && cp -a "$0/." "$0.kept/"; exit $status\n')
    run = Run("--transport", "local", "--clock", "free", "--task", "squat", "--duration", "1.5",
              before=os.mkdir,
              prefix=["unshare", "-rm", "sh", "-c", script,
                      os.path.join(WORK.name, "run%d" % (Run.count + 1))])
    if run.process.wait() in (1, 77) and "coman-hil" not in run.text():
        return "no mounts in a user namespace here"
    run.directory += ".kept"
    run.end(3)
    assert re.search(r"cannot write \S+: .* the run goes on: No space left", run.text()), run.text()
    told = re.search(
        r"^recorder: (\d+) frames, (\d+) rows, \d+ events; dropped 0 frames, 0 rows, 0 events; "
        r"not written (\d+) frames, (\d+) rows, \d+ events$", run.text(), re.M)
    assert told and int(told[3]) > 0, run.text()
    assert lines(run.path("candump.log")) == int(told[1]) - int(told[3])
    assert lines(run.path("signals.csv")) == 1 + int(told[2]) - int(told[4])
    assert "1500 ticks" in run.text()


class Pipe:
    """A reader of candump.log, which is a pipe: a disk as slow as one wants."""

    def make(self, directory):
        os.mkdir(directory)
        os.mkfifo(os.path.join(directory, "candump.log"))
        self.descriptor = os.open(os.path.join(directory, "candump.log"),
                                  os.O_RDONLY | os.O_NONBLOCK)

    def read_all(self):
        """Until the writer closes it; the number of whole lines."""
        os.set_blocking(self.descriptor, True)
        count = 0
        while piece := os.read(self.descriptor, 65536):
            count += piece.count(b"\n")
        return count

    def close(self):
        os.close(self.descriptor)


def test_a_slow_disk_costs_frames_in_real_time_and_the_loop_does_not_wait():
    pipe = Pipe()
    run = Run("--transport", "local", "--clock", "real", "--task", "squat", "--duration", "3.5",
              rig=os.path.join(CONFIG, "rigs", "coman-foc.yaml"), before=pipe.make)
    # nothing is read until frames are dropped, then everything
    run.says("the disk does not keep up with the recording")
    count = pipe.read_all()
    summary = run.end(3)
    pipe.close()
    recorder = summary["recorder"]
    assert summary["ticks"] == 3500 and summary["pauses"] == 0
    check_clock(summary)
    assert recorder["frames_dropped"] > 0 and recorder["frames_unwritten"] == 0, recorder
    assert count == recorder["frames"]
    sent = sum(bus["tx_frames"] + bus["rx_frames"] for bus in summary["buses"])
    assert recorder["frames"] + recorder["frames_dropped"] == sent, (recorder, sent)
    assert "is not whole" in run.text()


def test_a_slow_disk_is_waited_for_in_virtual_time():
    pipe = Pipe()
    run = Run("--transport", "local", "--clock", "free", "--task", "squat", "--duration", "9",
              before=pipe.make)
    time.sleep(1.0)
    count = pipe.read_all()
    summary = run.end()
    pipe.close()
    assert summary["ticks"] == 9000
    assert count == summary["recorder"]["frames"] > 65536
    assert summary["recorder"]["frames_dropped"] == 0


class Dead:
    """A run whose log nobody ever takes, begun early for it takes long."""

    def begin(self):
        self.pipe = Pipe()
        self.run = Run("--transport", "local", "--clock", "free", "--task", "squat", "--duration",
                       "9",
                       before=self.pipe.make)


dead = Dead()


def test_a_dead_disk_does_not_hold_virtual_time_for_ever():
    summary = dead.run.end(3)
    os.set_blocking(dead.pipe.descriptor, True)
    count = dead.pipe.read_all()
    dead.pipe.close()
    recorder = summary["recorder"]
    assert summary["ticks"] == 9000
    assert "took nothing for 10.0 s: recording ends here, the run goes on" in dead.run.text()
    assert recorder["frames_dropped"] > 0
    assert count == recorder["frames"] - recorder["frames_unwritten"]
    sent = sum(bus["tx_frames"] + bus["rx_frames"] for bus in summary["buses"])
    assert recorder["frames"] + recorder["frames_dropped"] == sent


def test_files_that_are_removed_or_renamed_while_they_are_written():
    runs = [Run("--transport", "local", "--clock", "real", "--task", "squat", "--duration", "2")
            for _ in range(4)]
    removed, renamed, gone, moved = runs
    for run in runs:
        run.wrote("candump.log")
    os.unlink(removed.path("candump.log"))
    os.rename(renamed.path("candump.log"), renamed.path("candump.log.1"))
    shutil.rmtree(gone.directory)
    os.rename(moved.directory, moved.directory + ".moved")

    summary = removed.end(3)
    recorder = summary["recorder"]
    assert ("candump.log was removed while it was written: recording of it ends here"
            in removed.text())
    assert summary["ticks"] == 2000, summary
    assert recorder["frames_unwritten"] == recorder["frames"] > 0, recorder
    assert lines(removed.path("signals.csv")) == 201
    assert not os.path.exists(removed.path("candump.log"))

    summary = renamed.end(0)
    assert "candump.log has another name now: recording goes on in the same file" in renamed.text()
    assert lines(renamed.path("candump.log.1")) == summary["recorder"]["frames"]

    assert gone.end(3) is None
    assert "candump.log was removed" in gone.text() and "signals.csv was removed" in gone.text()
    assert "summary.json" in gone.text() and "2000 ticks" in gone.text()

    assert moved.end(3) is None
    moved.directory += ".moved"
    told = re.search(r"^recorder: (\d+) frames, (\d+) rows, \d+ events; dropped 0 frames",
                     moved.text(), re.M)
    assert told and lines(moved.path("candump.log")) == int(told[1]), moved.text()
    assert lines(moved.path("signals.csv")) == 1 + int(told[2])


if __name__ == "__main__":
    dead.begin()
    try:
        main(globals(), sys.argv[1:])
    finally:
        dead.run.kill()
