#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Robots in lockstep by the names of their joints, for each protocol: commands reach their joint
and telemetry is what the plant has, runs repeat bit for bit, faults, pushes, checkpoints. Prints
TAP, and how many steps a second there were.
"""
import math
import time

import area
from area import BENCH, KINDS, RIGS, raises, rig

LINK_TICK = 2 * math.pi / 4096      # of config/rigs/coman.yaml
MOTOR_TICK = 2 * math.pi / 409600
# what a count of current and torque is at most, in any of the protocols
CURRENT_COUNT, TORQUE_COUNT = 0.01, 0.032


def truth(sim, *signals):
    """The plant's own values at this tick, through the control socket."""
    sim.control.rows.clear()
    sim.control.subscribe(*signals, period_ms=1e3 * sim.tick_s)
    sim.step()
    sim.state_hash()    # rows come before the answers of the loop
    sim.control.request("unsubscribe")
    return sim.control.rows[-1]["values"]


def test_a_voltage_moves_its_joint_the_right_way():
    from coman_hil import Simulator
    for kind in KINDS:
        for volts in (3, -3):
            with Simulator(rig(kind), changes=BENCH) as sim:
                sim.enable("RShLat", "LElbj")
                joint, start = sim.joints["LElbj"], sim.status()["joints"]
                joint.voltage_v = volts
                sim.step(60)
                end = sim.status()["joints"]
                moved = end["LElbj"] - start["LElbj"]
                assert 0.02 < moved * math.copysign(1, volts) < 1, (kind, volts, moved)
                assert abs(joint.motor_position_rad - end["LElbj"]) < 0.05
                others = [abs(end[name] - start[name]) for name in end if name.startswith("RSh")]
                assert max(others) < abs(moved) / 2, (kind, volts, moved, others)
                assert joint.is_on and joint.faults == 0


def test_each_joint_has_its_own_voltage():
    """On every rig that drives all joints without a calibration, and whose boards take voltages;
    the plant says which terminal voltage each motor has."""
    from coman_hil import Simulator
    others = {RIGS / f"coman-{kind}.yaml" for kind in
              ("cia402", "cia402-imu", "cubemars-mit", "cubemars-servo", "damiao", "described",
               "foc-leg", "mini-cheetah", "moteus", "myactuator-rmd", "odrive", "rest-bus",
               "robstride", "robstride-mit", "strict", "vesc")}
    others |= {RIGS / "hyq.yaml", RIGS / "hyq-leg.yaml", RIGS / "xl330-pendulum.yaml",
               RIGS / "ak80-6-pendulum.yaml", RIGS / "sea-rmd-x8.yaml", *RIGS.glob("arm-*.yaml")}
    for path in sorted(set(RIGS.glob("*.yaml")) - others):
        with Simulator(path, hold="always") as sim:
            sim.enable()
            passive = 2 if path.stem == "walk-hips" else 0
            assert len(sim.joints) == len(sim.status()["joints"]) - passive >= 23, path
            for number, joint in enumerate(sim.joints.values()):
                joint.voltage_v = (-1) ** number * (0.5 + number / 10)
            sim.step(20)
            found = truth(sim, *(f"voltage_{name}_v" for name in sim.joints))
            protocol, supply_v = next(iter(sim.buses.buses.values())).protocol, sim.get("supply_v")
            # half a count of the bridge; that of foc boards takes 32 of the bus for one, whole ones
            half = {"icub": supply_v / 1333 / 2, "compact": 2e-3 / 2, "foc": supply_v / 32e3 / 2}
            short = 32 * supply_v / 32e3 if protocol == "foc" else 0
            for value, joint in zip(found, sim.joints.values()):
                missing = math.copysign(1, value) * (joint.voltage_v - value)
                assert -1.001 * half[protocol] <= missing <= 1.001 * half[protocol] + short, (
                    path.name, joint, value)


def test_a_voltage_is_limited_to_the_supply():
    from coman_hil import Simulator
    for kind in KINDS:
        with Simulator(rig(kind), hold="always") as sim:
            sim.enable("LElbj", "RElbj")
            sim.joints["LElbj"].voltage_v, sim.joints["RElbj"].voltage_v = 1000, -1000
            left, right = truth(sim, "voltage_LElbj_v", "voltage_RElbj_v")
            assert 0.9 * 48 < left <= 48 and right == -left, (kind, left, right)


