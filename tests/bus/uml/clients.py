#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Unmodified clients against the port and the whole simulator, on can0 to can4 (see run.sh).

clients.py CANBUS_TOOL [COMAN_HIL]

First candump, cansend and cangen of can-utils against our port, byte by byte. Then, when the
program is given, COMAN in lockstep on five buses: python-can discovers the boards, commands a
voltage, reads current and position, and drives virtual time by STEP frames; what it expects is
written from PROTOCOL.md. Prints TAP.
"""
import json
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time
import traceback

try:
    import can
except ImportError:
    print("1..1\nok 1 - clients # SKIP python-can is not installed (Debian package python3-can)")
    sys.exit(0)

TOOL = sys.argv[1]
PROGRAM = sys.argv[2] if len(sys.argv) > 2 else None
SOURCE = os.environ["HIL_SOURCE_DIR"]
WORK = tempfile.mkdtemp()
BUSES = ["can0", "can1", "can2", "can3", "can4"]
STEP, DONE = 0x6F0, 0x6FF
MISMATCH = 1 << 2
PATIENCE_S = 30


def path(name):
    return os.path.join(WORK, name)


def wait_until(condition, what):
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end, "timed out: " + what
        time.sleep(0.02)


def frames_of(log):
    """The frames of a candump log without their times, which differ between two listeners. The bit
    that kernels from 6.1 on set in the flags of every FD frame says nothing and is taken off."""
    return [re.sub(r"##([0-7])", lambda m: "##%X" % (int(m[1]) & 3), line.split(") ", 1)[1])
            for line in open(log).read().splitlines()]


class Candump:
    """candump -L of one interface, error frames included, into a file."""

    def __init__(self, interface, name):
        self.log = path(name)
        before = self.listeners(interface)
        # the default receive buffer holds 278 frames, fewer than are sent in one go here
        self.process = subprocess.Popen(
            ["candump", "-r", "4000000", "-L", interface + ",0:0,#FFFFFFFF"],
            stdout=open(self.log, "w"))
        # it says nothing when it listens: its socket in the kernel's list does
        wait_until(lambda: self.listeners(interface) > before, "candump listens")

    @staticmethod
    def listeners(interface):
        with open("/proc/net/can/rcvlist_all") as listing:
            return len(re.findall(r"^ *%s +000" % interface, listing.read(), re.MULTILINE))

    def stop(self, count=None):
        if count is not None:
            wait_until(lambda: open(self.log).read().count("\n") >= count, "candump has all frames")
        self.process.send_signal(signal.SIGINT)
        self.process.wait(10)
        return frames_of(self.log)


def port_logs_what_candump_logs():
    special = ["123#DEADBEEF", "1ABCDEF0#R", "7FF#R5", "000#", "123##1AABB",
               "20000004#0004000000000000"]
    count = 2 * 400 + len(special)
    candump = Candump("can0", "theirs.log")
    with open(path("ours.log"), "w") as log:
        ours = subprocess.Popen([TOOL, "log", "can0", str(count)],
                                stdout=log, stderr=subprocess.PIPE)
        assert ours.stderr.readline() == b"ready\n"
        subprocess.run(["cangen", "can0", "-g", "1", "-m", "-n", "400"], check=True)
        for frame in special:
            subprocess.run(["cansend", "can0", frame], check=True)
        subprocess.run(["cangen", "can0", "-g", "1", "-n", "400"], check=True)
        assert ours.wait(PATIENCE_S) == 0
    theirs = candump.stop(count)
    assert len(theirs) == count, len(theirs)
    assert frames_of(path("ours.log")) == theirs
    # times: the same to a microsecond up to the offset of the two clocks, frame by frame
    times = [[float(line[1:line.index(")")]) for line in open(path(log))]
             for log in ("theirs.log", "ours.log")]
    offsets = [a - b for a, b in zip(*times)]
    assert max(offsets) - min(offsets) < 0.5, (min(offsets), max(offsets))


def candump_logs_what_port_sends():
    frames = frames_of(path("ours.log"))
    candump = Candump("can0", "sent.log")
    subprocess.run([TOOL, "send", "can0", path("ours.log")], check=True)
    assert candump.stop(len(frames)) == frames


class Host:
    """A controller on five buses that drives virtual time."""

    def __init__(self):
        self.bus = {name: can.interface.Bus(channel=name, interface="socketcan") for name in BUSES}
        self.tick = 0

    def send(self, bus, identifier, data):
        self.bus[bus].send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))

    def until_done(self, bus):
        """Frames (id, data) of the bus up to its DONE, and what the DONE says."""
        frames = []
        while True:
            message = self.bus[bus].recv(PATIENCE_S)
            assert message is not None, "no DONE on " + bus
            if message.arbitration_id == DONE and not message.is_extended_id:
                assert message.dlc == 6
                return frames, struct.unpack("<IH", message.data)
            frames.append((message.arbitration_id, bytes(message.data)))

    def step(self, ticks, buses=BUSES):
        """Runs ticks; returns the frames of each of the buses. At most 40 ticks a STEP: a socket of
        default size holds 278 frames, and while one bus is read the others wait."""
        result = {bus: [] for bus in buses}
        while ticks > 0:
            part = min(ticks, 40)
            ticks -= part
            self.send("can0", STEP, struct.pack("<IH", self.tick, part))
            self.tick += part
            for bus in buses:
                frames, (tick, flags) = self.until_done(bus)
                assert (tick, flags & MISMATCH) == (self.tick, 0), (bus, tick, self.tick, flags)
                result[bus] += frames
        return result

    def forget(self):
        """Takes away what waits on all buses."""
        for bus in self.bus.values():
            while bus.recv(0.0) is not None:
                pass

    def ask(self, bus, identifier, data, ticks=2):
        self.send(bus, identifier, data)
        return self.step(ticks)[bus]


class Simulator:
    def __init__(self):
        self.record = path("record")
        self.output = open(path("simulator.txt"), "w+")
        self.process = subprocess.Popen(
            [PROGRAM, "run", SOURCE + "/config/rigs/coman.yaml", "--clock", "lockstep",
             "--transport", "socketcan", "--hold", "always", "--quiet", "--record", self.record],
            stdin=subprocess.DEVNULL, stdout=self.output, stderr=subprocess.STDOUT)

    def text(self):
        return open(path("simulator.txt")).read()

    def stop(self):
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(PATIENCE_S)


def simulator_answers_a_step_of_the_wrong_tick_and_does_not_move():
    # the first STEP that is answered: before, the simulator may not have been there yet
    end = time.monotonic() + PATIENCE_S
    answer = None
    while answer is None and time.monotonic() < end:
        assert SIMULATOR.process.poll() is None, SIMULATOR.text()
        HOST.send("can0", STEP, struct.pack("<IH", 12345, 1))
        answer = HOST.bus["can0"].recv(0.5)
    assert answer is not None, SIMULATOR.text()
    assert answer.arbitration_id == DONE and bytes(answer.data) == struct.pack("<IH", 0, MISMATCH)
    time.sleep(1.0)
    HOST.forget()  # further refusals, of the STEPs that had waited


def discovery_finds_every_board():
    expected = {"can0": {1: 4, 2: 4, 0xC: 6}, "can1": {1: 4, 2: 4, 3: 4, 0xD: 6, 0xC: 6},
                "can2": {1: 4, 2: 4, 3: 4, 0xE: 6, 0xB: 6}, "can3": {1: 4, 2: 4, 0xD: 6, 0xC: 6},
                "can4": {1: 4, 2: 4, 0xE: 6, 0xB: 6}}
    for bus in BUSES[1:]:
        HOST.send(bus, 0x70F, [0xFF])
    subprocess.run(["cansend", "can0", "70F#FF"], check=True)
    frames = HOST.step(2)
    for bus in BUSES:
        # our own question on can0 comes from another socket, so it is seen as well
        replies = [f for f in frames[bus] if f[0] >> 8 == 7 and f[0] != 0x70F]
        found = {(i & 0xF0) >> 4: data[1] for i, data in replies}
        assert found == expected[bus], (bus, replies)
        for identifier, data in replies:
            assert identifier & 0xF == 0 and len(data) == 5 and data[0] == 0xFF, \
                (bus, identifier, data)


def firmware_version_is_told_with_a_positive_protocol_check():
    frames = HOST.ask("can1", 0x001, [0x5B, 1, 6])
    replies = [d for i, d in frames if i == 0x010]
    assert len(replies) == 1 and len(replies[0]) == 8, frames
    assert replies[0][:2] == b"\x5B\x04" and replies[0][5:] == b"\x01\x06\x01", replies


def boards_are_silent_until_a_policy_is_set():
    motor = [i for i, _ in HOST.step(20)["can1"] if i >> 8 == 1]
    assert motor == [], motor


def telemetry_comes_every_four_ticks_by_policy():
    # the host's default and MOTOR_POSITION
    HOST.send("can1", 0x001, [0x49, 0x7F, 0x02, 0, 0])
    HOST.step(4)
    frames = HOST.step(40)["can1"]
    counts = {kind: sum(1 for i, _ in frames if i == 0x110 | kind) for kind in (1, 2, 4, 7)}
    assert counts == {1: 10, 2: 10, 4: 10, 7: 10}, counts
    assert all(len(d) == 8 for i, d in frames if i in (0x111, 0x112, 0x114)), frames


def voltage_in_current_out():
    """15 % of 48 V on LHipSag, at rest 10.8 A of the 12 A where it trips, its link clamped: the
    mode is echoed, the winding takes current, the rotor winds its spring, the joint encoder stands
    still."""
    start = [struct.unpack("<ii", d) for i, d in HOST.step(8)["can1"] if i == 0x111][-1]
    frames = HOST.ask("can1", 0x001, [0x09, 0x50], ticks=4)
    status = [d for i, d in frames if i == 0x113]
    assert status and len(status[-1]) == 8 and status[-1][:2] == b"\x00\x50", frames
    frames = HOST.ask("can1", 0x001, bytes.fromhex("72C800"), ticks=24)
    pwm = [struct.unpack("<4h", d) for i, d in frames if i == 0x112]
    current = [struct.unpack("<4h", d) for i, d in frames if i == 0x114]
    position = [struct.unpack("<ii", d) for i, d in frames if i == 0x111]
    assert pwm[-1][2:] == (200, 0), pwm
    assert max(c[0] for c in current) > 500, current
    assert all(c[2:] == (0, 0) for c in current), current
    rotor = [struct.unpack("<ii", d) for i, d in frames if i == 0x11A]
    assert abs(position[-1][0] - start[0]) <= 1, (start, position)
    assert rotor[-1][0] - rotor[0][0] > 600 and rotor[-1][1] == rotor[0][1], rotor  # over 9 mrad
    frames = HOST.ask("can1", 0x001, [0x72])
    assert frames.count((0x010, bytes.fromhex("72C800"))) == 0  # a SET of the wrong length: nothing
    assert (0x010, bytes.fromhex("73C800")) in HOST.ask("can1", 0x001, [0x73])


def stale_voltage_falls_to_zero():
    last = [struct.unpack("<4h", d) for i, d in HOST.step(40)["can1"] if i == 0x112][-1]
    assert last[2] == 200, last
    last = [struct.unpack("<4h", d) for i, d in HOST.step(80)["can1"] if i == 0x112][-1]
    assert last[2] == 0, last
    # the wound spring turns the shorted motor back: its current decays with the spring
    current = [struct.unpack("<4h", d)[0] for i, d in HOST.step(400)["can1"] if i == 0x114]
    assert 0 <= current[-1] < current[0] / 2, current
    assert all(b <= a + 1 for a, b in zip(current, current[1:])), current


def strain_boards_send_what_the_host_starts():
    """The pseudo-STRAIN of the leg: full scale by channel, then frames at its period, len 6."""
    frames = HOST.ask("can1", 0x20C, [0x18, 0])
    reply = [d for i, d in frames if i == 0x2C0]
    assert len(reply) == 1 and len(reply[0]) == 4 and reply[0][:2] == b"\x18\x00", frames
    HOST.send("can1", 0x20D, [0x08, 5])
    HOST.send("can1", 0x20D, [0x07, 0])
    HOST.step(10)
    frames = HOST.step(50)["can1"]
    for identifier in (0x3DA, 0x3DB):
        data = [d for i, d in frames if i == identifier]
        assert len(data) == 10 and all(len(d) in (6, 7) for d in data), (identifier, data)


def log_of_the_simulator_is_that_of_candump():
    candump = Candump("can2", "can2.log")
    HOST.send("can2", 0x002, [0x49, 0x7F, 0, 0, 0])
    frames = HOST.ask("can2", 0x70F, [0xFF], ticks=40)
    return candump.stop(2 + len(frames) + 1)  # what was sent, what came, the DONE


def random_frames_do_no_harm():
    floods = [subprocess.Popen(["cangen", bus, "-g", "0", "-m", "-i", "-n", "5000"])
              for bus in BUSES[1:]]
    # random 11-bit identifiers on the STEP's bus too, but none of its commands
    for number in range(500):
        HOST.send("can0", number * 37 % 0x6F0, os.urandom(number % 9))
    # the sockets of this script overflow on the flooded buses, so only the quiet one counts
    while any(flood.poll() is None for flood in floods):
        HOST.step(1, ["can0"])
    HOST.step(20, ["can0"])
    HOST.forget()
    assert SIMULATOR.process.poll() is None, SIMULATOR.text()
    # it still answers
    HOST.send("can3", 0x70F, [0xFF])
    replies = [i for i, _ in HOST.step(4)["can3"] if i >> 8 == 7 and i != 0x70F]
    assert {0x710, 0x720, 0x7D0, 0x7C0} <= set(replies), replies


def simulator_stops_clean_and_has_counted():
    assert SIMULATOR.stop() == 0, SIMULATOR.text()
    summary = json.load(open(SIMULATOR.record + "/summary.json"))
    assert summary["ticks"] == HOST.tick, (summary["ticks"], HOST.tick)
    for bus in summary["buses"][1:]:
        # of 5000 about half were FD, which a classic port is not given
        assert bus["rx_frames"] + bus["rx_dropped"] > 2000, bus
    boards = summary["boards"]
    assert boards["timeouts"] >= 1, boards
    assert boards["unknown"] + boards["malformed"] + boards["foreign"] > 1000


def recording_has_the_bytes_that_candump_has_seen():
    ours = [f for f in frames_of(SIMULATOR.record + "/candump.log") if f.startswith("can2 ")]
    theirs = SEEN_ON_CAN2
    assert theirs and len(theirs) > 20, theirs
    joined = "\n".join(ours) + "\n"
    assert "\n".join(theirs) + "\n" in joined, (theirs[:5], ours[:5])


NUMBER = 0
FAILED = 0


def run(test):
    global NUMBER, FAILED
    NUMBER += 1
    result = None
    try:
        result = test()
        print("ok %d - %s" % (NUMBER, test.__name__))
    except Exception:  # one test's failure is its own: the next may still tell something
        FAILED += 1
        print("not ok %d - %s" % (NUMBER, test.__name__))
        for line in traceback.format_exc().splitlines():
            print("# " + line[:600])
    sys.stdout.flush()
    return result


PORT_TESTS = [port_logs_what_candump_logs, candump_logs_what_port_sends]
SIMULATOR_TESTS = [
    simulator_answers_a_step_of_the_wrong_tick_and_does_not_move, discovery_finds_every_board,
    firmware_version_is_told_with_a_positive_protocol_check,
    boards_are_silent_until_a_policy_is_set, telemetry_comes_every_four_ticks_by_policy,
    voltage_in_current_out, stale_voltage_falls_to_zero, strain_boards_send_what_the_host_starts]
LAST_TESTS = [random_frames_do_no_harm, simulator_stops_clean_and_has_counted,
              recording_has_the_bytes_that_candump_has_seen]

print("1..%d" % (len(SIMULATOR_TESTS) + 1 + len(LAST_TESTS) if PROGRAM else len(PORT_TESTS)))
if PROGRAM:
    SIMULATOR = Simulator()
    HOST = Host()
    for one in SIMULATOR_TESTS:
        run(one)
    SEEN_ON_CAN2 = run(log_of_the_simulator_is_that_of_candump)
    for one in LAST_TESTS:
        run(one)
    if SIMULATOR.process.poll() is None:
        SIMULATOR.process.kill()
else:
    for one in PORT_TESTS:
        run(one)
sys.exit(FAILED != 0)
