#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: wheel.sh VERSION COMAN_HIL
# The wheel of the Python package: built without a network, installed in a virtual environment, and
# used from there. Prints TAP.
set -u
version=$1 program=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$HIL_SOURCE_DIR/tests/service/tap.sh"
tap_show="$work/out"
unset PYTHONPATH

if ! /usr/bin/python3 -c 'import setuptools, pip, wheel, ensurepip, can, canmatrix' 2>/dev/null
then
    echo "1..0 # SKIP a Python package is missing (python3-pip, python3-venv, python3-setuptools," \
        "python3-wheel, python3-can, python3-canmatrix)"
    exit 0
fi
echo 1..3
cp -r "$HIL_SOURCE_DIR/python" "$work/python" # the build writes beside its sources
offline="--no-index --no-deps --disable-pip-version-check"
# shellcheck disable=SC2086 # words
/usr/bin/python3 -m pip wheel $offline --no-build-isolation -w "$work" "$work/python" \
    >"$work/out" 2>&1
[ -s "$work/coman_hil-$version-py3-none-any.whl" ]
result $? "the wheel has the program's version"

/usr/bin/python3 -m venv --system-site-packages "$work/venv" >"$work/out" 2>&1
# shellcheck disable=SC2086 # words
"$work/venv/bin/python" -m pip install $offline "$work"/*.whl >>"$work/out" 2>&1
result $? "pip installs it in a virtual environment"

cd "$work" && COMAN_HIL=$program "$work/venv/bin/python" -c '
import coman_hil
assert coman_hil.__file__.startswith("'"$work"'/venv"), coman_hil.__file__
with coman_hil.Simulator("coman-compact", hold="always") as sim:
    sim.enable("LElbj")
    sim.joints["LElbj"].voltage_v = 2.0
    sim.step(20)
    assert sim.joints["LElbj"].current_a > 0.1
' >"$work/out" 2>&1
result $? "a controller drives a motor with it"
exit $failed