def test_telemetry_is_what_the_plant_has():
    from coman_hil import NoTelemetry, Simulator
    for kind in KINDS:
        with Simulator(rig(kind), hold="always") as sim:
            sim.enable()
            for number, joint in enumerate(sim.joints.values()):
                joint.voltage_v = 0.2 + number / 20     # each its own current and deflection
            sim.step(1500)                              # to rest
            names = list(sim.joints)
            motor = truth(sim, *(f"qm_{name}_rad" for name in names))
            current = truth(sim, *(f"current_{name}_a" for name in names))
            torque = truth(sim, *(f"torque_{name}_nm" for name in names))
            angle = sim.status()["joints"]
            for number, joint in enumerate(sim.joints.values()):
                assert abs(joint.motor_position_rad - motor[number]) <= MOTOR_TICK, (kind, joint)
                assert abs(joint.current_a - current[number]) <= CURRENT_COUNT, (kind, joint)
                assert abs(joint.torque_nm - torque[number]) <= TORQUE_COUNT, (
                    kind, joint, joint.torque_nm, torque[number])
                if kind == "coman-foc":
                    with raises(NoTelemetry, "foc boards do not report the position"):
                        joint.position_rad
                else:
                    assert abs(joint.position_rad - angle[joint.name]) <= LINK_TICK, (kind, joint)
            assert len({round(value, 2) for value in current}) == len(names)


def test_force_sensors_have_names():
    """A robot that is tipped over to its right stands on that foot alone; each sensor feels what
    the plant says that the ground pushes its foot with, the hands feel nothing."""
    from coman_hil import NoTelemetry, Simulator
    for kind in KINDS:
        with Simulator(rig(kind), settle=True, hold="none") as sim:
            with raises(NoTelemetry, "l_arm_ft"):
                sim.sensors["l_arm_ft"].force_n
            sim.listen()
            sim.push("Waist", force_n=(0, -100, 0), moment_nm=(60, 0, 0))
            sim.step(38)
            ground = {"LFoot": [], "RFoot": []}
            for _ in range(7):          # the slowest report every 5 ms
                sim.step()
                for foot, seen in ground.items():
                    seen.append(sim.status()["contacts"][foot])
            right = sim.sensors["r_leg_ft"]
            assert min(ground["RFoot"]) > 200 and max(ground["LFoot"]) == 0, (kind, ground)
            assert min(ground["RFoot"]) - 1 < right.force_n[2] < max(ground["RFoot"]) + 1, (
                kind, ground, right.force_n)
            assert abs(right.moment_nm[0]) > 0.1, right.moment_nm
            for name in ("l_leg_ft", "l_arm_ft", "r_arm_ft"):
                assert math.hypot(*sim.sensors[name].force_n) < 0.1, (kind, name)


def session(kind, volts=2.0, **keys):
    """Drives two arms; the state after it."""
    from coman_hil import Simulator
    with Simulator(rig(kind), **keys) as sim:
        sim.enable()
        for number in range(60):
            sim.joints["LElbj"].voltage_v = volts * math.sin(number / 5)
            sim.joints["RElbj"].voltage_v = volts * math.cos(number / 5)
            sim.step(1 + number % 7)
        return sim.state_hash()


def test_runs_repeat_bit_for_bit():
    for kind in KINDS:
        hashes = {session(kind, changes=BENCH) for _ in range(2)}
        assert len(hashes) == 1, (kind, hashes)
        assert hashes != {session(kind, 2.1, changes=BENCH)}, kind


def test_a_checkpoint_repeats_what_followed():
    from coman_hil import Simulator
    for kind in KINDS:
        with Simulator(rig(kind), changes=BENCH) as sim:
            sim.enable("LElbj")
            joint = sim.joints["LElbj"]

            def go_on():
                for number in range(10):
                    joint.voltage_v = number / 2
                    sim.step(3)
                return sim.tick, sim.state_hash(), joint.motor_position_rad

            joint.voltage_v = 1.5
            sim.step(20)
            sim.checkpoint(2)
            before = sim.tick, joint.voltage_v, joint.motor_position_rad
            first = go_on()
            sim.restore(2)
            assert (sim.tick, joint.voltage_v, joint.motor_position_rad) == before, kind
            assert go_on() == first, kind
            sim.control.checkpoint(3)       # not through the package: only the state is known
            sim.step(5)
            sim.restore(3)
            assert (sim.tick, sim.state_hash()) == first[:2] and joint.enabled
            sim.reset()
            assert sim.tick == 0 and not joint.enabled
            sim.enable("LElbj")
            assert joint.is_on


