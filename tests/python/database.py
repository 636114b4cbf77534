#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Values in frames, held against canmatrix's own codec; what is refused. Prints TAP."""
import random

import area
from area import KINDS, raises, rig


def databases():
    from coman_hil import database
    return {kind: database.load(database_program(), rig(kind)) for kind in KINDS}


def database_program():
    import os
    return os.environ["COMAN_HIL"]


def matrices(kind):
    """The same files in the eyes of canmatrix, by bus."""
    import pathlib
    import subprocess
    import tempfile

    import canmatrix.formats
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([database_program(), "dbc", rig(kind), "-o", folder], check=True,
                       stdout=-3)
        return {path.stem.removeprefix(kind + "-"): canmatrix.formats.loadp_flat(str(path))
                for path in pathlib.Path(folder).glob("*.dbc")}


def test_decoded_as_canmatrix_does():
    noise, count = random.Random(1), 0
    for kind, found in databases().items():
        for bus, matrix in matrices(kind).items():
            for frame in matrix.frames:
                message = found.bus(bus).message(frame.name)
                selectors = sorted({s.selector for s in message.signals.values()
                                    if s.selector is not None}) or [None]
                for selector in selectors:
                    data = bytearray(noise.randbytes(frame.size))
                    if selector is not None:
                        data[0] = selector
                    theirs = frame.decode(bytes(data)) if frame.size else {}
                    for name, value in message.decode(bytes(data)).items():
                        truth = theirs[name]
                        signal = message.signal(name)
                        if signal.floating or isinstance(value, str):
                            continue
                        assert abs(value - float(truth.phys_value)) <= 1e-9 * (1 + abs(value)), (
                            kind, bus, frame.name, name, value, truth.phys_value)
                        count += 1
    assert count > 5000, count
    print(f"# {count} values")


def test_encoded_as_canmatrix_does():
    noise, count = random.Random(2), 0
    for kind, found in databases().items():
        for bus, matrix in matrices(kind).items():
            for frame in matrix.frames:
                message = found.bus(bus).message(frame.name)
                for signal in message.signals.values():
                    if signal.floating or signal is message.selector:
                        continue
                    low, high = signal.limits
                    value = noise.uniform(low, high)
                    values, theirs = {signal.name: value}, {}
                    if signal.selector is not None:
                        values["command"] = theirs["command"] = signal.selector
                    raw = signal.encode(value)
                    theirs[signal.name] = raw - (1 << signal.bits) \
                        if signal.signed and raw >> signal.bits - 1 else raw
                    mine = message.encode(values, message.length)
                    # their numbers are rounded differently at half a count: the count is ours
                    assert mine == bytes(frame.encode(theirs)), (kind, bus, frame.name, signal)
                    assert abs(signal.decode(mine) - value) <= 0.501 * abs(signal.scale)
                    count += 1
    assert count > 5000, count
    print(f"# {count} values")


def test_a_command_has_the_length_and_bytes_of_the_firmware():
    message = databases()["coman"].bus("left_leg").message("left_leg_0x01_COMMAND")
    data = message.encode({"command": "SET_OPEN_LOOP_1", "SET_OPEN_LOOP_pwm_1": 25})
    assert data.hex() == "f24d01", data.hex()
    data = message.encode({"command": "SET_CONTROL_MODE_0", "SET_CONTROL_MODE_mode_0": "open_loop"})
    assert data.hex() == "0950", data.hex()
    assert message.encode({"command": "GET_OPEN_LOOP_0"}).hex() == "73"


def test_a_float_survives():
    message = databases()["coman-foc"].bus("torso").message("torso_0x01_COMMAND")
    data = message.encode({"command": "SET_PID", "SET_PID_loop": "velocity",
                           "SET_PID_parameter": "ki", "SET_PID_value": -0.15625})
    assert message.decode(data) == {"command": "SET_PID", "SET_PID_loop": "velocity",
                                    "SET_PID_parameter": "ki", "SET_PID_value": -0.15625}


def test_what_does_not_fit_is_refused():
    from coman_hil import UnknownName
    found = databases()["coman-compact"]
    message = found.bus("torso").message("ALL_COMMAND_0")
    name = next(iter(message.signals))
    assert name.endswith("_set_point") and name == f"{message.signal(name).about}_set_point"
    assert message.encode({name: 65.534}).hex()[:4] == "ff7f"
    assert message.encode({name: -65.536}).hex()[:4] == "0080"
    for volts in (65.54, -65.54, float("nan"), float("inf")):
        with raises(ValueError, name, "expected -65.536 to 65.534 V"):
            message.encode({name: volts})
    wrong = name.replace("_set_point", "_setpoint")
    with raises(UnknownName, f"found no signal of ALL_COMMAND_0 '{wrong}'", f"'{name}'"):
        message.encode({wrong: 1})
    with raises(UnknownName, "value of mode 'volts'", "'voltage'"):
        found.bus("torso").message("ALL_MODE").encode({"mode": "volts"})
    with raises(UnknownName, "found no bus 'torsos'", "'torso'"):
        found.bus("torsos")
    with raises(UnknownName, "found no message of bus torso"):
        found.bus("torso").message("NOTHING")


area.main(globals())
