#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Overload and loss on vcan, on a kernel that has CAN (run it through tests/bus/uml/run.sh): the
time of day is set, a bus is flooded, simulator and controller are stopped each, interfaces go and
come back, a queue is full. The promises stand in rt/loop.h and canbus/port.h. Prints TAP."""
import csv
import glob
import os
import re
import signal
import socket
import struct
import subprocess
import threading
import time

from overload_run import (NORMAL, PATIENCE_S, PROGRAM, RIG, Run, changed_rig, check_clock,
                          check_grid, check_recording, check_telemetry, log, main)

# the guest's only processor is a slow one: real time at half the rate, so that something is left
# for the others
REAL, TICK_S = ("--clock", "real"), 0.002
STEP, DONE = 0x6F0, 0x6FF
MOTOR_BOARDS = {"can0": (1, 2), "can1": (1, 2, 3), "can2": (1, 2, 3), "can3": (1, 2),
                "can4": (1, 2)}


def command(*words):
    subprocess.run(words, check=True)


def simulate(*arguments):
    """The simulator on vcan, when its buses are open."""
    rig = changed_rig("slow", [NORMAL, (r"^tick_s: 0.001 ",
                                        "tick_s: 0.002 ")]) if "real" in arguments else RIG
    run = Run("--transport", "socketcan", *arguments, rig=rig)
    end = time.monotonic() + PATIENCE_S
    while not os.path.exists(run.path("signals.csv")):
        assert run.process.poll() is None and time.monotonic() < end, run.text()
        time.sleep(0.02)
    return run


def can_frame(identifier, data):
    return struct.pack("=IB3x8s", identifier, len(data), bytes(data))


class Host:
    """A controller without ears: switches all motors to voltage mode and gives each 6 V, again and
    again. An interface that is gone is tried again every time."""

    def __init__(self):
        self.ports = {}
        self.tick = 0

    @staticmethod
    def open(interface, listen=False):
        # to ask for an interface that is not there makes the kernel look for a module, which takes
        # long
        if not os.path.exists("/sys/class/net/" + interface):
            return None
        port = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        port.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, struct.pack("=II", DONE, 0x7FF)
                        if listen else b"")
        port.settimeout(PATIENCE_S)
        try:
            port.bind((interface,))
        except OSError:
            port.close()
            return None
        return port

    def send(self, interface, identifier, data=b""):
        """False when the interface is not there or down."""
        port = self.ports.get(interface) or self.open(interface, interface == "can0")
        self.ports[interface] = port
        try:
            if port:
                port.send(can_frame(identifier, data))
        except OSError:
            port.close()
            self.ports[interface] = port = None
        return port is not None

    def drive(self):
        """Commands for all motors, once."""
        for interface, boards in MOTOR_BOARDS.items():
            for board in boards:
                for axis in (0, 0x80):
                    self.send(interface, board, [axis | 0x09, 0x50])
                    self.send(interface, board, [axis | 0x72, 0xA6, 0])

    def step(self, ticks=10):
        """In lockstep: commands, then so many ticks."""
        self.drive()
        self.send("can0", STEP, struct.pack("<IH", self.tick, ticks))
        self.tick = struct.unpack("<I", self.ports["can0"].recv(16)[8:12])[0]

    def steps_until(self, run, pattern):
        """Steps until the run has written a line; the virtual time in it."""
        end = time.monotonic() + PATIENCE_S
        while not (found := re.search(r"^ *(\d+\.\d+) s: " + pattern, run.text(), re.M)):
            assert time.monotonic() < end and run.process.poll() is None, (pattern,
                                                                           run.text()[-2000:])
            self.step()
            time.sleep(0.002)
        return float(found[1])


class HostThread(Host):
    """The same with a real clock: every 10 ms."""

    def __init__(self):
        super().__init__()
        self.stopped = threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        while not self.stopped.is_set():
            self.drive()
            time.sleep(0.01)

    def stop(self):
        self.stopped.set()
        self.thread.join()


def voltages(run, joint):
    """(time, V) of each row."""
    with open(run.path("signals.csv")) as file:
        return [(float(row["time_s"]), float(row["voltage_%s_v" % joint]))
                for row in csv.DictReader(file)]


def task(*arguments):
    return subprocess.Popen([PROGRAM, "task", "squat", RIG, "--quiet", *arguments],
                            stdin=subprocess.DEVNULL,
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def test_the_time_of_day_may_be_set_while_it_runs():
    run = simulate(*REAL, "--duration", "1.5", "--hold", "always")
    for jump in (3600, -2 * 86400, 86400):
        time.clock_settime(time.CLOCK_REALTIME, time.clock_gettime(time.CLOCK_REALTIME) + jump)
        time.sleep(0.2)
    summary = run.end()
    check_clock(summary, tick_s=TICK_S)
    # a busy machine may have paused it; an hour or a day is more than that
    assert summary["ticks"] == 750 and summary["pause_ticks"] * TICK_S < 60, summary["pause_ticks"]
    check_recording(run, summary)
    check_grid(log(run.path("candump.log")), 1500)


def flood(count):
    return subprocess.Popen(["cangen", "can1", "-g", "0", "-n", str(count), "-I", "7AA", "-L", "8",
                             "-D", "00"],
                            stdin=subprocess.DEVNULL)


def test_a_bus_flooded_with_foreign_identifiers_keeps_lockstep_to_the_bit():
    quiet = Run("--transport", "local", "--clock", "lockstep", "--task", "squat", "--ticks", "300")
    expected = quiet.end()
    run = simulate("--clock", "lockstep", "--ticks", "300")
    noise = flood(5000)    # fewer than the receive buffer holds: nothing may be lost
    controller = task("--clock", "lockstep")
    summary = run.end()
    controller.wait(PATIENCE_S)
    assert noise.wait() == 0 and summary["ticks"] == 300
    assert summary["buses"][1]["rx_dropped"] == 0 and summary["boards"]["foreign"] > 1000
    assert summary["state_hash"] == expected["state_hash"]
    check_recording(run, summary)


def test_a_bus_flooded_in_real_time_is_counted_and_the_others_do_not_notice():
    run = simulate(*REAL, "--hold", "always")
    sent = 10000
    noise = flood(sent)
    assert noise.wait(PATIENCE_S) == 0
    run.passes(5)    # a tick takes more than the receive buffer holds
    run.process.send_signal(signal.SIGTERM)
    status = run.process.wait()
    summary = run.end(status)
    lost, recorder = summary["buses"][1]["rx_dropped"], summary["recorder"]
    print("# %d of %d foreign frames received, %d lost; recorder dropped %d" %
          (summary["boards"]["foreign"], sent, lost, recorder["frames_dropped"]))
    assert summary["boards"]["foreign"] + lost == sent
    assert lost == 0 or "frames on receiving" in run.text()
    assert all(bus["rx_dropped"] == 0 for i, bus in enumerate(summary["buses"]) if i != 1)
    check_clock(summary, tick_s=TICK_S)
    check_recording(run, summary)
    assert (recorder["frames_dropped"] > 0) == (status == 3) and status in (0, 3)


def test_a_stopped_simulator_takes_what_has_piled_up_and_its_motors_are_safe():
    run = simulate(*REAL, "--duration", "1.5", "--hold", "always")
    host = HostThread()
    run.wrote("signals.csv", 40000)
    run.process.send_signal(signal.SIGSTOP)
    time.sleep(2.0)
    host.stop()    # the controller does not survive the pause
    run.process.send_signal(signal.SIGCONT)
    summary = run.end()
    check_clock(summary, tick_s=TICK_S)
    assert summary["ticks"] == 750 and summary["pauses"] >= 1, summary
    assert summary["pause_ticks"] >= 750, summary
    behind = max(float(t) for t in re.findall(
        r"^(\d+\.\d+) s: \d+\.\d s behind: counted as a pause", run.text(), re.M))
    frames = log(run.path("candump.log"))
    check_grid(frames, 1500)
    # everything that waited was received in the first tick after it, in its order
    commands = [stamp * 1e-6 for stamp, _, identifier, _ in frames if identifier < 0x10]
    assert sum(1 for when in commands if behind - 0.0025 < when < behind +
               0.0025) > 1000, len(commands)
    assert not [when for when in commands if when > behind + 0.0025]
    # they count for a command time-out of virtual time, then there is no voltage any more
    volts = voltages(run, "LHipSag")
    early = [value for when, value in volts if behind + 0.005 < when < behind + 0.09]
    late = [value for when, value in volts if when > behind + 0.115]
    assert early and all(value != 0.0 for value in early), early[:3]
    assert late and all(value == 0.0 for value in late), late[:3]
    assert summary["boards"]["timeouts"] >= 23, summary["boards"]


def test_a_controller_that_falls_silent_leaves_motors_safe_and_may_come_back():
    run = simulate(*REAL, "--hold", "always")
    host = HostThread()
    run.says("right_arm/0x02.* from idle to voltage mode")
    run.passes(100)
    host.stop()
    run.says("right_arm/0x02.* the voltage command timed out")
    run.passes(100)
    host = HostThread()
    run.passes(200)
    run.process.send_signal(signal.SIGTERM)
    summary = run.end()
    host.stop()
    check_clock(summary, tick_s=TICK_S)
    assert summary["boards"]["timeouts"] >= 23, summary["boards"]
    with open(run.path("signals.csv")) as file:
        driven = [any(float(row[name]) for name in row if name.startswith("voltage_"))
                  for row in csv.DictReader(file)]
    # motors are driven, then none for a while, then some again
    assert re.fullmatch(r"0*1[01]*?0{10,}1[01]*", "".join("01"[one] for one in driven)), driven


def test_interfaces_that_go_stop_their_motors_only_and_come_back_by_themselves():
    run = simulate("--clock", "lockstep", "--hold", "always")
    host = Host()
    for _ in range(20):
        host.step()
    command("ip", "link", "del", "can1")
    command("ip", "link", "set", "can2", "down")
    gone, down = host.steps_until(run, "bus can1 is gone"), host.steps_until(run,
                                                                             "bus can2 is down")
    for _ in range(20):
        host.step()
    command("ip", "link", "add", "dev", "can1", "type", "vcan")
    command("ip", "link", "set", "can1", "up")
    command("ip", "link", "set", "can2", "up")
    back = host.tick * 0.001
    host.steps_until(run, "bus can1 is up")
    host.steps_until(run, "bus can2 is up")
    for _ in range(20):
        host.step()
    command("ip", "link", "del", "can4")
    host.steps_until(run, "bus can4 is gone")
    for _ in range(20):
        host.step()
    run.process.send_signal(signal.SIGTERM)
    summary = run.end()
    command("ip", "link", "add", "dev", "can4", "type", "vcan")
    command("ip", "link", "set", "can4", "up")
    check_recording(run, summary)
    assert summary["ticks"] == host.tick
    assert [bus["state"] for bus in summary["buses"]] == ["up", "up", "up", "up", "gone"]
    assert [bus["down_events"] for bus in summary["buses"]] == [0, 1, 1, 0, 1]
    assert re.search(r"^ +right_arm +can4 .*%  gone$", run.text(), re.M), run.text()[-2000:]
    # six motors of each leg and four of an arm went to 0 V, once each; the others never
    assert summary["boards"]["timeouts"] == 6 + 6 + 4, summary["boards"]
    for joint, since in (("LHipSag", gone), ("RHipSag", down)):
        volts = voltages(run, joint)
        off = [(when, v) for when, v in volts if since + 0.115 < when <= back]
        assert len(off) > 5 and all(v == 0.0 for _, v in off), (joint, since, back, off)
        assert volts[-1][1] != 0.0, joint
    for joint in ("WaistLat", "LElbj"):
        assert all(v != 0.0 for when, v in voltages(run, joint) if when > 0.05), joint


def test_a_full_queue_keeps_the_newest_frames_and_counts_the_rest():
    module = glob.glob("/usr/lib/uml/modules/*/kernel/net/sched/sch_tbf.ko")
    if not module or subprocess.run(["insmod", module[0]], stderr=subprocess.DEVNULL).returncode:
        return "no sch_tbf in this kernel"
    run = simulate("--clock", "lockstep", "--hold", "always")
    host = Host()
    for board in (1, 2):
        host.send("can3", board,
                  bytes.fromhex("490D000000"))    # POSITION, STATUS, CURRENT every 4 ms
    for _ in range(20):
        host.step()
    full = host.tick
    # a queue of 12 frames that empties at 125 frames a second
    command("tc", "qdisc", "add", "dev", "can3", "root", "tbf", "rate", "16kbit", "burst", "64",
            "limit", "192")
    host.steps_until(run, r"lost \d+ frames on receiving and \d+ on sending")
    command("tc", "qdisc", "del", "dev", "can3", "root")
    host.steps_until(run, "bus can3 is up") if "stuck" in run.text() else None
    for _ in range(30):
        host.step()
    run.process.send_signal(signal.SIGTERM)
    summary = run.end()
    bus = summary["buses"][3]
    print("# queue full %d times, %d kept, %d lost" %
          (bus["tx_queue_full"], bus["tx_held"], bus["tx_dropped"]))
    assert bus["tx_queue_full"] > 0 and bus["tx_held"] > 0 and bus["tx_dropped"] > 0, bus
    assert bus["state"] == "up", bus
    assert all(other["tx_dropped"] == 0 for i, other in enumerate(summary["buses"]) if i != 3)
    check_recording(run, summary)
    frames = log(run.path("candump.log"))
    check_telemetry([f for f in frames if f[0] < full * 1000], "can3", 0x111, 4000)
    check_telemetry([f for f in frames if f[0] > (host.tick - 200) * 1000], "can3", 0x111, 4000)


if __name__ == "__main__":
    import sys
    main(globals(), sys.argv[1:])