def test_the_status_is_of_the_last_tick():
    from coman_hil import Simulator
    with Simulator(rig("coman-fd"), hold="always") as sim:
        sim.step(3)
        sim.checkpoint()
        for tick in range(4, 300):
            sim.step()
            assert sim.status()["tick"] == tick
        sim.restore()
        assert sim.status()["tick"] == 3


def test_a_fault_is_switched_by_its_name():
    from coman_hil import ControlError, Simulator
    with Simulator(rig("coman-fd"), changes=BENCH,
                   faults=["jam: motor LElbj jam manual"]) as sim:
        sim.enable("LElbj")
        joint = sim.joints["LElbj"]
        sim.fault("jam")
        joint.voltage_v = 2
        start = joint.motor_position_rad
        sim.step(50)
        assert sim.status()["faults"] == ["jam"]
        assert abs(joint.motor_position_rad - start) < 1e-3 and joint.current_a > 0.5
        sim.fault("jam", False)
        sim.step(50)
        assert sim.status()["faults"] == [] and joint.motor_position_rad - start > 0.01
        with raises(ControlError, 'found no fault "ham"', '"jam"'):
            sim.fault("ham")


def test_a_push_moves_what_is_pushed():
    from coman_hil import ControlError, Simulator
    with Simulator(rig("coman-compact"), changes=BENCH) as sim:
        sim.checkpoint()
        sim.step(50)
        alone = sim.status()["joints"]
        sim.restore()
        sim.push("LElb", force_n=(20, 0, 0), duration_s=0.05)
        sim.step(50)
        pushed = sim.status()["joints"]
        apart = {name: abs(pushed[name] - alone[name]) for name in alone}
        assert apart["LShSag"] > 0.01 and apart["RKneeSag"] < 1e-6, apart
        with raises(ControlError, "LElb"):
            sim.push("LElbow")


def test_tunables_are_read_and_set():
    from coman_hil import ControlError, Simulator
    with Simulator(rig("coman-compact"), hold="always") as sim:
        assert sim.get("supply_v") == 48
        sim.set("supply_v", 40)
        sim.listen()
        sim.step(60)
        assert sim.get("supply_v") == 40
        state = sim.received("torso", "torso_0x01_STATE_0")[-1]
        assert [v for name, v in state.items() if name.endswith("_supply")] == [40], state
        with raises(ControlError, "expected 0 to 96"):
            sim.set("supply_v", 400)


def test_what_was_sent_takes_part_in_the_next_tick():
    """By hand, with python-can's messages and those of the DBC."""
    import can
    from coman_hil import UnknownName, Simulator
    with Simulator(rig("coman"), hold="always") as sim:
        for bus in sim.buses.buses:
            sim.send(can.Message(arbitration_id=0x70F, data=b"\xff", channel=bus,
                                 is_extended_id=False))
        sim.step(2)
        for bus in sim.buses.buses:
            answers = [f for f in sim.frames(bus) if f.data[0] == 0xff]
            assert len(answers) == len(sim.buses.bus(bus).boards) - 2, bus     # host, simulator
        sim.command("torso", "torso_0x01_COMMAND", command="GET_CONTROL_MODE_1")
        sim.step()
        assert sim.received("torso", "torso_0x01_REPLY") == [
            {"command": "GET_CONTROL_MODE_1", "GET_CONTROL_MODE_mode_1": "idle"}]
        sim.step(5)     # what was sent is sent once
        assert not sim.received("torso", "torso_0x01_REPLY") and not sim.frames()
        with raises(UnknownName, "found no bus 'arm'"):
            sim.send(can.Message(arbitration_id=1, channel="arm"))
        with raises(UnknownName, "found no joint 'LElbow'", "'LElbj'"):
            sim.joints["LElbow"]
        with raises(ValueError, "expected 1 or more"):
            sim.step(0)
        with raises(ValueError, "expected a number"):
            sim.joints["LElbj"].voltage_v = math.nan


def test_a_voltage_for_a_motor_that_is_not_enabled_is_refused():
    from coman_hil import BoardError, Simulator
    with Simulator(rig("coman"), hold="always") as sim:
        left = sim.joints["LElbj"]
        sim.enable("RElbj")
        with raises(BoardError, "LElbj: found 5 V", "expected enable('LElbj') before"):
            left.voltage_v = 5
        assert left.voltage_v == 0
        left.voltage_v = 0      # is what it has
        sim.enable("LElbj")
        left.voltage_v = 5
        sim.step(20)
        assert left.current_a > 0.5
        sim.disable("LElbj")
        with raises(BoardError, "not enabled"):
            left.voltage_v = 5


