#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# COMAN's rig on the native engine: the program takes it, the robot squats, and the same run gives
# the same state to the last bit.
program=$1
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT
echo 1..3
status=0

# check NUMBER WHAT CONDITION
check() {
    if [ "$3" -eq 1 ]; then
        echo "ok $1 - $2"
    else
        echo "not ok $1 - $2"
        sed 's/^/# /' "$dir/log"
        status=1
    fi
}

mkdir "$dir/rigs"
for folder in robots meshes; do
    ln -s "$HIL_SOURCE_DIR/config/$folder" "$dir/$folder"
done
sed 's/^\( *engine:\) *simbody/\1 native/' "$HIL_SOURCE_DIR/config/rigs/coman.yaml" \
    >"$dir/rigs/coman.yaml"

"$program" check "$dir/rigs/coman.yaml" >"$dir/log" 2>&1
check 1 "the rig says which engine it has" "$(grep -c '^scene  *engine native' "$dir/log")"

# run: prints the state's hash
run() {
    "$program" run "$dir/rigs/coman.yaml" --clock free --task squat >"$dir/log" 2>&1
    echo "$?" >"$dir/exit"
    sed -n 's/.*state hash \([0-9a-f]*\).*/\1/p' "$dir/log"
}

first=$(run)
check 2 "the squat succeeds" \
    $(($(cat "$dir/exit") == 0 && $(grep -c 'task squat: .*cycles done' "$dir/log") == 1))
second=$(run)
if [ -n "$first" ] && [ "$first" = "$second" ]; then same=1; else same=0; fi
check 3 "two runs end in the same state" "$same"
exit $status
