#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: units.sh COMAN-HIL
# The systemd units as systemd reads them: nothing it complains about, and shut off from the rest of
# the system as far as real time and CAN allow (exposure of at most 2.0). Each directive is one that
# units.txt lists. Prints TAP.
set -u
program=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/out"

echo 1..10
# what stands in the units and in the examples, without comments
(
    cd "$HIL_SOURCE_DIR" || exit 1
    LC_ALL=C # the order of names
    for file in systemd/*.service systemd/examples/*; do
        echo "== $file"
        grep -v -e '^#' -e '^$' "$file"
    done
) >"$work/directives"
grep -v '^#' "$HIL_SOURCE_DIR/tests/service/units.txt" | diff - "$work/directives" >"$work/out"
result $? "the directives are those of the list"

if ! command -v systemd-analyze >/dev/null; then
    for n in 2 3 4 5 6 7 8 9 10; do echo "ok $n # SKIP systemd-analyze is not installed"; done
    exit $failed
fi
for unit in coman-hil@ coman-hil-vcan@; do
    # the program is not installed where systemd looks for it
    sed "s|^ExecStart=coman-hil |ExecStart=$program |" "$HIL_SOURCE_DIR/systemd/$unit.service" \
        >"$work/$unit.service"
    timeout 60 systemd-analyze verify --man=no "$work/$unit.service" >"$work/out" 2>&1 &&
        [ ! -s "$work/out" ]
    result $? "$unit.service is understood without a word"
    timeout 60 systemd-analyze security --offline=true --no-pager "$work/$unit.service" \
        >"$work/out" 2>&1
    exposure=$(sed -n 's/.*Overall exposure level for [^:]*: \([0-9.]*\).*/\1/p' "$work/out")
    echo "# $unit.service: exposure ${exposure:-unknown}"
    awk -v e="${exposure:-99}" 'BEGIN { exit !(e <= 2.0) }'
    result $? "$unit.service is exposed by at most 2.0"
done

# the examples of drop-ins; the group of the second need not be there for it to be understood
for example in can-configure processors; do
    dropin=$work/coman-hil@.service.d
    mkdir "$dropin"
    cp "$HIL_SOURCE_DIR/systemd/examples/$example.conf" "$dropin"
    timeout 60 systemd-analyze verify --man=no "$work/coman-hil@.service" >"$work/out" 2>&1 &&
        [ ! -s "$work/out" ]
    result $? "$example.conf is understood without a word"
    # as systemd would read them together
    cat "$work/coman-hil@.service" "$dropin/$example.conf" >"$work/with-$example@.service"
    timeout 60 systemd-analyze security --offline=true --no-pager "$work/with-$example@.service" \
        >"$work/out" 2>&1
    exposure=$(sed -n 's/.*Overall exposure level for [^:]*: \([0-9.]*\).*/\1/p' "$work/out")
    echo "# with $example.conf: exposure ${exposure:-unknown}"
    awk -v e="${exposure:-99}" 'BEGIN { exit !(e <= 2.0) }'
    result $? "the unit with it is exposed by at most 2.0"
    rm -r "$dropin"
done

# instances run as users of their own: what one has recorded the other must not own
places='^(State|Cache|Runtime)Directory='
[ "$(grep -cE "$places" "$HIL_SOURCE_DIR/systemd/coman-hil@.service")" = 2 ] &&
    ! grep -E "$places" "$HIL_SOURCE_DIR/systemd/coman-hil@.service" | grep -v '/%i$' >"$work/out"
result $? "every instance has folders of its own"
exit $failed
