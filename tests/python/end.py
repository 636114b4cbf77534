#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Simulators that do not start, die, hang, are stopped or left behind: each is an exception that
says why, soon, and nothing stays. Prints TAP.
"""
import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

import area
from area import raises, rig

SOON_S = 30
RIG = rig("coman-fd")


def is_running(pid):
    """A zombie is not."""
    try:
        return pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def waits_until(condition):
    end = time.monotonic() + SOON_S
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()


def test_a_newer_protocol_of_the_control_socket_is_refused():
    from coman_hil import Control, SimulatorError
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX) as server:
        path = os.path.join(folder, "newer")
        server.bind(path)
        server.listen(1)

        def answer():
            with server.accept()[0] as client:
                client.recv(4096)
                client.sendall(b'{"id": 1, "ok": true, "version": "9.0.0", "protocol": 2}\n')

        thread = threading.Thread(target=answer)
        thread.start()
        with raises(SimulatorError, "newer: found protocol 2, expected 1", "coman-hil 9.0.0"):
            Control(path, 20)
        thread.join(20)
        with raises(SimulatorError, "none: No such file", "coman-hil run RIG"):
            Control(os.path.join(folder, "none"))


def test_an_end_leaves_nothing():
    from coman_hil import Simulator
    with Simulator(RIG) as sim:
        pid, folder = sim.pid, os.path.dirname(sim.control.path)
        sim.step(10)
        assert is_running(pid) and os.path.isdir(folder)
    assert not is_running(pid) and not os.path.exists(folder)
    assert sim.exit_status == 0 and "state hash" in sim.log and "10 ticks" in sim.log
    sim.close()
    with raises(ValueError, "block"):
        with Simulator(RIG) as sim:
            pid = sim.pid
            raise ValueError("of the block")
    assert not is_running(pid)


def test_a_wrong_rig_is_told_with_its_reason():
    from coman_hil import RigError, Simulator
    with raises(RigError, "nobody"):
        Simulator("nobody").start()
    with raises(RigError, "nowhere/none.yaml"):
        Simulator("nowhere/none.yaml").start()
    with raises(RigError, ": changes: ", "fixed_bass", "fixed_base"):
        Simulator(RIG, changes={"robot": {"fixed_bass": True}}).start()
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "mine.yaml")
        path.write_text("name: mine\nbuses: 7\n")
        with raises(RigError, f"{path}:2:8"):
            Simulator(path).start()
        with raises(RigError, f" {path}:2:8"):
            Simulator(path, changes={"name": "other"}).start()


def test_a_wrong_program_is_told():
    from coman_hil import ProgramNotFound, SimulatorError, Simulator
    with raises(ProgramNotFound, "/nowhere/coman-hil", "COMAN_HIL"):
        Simulator(RIG, program="/nowhere/coman-hil").start()
    with raises(SimulatorError):
        Simulator(RIG, program="/bin/false").start()


def test_a_simulator_that_refuses_to_run_says_why():
    from coman_hil import SimulatorDied, Simulator
    with tempfile.TemporaryDirectory() as folder:
        tempfile.tempdir = folder
        try:
            with raises(SimulatorDied, "start", "with status 2", "Nobody"):
                Simulator(RIG, faults=["motor Nobody jam"]).start()
            with raises(SimulatorDied, "with status 2", "--bogus"):
                Simulator(RIG, options=["--bogus"]).start()
        finally:
            tempfile.tempdir = None
        assert not os.listdir(folder)


def test_a_simulator_that_is_killed_is_told():
    from coman_hil import SimulatorDied, Simulator
    with raises(SimulatorDied, "tick 10", "by signal 9", "gateway: 127.0.0.1"):
        with Simulator(RIG) as sim:
            sim.step(10)
            os.kill(sim.pid, signal.SIGKILL)
            sim.step(10)
    with raises(SimulatorDied, "control socket", "by signal 9"):
        with Simulator(RIG) as sim:
            os.kill(sim.pid, signal.SIGKILL)
            sim.state_hash()
    # nobody asks it any more
    with raises(SimulatorDied, "end", "by signal 9"):
        with Simulator(RIG) as sim:
            os.kill(sim.pid, signal.SIGKILL)
            assert waits_until(lambda: not is_running(sim.pid))
    assert sim.exit_status == -signal.SIGKILL


def test_a_run_that_is_over_is_told():
    from coman_hil import SimulatorStopped, Simulator
    with raises(SimulatorStopped, "the run is over", "state hash"):
        with Simulator(RIG) as sim:
            sim.control.request("stop")
            sim.step()
            sim.step()
    with raises(SimulatorStopped, "the run is over"):
        with Simulator(RIG, options=["--duration", "0.02"]) as sim:
            sim.step(15)
            sim.step(15)
    assert sim.tick == 20 and sim.exit_status == 0


def test_a_simulator_that_hangs_is_a_time_out():
    from coman_hil import SimulatorTimeout, Simulator
    with Simulator(RIG, timeout_s=0.5) as sim:
        sim.step()
        os.kill(sim.pid, signal.SIGSTOP)
        try:
            begin = time.monotonic()
            with raises(SimulatorTimeout, "tick 1: no answer to STEP within 0.5 s"):
                sim.step()
            with raises(SimulatorTimeout, "no answer within 0.5 s"):
                sim.state_hash()
            assert time.monotonic() - begin < SOON_S
        finally:
            os.kill(sim.pid, signal.SIGCONT)
    with tempfile.TemporaryDirectory() as folder:
        program = pathlib.Path(folder, "silent")
        program.write_text(f'#!/bin/sh\n[ "$1" = run ] || exec {sys.argv[1]} "$@"\nexec sleep 60\n')
        program.chmod(0o755)
        with raises(SimulatorTimeout, "not ready after 0.5 s", "(nothing)"):
            Simulator(RIG, program=str(program), start_timeout_s=0.5).start()


def test_somebody_else_who_moves_time_is_told():
    from coman_hil import GatewayError, Simulator
    with Simulator(RIG) as sim:
        sim.step(5)
        sim.control.request("step", count=7)
        sim.control.request("resume")
        with raises(GatewayError, "at tick 12, expected 6", "moves its time"):
            sim.step()
        sim.step(3)
        assert sim.tick == 15 and sim.status()["tick"] == 15


def one_by_one(receive):
    """receive_frames, one frame a call: what is still on its way comes late."""
    waiting = []

    def receive_one(timeout_s):
        if not waiting:
            waiting.extend(receive(timeout_s))
        return [waiting.pop(0)] if waiting else []
    return receive_one


def test_the_done_of_a_ctl_step_answers_no_step():
    from coman_hil import GatewayError, Simulator
    with Simulator(RIG) as sim:
        sim.bus.receive_frames = one_by_one(sim.bus.receive_frames)
        tick = 0
        for count, ticks in ((7, 1), (1, 3), (3, 5), (2, 1)):
            sim.control.request("step", count=count)
            sim.control.request("resume")
            wrong = f"at tick {tick + count}, expected {tick + ticks}"
            with raises(GatewayError, wrong, "moves its time"):
                sim.step(ticks)
            sim.step(4)
            tick += count + 4
            assert sim.tick == tick and sim.status()["tick"] == tick
        # two of them, the second where a STEP from the first would end
        for _ in range(2):
            sim.control.request("step", count=2)
            sim.control.request("resume")
        with raises(GatewayError, f"at tick {tick + 4}, expected {tick + 1}"):
            sim.step()
        sim.step(3)
        assert sim.tick == tick + 7


def test_a_ctl_step_as_long_as_the_next_step_is_told():
    from coman_hil import GatewayError, Simulator
    with Simulator(RIG) as sim:
        sim.step(5)
        sim.control.request("step", count=3)
        sim.control.request("resume")
        with raises(GatewayError, "did not run the STEP to tick 8", "moves its time"):
            sim.step(3)     # its refusal may come after the DONE that says the same tick
            sim.step(2)
        sim.step(11 - sim.tick)
        assert sim.tick == 11 and sim.status()["tick"] == 11


def test_a_ctl_step_that_stays_paused_is_a_time_out_with_the_reason():
    from coman_hil import SimulatorTimeout, Simulator
    with Simulator(RIG, timeout_s=0.5) as sim:
        sim.step(5)
        sim.control.request("step", count=7)
        with raises(SimulatorTimeout, "tick 5: no answer", "at tick 12", "moves its time"):
            sim.step()


def test_frames_that_come_in_pieces_are_whole():
    from coman_hil import GatewayBus, GatewayError

    def serve(server):
        peer, _ = server.accept()
        for question in (b"", b"< open all >", b"< rawmode >"):
            assert peer.recv(len(question)) == question
            peer.sendall(b"< ok >" if question else b"< hi >")
        for byte in "\n< frame 113 0.012000 0050 torso >\n< rtr 7FF 0.013000 2 torso >":
            peer.sendall(byte.encode())
            time.sleep(0.001)
        peer.close()

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=serve, args=(server,))
        thread.start()
        with GatewayBus(*server.getsockname()) as bus:
            first, second = bus.recv(SOON_S), bus.recv(SOON_S)
            with raises(GatewayError, "closed the connection"):
                bus.recv(SOON_S)
        thread.join()
    assert (first.arbitration_id, first.data.hex(), first.channel) == (0x113, "0050", "torso")
    assert second.is_remote_frame and second.timestamp == 0.013


def test_simulators_do_not_meet():
    from coman_hil import Simulator
    with Simulator(RIG) as first, Simulator(RIG) as second:
        first.step(3)
        second.step(5)
        assert (first.tick, second.tick) == (3, 5) and first.pid != second.pid


LEFT = """
import sys, time
sys.path.insert(0, {package!r})
from coman_hil import Simulator
sim = Simulator({rig!r})
sim.start()
print(sim.pid, flush=True)
{then}
"""


def test_nothing_runs_on_when_python_ends():
    with tempfile.TemporaryDirectory() as folder:
        leave_simulators(folder)


def leave_simulators(folder):
    for then, patient in (("sys.exit()", True), ("raise KeyboardInterrupt", True),
                          ("time.sleep(60)", False)):
        text = LEFT.format(package=str(area.PACKAGE), rig=RIG, then=then)
        python = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE,
                                  stderr=subprocess.DEVNULL, text=True,
                                  env=dict(os.environ, TMPDIR=folder))
        try:
            pid = int(python.stdout.readline())
            if patient:
                python.wait(SOON_S)
        finally:
            python.kill()
            python.wait()
        assert waits_until(lambda: not is_running(pid)), then
        assert not patient or not os.listdir(folder), then


area.main(globals())
