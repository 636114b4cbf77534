#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# The job: builds the controller and tests it. Results are in results/*.xml (JUnit). It needs the
# packages coman-hil, libcoman-hil-client-dev, python3-coman-hil, gcc, pkg-config and
# python3-pytest, no privileges and no CAN in the kernel.
set -eu
mkdir -p build results
coman-hil check rig.yaml >results/check.txt
coman-hil dbc rig.yaml -o build
cc -std=c11 -O2 -Wall -o build/controller controller.c \
    $(pkg-config --cflags --libs coman-hil-client) -lm
status=0
coman-hil test bends_elbow.yaml switches_off.yaml --program 'build/controller build' \
    --junit results/scenarios.xml --output results || status=1
"${PYTHON:-python3}" -m pytest -q -p coman_hil.pytest --junit-xml results/python.xml test_arm.py ||
    status=1
exit $status
