#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: run.sh IMPORT_DUMP: compares imports of HIL_IMPORTS (200) generated robot files with MuJoCo
# 3, the npm package mujoco-js, which ./dev setup --mujoco installs. Prints TAP.
here=$HIL_SOURCE_DIR/tests/physics/generated
if ! command -v node >/dev/null; then
    reason="no node"
elif [ ! -d "$here/node_modules/mujoco-js" ]; then
    reason="no npm package mujoco-js in tests/physics/generated/node_modules"
else
    exec node "$here/judge.mjs" "$1" "${HIL_IMPORTS:-200}"
fi
echo 1..1
echo "ok 1 - imports of generated files # SKIP $reason: ./dev setup --mujoco installs it"
