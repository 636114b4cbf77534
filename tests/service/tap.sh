# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=sh
# Sourced by shell tests: numbered lines of TAP (tap.py is for those in Python). tap_show has the
# names of files, or patterns of names, whose ends are shown below a test that fails; failed is 1
# after the first.
number=0
failed=0
tap_show=

# result STATUS NAME [REMARK]: ok when the status is 0
result() {
    number=$((number + 1))
    if [ "$1" -eq 0 ]; then
        echo "ok $number - $2"
    else
        echo "not ok $number - $2"
        failed=1
        # shellcheck disable=SC2086 # names and patterns
        [ -z "$tap_show" ] || tail -q -n 40 $tap_show 2>/dev/null | sed 's/^/# /'
    fi
    [ -z "${3:-}" ] || echo "# $3"
}

ok() { result 0 "$1"; }
not_ok() { result 1 "$1"; }

# skip NAME REASON
skip() {
    number=$((number + 1))
    echo "ok $number - $1 # SKIP $2"
}