def test_boards_that_do_not_obey_are_told():
    from coman_hil import BoardError, NoTelemetry, Simulator
    with Simulator(rig("coman"), hold="always", faults=["supply sag 30 0..0.5"]) as sim:
        with raises(NoTelemetry, "LElbj", "no position has been reported yet"):
            sim.joints["LElbj"].position_rad
        with raises(BoardError, "LElbj is in mode hardware_fault, faults 0x1"):
            sim.enable("LElbj", timeout_s=0.2)
        assert sim.board_fault
        sim.step(500)
        sim.enable("LElbj")
        sim.disable("LElbj")
        assert sim.joints["LElbj"].mode == "idle" and not sim.joints["LElbj"].enabled

    with Simulator(rig("coman"), hold="always", faults=["board torso/1 hung 0.."]) as sim:
        with raises(BoardError, "the board of WaistLat says nothing"):
            sim.enable("WaistLat", "LElbj", timeout_s=0.1)
        assert sim.joints["LElbj"].is_on


def test_motors_that_trip_have_names():
    from coman_hil import Simulator
    with Simulator(rig("coman"), hold="none", faults=["motor LElbj jam 0.05.."]) as sim:
        sim.enable("LElbj", "RElbj")
        assert sim.tripped() == []
        sim.joints["LElbj"].voltage_v = 20
        sim.step(600)
        assert sim.tripped() == ["LElbj"], sim.joints["LElbj"].state_text()
        sim.disable("LElbj")
        assert sim.tripped() == []


def test_misuse_is_an_error_that_says_so():
    from coman_hil import Simulator, SimulatorError
    unstarted = Simulator(rig("coman-compact"))
    with raises(SimulatorError, "_frames: the simulator has not been started"):
        unstarted.step()
    assert not hasattr(unstarted, "voltage_v")
    with Simulator(rig("coman-compact"), hold="always") as sim:
        with raises(AttributeError, "voltag_v"):
            sim.joints["LElbj"].voltag_v = 2.0
        with raises(TypeError, "found 2.5 ticks, expected a whole number"):
            sim.step(2.5)


def test_a_hydraulic_leg_moves_by_its_valves():
    """Two volts of ten open a fifth; without current the valve closes and the leg stays."""
    from coman_hil import Simulator
    with Simulator(RIGS / "hyq-leg.yaml",
                   faults=["dark: valve hip off manual",
                           "burst: hydraulic_supply leak 1e-3 manual"]) as sim:
        sim.enable()
        hip, start = sim.joints["hip"], sim.status()["joints"]["hip"]
        hip.voltage_v = 2
        sim.step(60)
        opening, piston, rod = truth(sim, "valve_opening_hip", "piston_pressure_hip_pa",
                                     "rod_pressure_hip_pa")
        assert abs(opening - 0.2) < 0.002 and min(piston, rod) >= 2e5 and max(piston, rod) < 2e7
        assert 0.05 < sim.status()["joints"]["hip"] - start < 0.6
        assert 1.2e7 < truth(sim, "hydraulic_supply_pa")[0] < 1.7e7
        sim.fault("dark")
        sim.step(300)
        rest = sim.status()["joints"]["hip"]
        sim.step(100)
        assert abs(truth(sim, "valve_opening_hip")[0]) < 1e-6
        assert abs(sim.status()["joints"]["hip"] - rest) < 0.03     # it swings on the oil
        sim.fault("burst")
        sim.step(400)
        assert truth(sim, "hydraulic_supply_pa")[0] < 2e6


QUANTITIES = {"coman": ("voltage", "current", "position"), "coman-foc": ("voltage", "current"),
              "coman-compact": ("voltage", "current"), "coman-fd": ("voltage", "current"),
              "coman-cia402": ("voltage", "torque", "velocity", "position"),
              **dict.fromkeys(("coman-odrive", "coman-robstride", "coman-mini-cheetah",
                               "coman-moteus"), ("torque", "velocity", "position"))}


