# SPDX-License-Identifier: Apache-2.0
"""Converts the recordings of sea-rmd-x8.yaml from a clone of their repository.

    git clone https://github.com/ITregear/SeriesElasticActuation-FYP
    git -C SeriesElasticActuation-FYP checkout 755c1e1
    python3 sea-rmd-x8.py SeriesElasticActuation-FYP FOLDER/sea-rmd-x8
    COMAN_HIL_DATA=FOLDER coman-hil validate sea-rmd-x8

Numbers are cut to six digits. The benches hold the checksums of the results.
"""
import csv
import pathlib
import sys

# Folder of the repository, name of the results; the first recording of an amplitude has no number
KINDS = {"SEAStepResponse": "step", "SEAMotorBandwidth": "chirp",
         "SEABandwidthClosedLoop": "closed-chirp"}
COLUMNS = {"time": "time_s", "torque_in": "torque_command_nm", "torque_ati": "torque_measured_nm",
           "torque_sea": "torque_spring_nm"}


def convert(source, target):
    with open(source, newline="") as rows, open(target, "w") as out:
        out.write(",".join(COLUMNS.values()) + "\n")
        for row in csv.DictReader(rows):
            out.write(",".join(f"{float(row[name]):.6g}" for name in COLUMNS) + "\n")


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    data, folder = pathlib.Path(sys.argv[1], "Python", "TestData"), pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    for kind, name in KINDS.items():
        for source in sorted((data / kind).iterdir()):
            _, amplitude, number = source.name.split("-")[:3]
            suffix = "" if number == "1" else "-" + number
            convert(source, folder / f"{name}-{amplitude}nm{suffix}.csv")


if __name__ == "__main__":
    main()
