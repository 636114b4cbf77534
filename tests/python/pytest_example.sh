#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The pytest example, as a user would run it. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$HIL_SOURCE_DIR/tests/service/tap.sh"
tap_show=$work/out

echo 1..1
if ! /usr/bin/python3 -c 'import can, canmatrix, pytest' 2>/dev/null; then
    skip "the pytest example passes" \
        "not installed: one of the Debian packages python3-can, python3-canmatrix, python3-pytest"
    exit 0
fi
COMAN_HIL=$HIL_BINARY_DIR/coman-hil COMAN_HIL_RIG=$HIL_SOURCE_DIR/config/rigs/coman.yaml \
    PYTHONPATH=$HIL_SOURCE_DIR/python PYTHONDONTWRITEBYTECODE=1 timeout -k 5 100 \
    /usr/bin/python3 -m pytest -q -p no:cacheprovider "$HIL_SOURCE_DIR/examples/pytest" \
    >"$work/out" 2>&1 </dev/null
result $? "the pytest example passes"