def test_every_protocol_has_joints_that_take_its_set_points():
    """Each kind of set point moves the joint the right way, and its board tells how it moves."""
    from coman_hil import BoardError, Simulator
    for name, quantities in QUANTITIES.items():
        with Simulator(rig(name), changes=BENCH) as sim:
            assert len(sim.joints) == 23, name
            joint = sim.joints["LElbj"]
            for quantity in quantities:
                if name == "coman" and quantity == "position":
                    with raises(BoardError, f"the {quantity} loop of its board has gains of 0"):
                        sim.enable("LElbj", quantity=quantity)
                    sim.set(f"joint.LElbj.{quantity}_shift", 10)
                    sim.set(f"joint.LElbj.{quantity}_kp", 1)
                    sim.enable("LElbj", quantity=quantity)
                    sim.step(20)
                    assert joint.is_on and joint.quantity == quantity
                    continue
                sim.enable("LElbj", quantity=quantity)
                start = sim.status()["joints"]["LElbj"]
                if quantity == "position":
                    sim.step(50)        # held where it was
                    assert abs(sim.status()["joints"]["LElbj"] - start) < 0.1, (name, start)
                attribute, value = {
                    "voltage": ("voltage_v", 3), "current": ("current_a", 0.5),
                    "torque": ("torque_nm", 3), "velocity": ("velocity_rad_s", 1),
                    "position": ("position_rad", joint.motor_position_rad - 0.2)}[quantity]
                setattr(joint, attribute, value)
                sim.step(60)
                end = sim.status()["joints"]["LElbj"]
                assert 0.01 < (start - end if quantity == "position" else end - start) < 1.2, (
                    name, quantity, start, end)
                assert joint.is_on, (name, quantity, joint.mode)
                assert name == "coman-mini-cheetah" or joint.faults == 0, (name, quantity)
                assert abs(joint.motor_position_rad - end) < 0.1, (name, quantity, end)
                sim.disable("LElbj")
                assert not joint.enabled and (name == "coman-foc" or not joint.is_on), name
            with raises(BoardError, "boards take no", "expected"):
                sim.enable("LElbj", quantity="speed")
            if name == "coman-cia402":
                for quantity, gains in (("position", ("kp", "ki")), ("velocity", ("kp", "ki"))):
                    sim.set(f"joint.LElbj.{quantity}_{gains[0]}", 0)
                    sim.enable("LElbj", quantity=quantity)      # the other gain acts
                    sim.disable("LElbj")
                    sim.set(f"joint.LElbj.{quantity}_{gains[1]}", 0)
                    with raises(BoardError, f"the {quantity} loop of its board has gains of 0"):
                        sim.enable("LElbj", quantity=quantity)


def test_a_command_that_a_board_drops_is_told():
    from coman_hil import Simulator
    for name, message, length in (("coman", "torso_0x01_COMMAND", 1),
                                  ("coman-compact", "ALL_COMMAND_0", 1)):
        with Simulator(rig(name), hold="always") as sim:
            sim.listen()
            assert sim.dropped() == (0, "")
            found = sim.buses.bus("torso").message(message)
            data = bytes((0xf2,) * length)      # a set point of which the rest is missing
            sim._queued.append(f"< send {found.word} {length} {data.hex(' ')} torso >")
            sim.step(2)
            for _ in range(100):
                count, reason = sim.dropped()
                if reason:
                    break
                time.sleep(0.05)
            assert count == 1 and "torso/" in reason and found.word.lower() in reason, (
                name, count, reason)


def crc8(data):
    """CRC-8 SAE J1850 as its text has it: polynomial 0x1d, from 0xff, inverted at the end."""
    register = 0xff
    for byte in data:
        for bit in range(7, -1, -1):
            top = register >> 7 ^ byte >> bit & 1
            register = register << 1 & 0xff ^ (0x1d if top else 0)
    return register ^ 0xff


def test_steps_a_second():
    """Reported, not judged."""
    from coman_hil import Simulator
    for kind, what in (("coman", ()), ("coman", ("LElbj",)), *((k, None) for k in KINDS)):
        with Simulator(rig(kind), hold="always") as sim:
            if what is None:
                sim.enable()
            elif what:
                sim.enable(*what)
            count, begin = 500, time.monotonic()
            for number in range(count):
                for joint in filter(lambda joint: joint.enabled, sim.joints.values()):
                    joint.voltage_v = number / count
                sim.step()
            took = time.monotonic() - begin
        on = "all motors" if what is None else f"{len(what)} motors"
        print(f"# {kind}: {count / took:.0f} steps of a tick a second, {on} on")


area.main(globals())
