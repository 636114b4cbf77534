#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Closes the loop of a spring's torque at 600 Hz through a drive on a CAN bus, in lockstep.

    closed_loop.py [AMPLITUDE_NM [FILE.csv]]

rig.yaml beside this file is the measured actuator of config/validation/sea-rmd-x8.yaml.
The controller is that of the recordings: it commands the reference plus the error of the spring's
torque. It updates the error every 15.625 ms, from a filtered torque that is one row old. The
reference is a sweep to 40 Hz in 40 s. The program prints gains by the cross spectrum in bands of
1 Hz.
FILE has the columns of the recordings, for `coman-hil identify`.
"""
import cmath
import math
import pathlib
import sys

import coman_hil

RIG = pathlib.Path(__file__).with_name("rig.yaml")
RATE_HZ, ERROR_PERIOD_S, LATE = 600.0, 1.0 / 64.0, 1
SHARE, SPRING_GAIN = 0.22, 1.12    # weight of a new torque per row; measured torque by true torque
SWEEP_S, SWEEP_HZ = 40.0, 40.0
TORQUE_CONSTANT_NM_A = 1.393    # of the recordings' author, at the output of the gear
COMMAND_GAIN = 1.112            # fitted to a closed sweep of 1 N m


def respond(rows, hz, lines=10):
    """Gain from reference to torque in the band of 1 Hz about a frequency."""
    power, cross = 0.0, 0.0
    for line in range(lines):
        w = 2.0 * math.pi * (hz - 0.5 + (line + 0.5) / lines)
        turns = [cmath.exp(-1j * w * time) for time, *_ in rows]
        reference = sum(row[1] * turn for row, turn in zip(rows, turns))
        torque = sum(row[2] * turn for row, turn in zip(rows, turns))
        power += abs(reference) ** 2
        cross += torque * reference.conjugate()
    return abs(cross) / power


def sweep(amplitude_nm, duration_s=SWEEP_S):
    """Rows of time, reference and torque of the spring."""
    rows, error, told, taken = [], 0.0, 0.0, -1
    with coman_hil.Simulator(RIG) as sim:
        joint = sim.joints["output"]
        sim.enable("output", quantity="current")
        begin = sim.time_s
        while (time := sim.time_s - begin) < duration_s:
            reference = amplitude_nm * math.sin(math.pi * SWEEP_HZ / SWEEP_S * time * time)
            torque = joint.torque_nm
            told += SHARE * (SPRING_GAIN * (rows[-LATE][2] if len(rows) >= LATE else 0.0) - told)
            if time // ERROR_PERIOD_S != taken:
                error, taken = reference - told, time // ERROR_PERIOD_S
            joint.current_a = COMMAND_GAIN * (reference + error) / TORQUE_CONSTANT_NM_A
            rows.append((time, reference, torque))
            # Ticks of 1 ms that end at or after the next period of 1/600 s
            ticks = math.ceil(round((len(rows) / RATE_HZ - time) * 1e3, 6))
            sim.step(max(ticks, 1))
    return rows


def main():
    amplitude_nm = float(sys.argv[1]) if len(sys.argv) > 1 else 2.0
    rows = sweep(amplitude_nm)
    gains = [respond(rows, hz) for hz in range(1, 31)]
    for hz, gain in enumerate(gains, 1):
        print(f"{hz:3d} Hz  {gain:.3f}")
    beyond = next((hz for hz, gain in enumerate(gains, 1) if gain < math.sqrt(0.5)), None)
    print(f"largest gain {max(gains):.3f}; below 0.707 from {beyond} Hz")
    if len(sys.argv) > 2:
        with open(sys.argv[2], "w") as out:
            out.write("time_s,torque_command_nm,torque_spring_nm\n")
            out.writelines("%.6g,%.6g,%.6g\n" % row for row in rows)


if __name__ == "__main__":
    main()
