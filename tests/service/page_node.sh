#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: page_node.sh bundle | page_node.sh store
#        page_node.sh browser|end|visual|replay|plots|act COMAN-HIL
# What needs node, npm's packages and a browser, which ./dev setup --browser installs: that the
# committed bundle is the one that its sources make, and the page in a browser. Prints TAP.
set -u
page=$HIL_SOURCE_DIR/viewer/page
skip() {
    echo 1..1
    echo "ok 1 - the page, $1 # SKIP $2: ./dev setup --browser installs it"
    exit
}
if ! command -v node >/dev/null; then
    skip "$1" "no node"
elif [ ! -d "$page/node_modules/esbuild" ]; then
    skip "$1" "no npm packages in viewer/page/node_modules"
elif [ "$1" != bundle ]; then
    exec node "$HIL_SOURCE_DIR/tests/service/page_$1.mjs" ${2+"$2"}
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
echo 1..2
node "$page/build.js" "$work/page.js.gz" >"$work/log" 2>&1
gzip -dc "$work/page.js.gz" >"$work/made"
gzip -dc "$page/../page.js.gz" >"$work/committed"
if cmp "$work/made" "$work/committed" >>"$work/log" 2>&1; then
    echo "ok 1 - the committed bundle is what its sources make"
else
    echo "not ok 1 - the committed bundle is what its sources make: cd viewer/page && npm run build"
    sed 's/^/# /' "$work/log"
fi
size=$(wc -c <"$page/../page.js.gz")
if [ "$size" -le 900000 ]; then
    echo "ok 2 - the bundle has $size bytes, 900000 at most"
else
    echo "not ok 2 - the bundle has $size bytes, 900000 at most"
fi
