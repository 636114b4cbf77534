# SPDX-License-Identifier: Apache-2.0
"""Converts the recordings of dyno-u8.yaml from a clone of their repository.

    git clone https://github.com/bgkatz/Dyno-Software
    git -C Dyno-Software checkout 3c46329
    python3 dyno-u8.py Dyno-Software FOLDER

A state is the mean of the last three quarters of a stretch with flag 1, to five digits. The command
rises from state to state at each speed. A state whose torque is not larger than all before it is at
the limit of the voltage: load and speed do not determine it. It goes into limit.csv.
"""
import csv
import pathlib
import sys

HEAD = ("# T-Motor U8 Pro on a dynamometer, {what}: means of flagged stretches of {file} (github "
        "bgkatz/Dyno-Software, commit 3c46329, MIT, Copyright (c) 2020 Ben Katz)\n"
        "torque_nm,speed_rad_s,bus_v,bus_a,samples\n")


def states(path):
    """Yields the states of a file: torque, speed, voltage and current of the bus, samples."""
    stretch, flagged = [], False
    with open(path, newline="") as rows:
        for row in [*csv.reader(rows), [0] * 6]:
            if len(row) < 6:
                continue
            if float(row[5]) == 1:
                stretch.append([float(x) for x in row[1:5]])
            elif flagged:
                part = stretch[len(stretch) // 4:]
                yield [sum(x) / len(part) for x in zip(*part)] + [len(part)]
                stretch = []
            flagged = float(row[5]) == 1


def split(all_states):
    """Returns the states within the limit of the voltage, and the others."""
    within, limit, speed, most = [], [], None, 0.0
    for state in all_states:
        if speed is None or abs(state[1] - speed) > 2.0:
            speed, most = state[1], 0.0
        (within if abs(state[0]) > most + 0.05 or abs(state[0]) < 0.1 else limit).append(state)
        most = max(most, abs(state[0]))
    return within, limit


def write(target, what, file, rows):
    with open(target, "w") as out:
        out.write(HEAD.format(what=what, file=file))
        for row in rows:
            out.write(",".join(f"{x:.5g}" for x in row) + "\n")


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    logs, folder = pathlib.Path(sys.argv[1], "Logs"), pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    within, limit = split(states(logs / "u8_pro_emap.csv"))
    write(folder / "fit.csv", "motoring states 1, 3, 5 ...", "u8_pro_emap.csv", within[0::2])
    write(folder / "judge.csv", "motoring states 2, 4, 6 ...", "u8_pro_emap.csv", within[1::2])
    write(folder / "limit.csv", "motoring states at the limit of the voltage", "u8_pro_emap.csv",
          limit)
    for name, file, what in (("higher", "u8_pro_emap_2.csv", "motoring at 22 to 27 V"),
                             ("regen", "u8_pro_emap_regen.csv", "driven by the load")):
        within, _ = split(states(logs / file))
        write(folder / f"{name}.csv", what, file, within)


if __name__ == "__main__":
    main()
