#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: run.sh COMAN-HIL: judges the CANopen nodes by a library that is not ours, the npm package
# canopen, which ./dev setup --canopen installs. Prints TAP.
here=$HIL_SOURCE_DIR/tests/bus/canopen
if ! command -v node >/dev/null; then
    reason="no node"
elif ! (cd "$here" && node -e 'require("canopen")') 2>/dev/null; then
    reason="no npm package canopen in tests/bus/canopen/node_modules"
else
    exec node "$here/client.mjs" "$1"
fi
echo 1..1
echo "ok 1 - a CANopen library that is not ours # SKIP $reason: ./dev setup --canopen installs it"
