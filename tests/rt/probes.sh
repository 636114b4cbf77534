#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: probes.sh COMAN-HIL
# The tracepoints in the program are those that rt/probes.h documents, with their arguments, and the
# manual's topic names them all. Prints TAP.
set -u
program=$1
header=$HIL_SOURCE_DIR/rt/probes.h
echo 1..3
if ! command -v readelf >/dev/null; then
    for n in 1 2 3; do echo "ok $n # SKIP readelf is not installed"; done
    exit 0
fi
failures=0

# verdict NUMBER NAME PROBLEM
verdict()
{
    if [ -z "$3" ]; then
        echo "ok $1 - $2"
    else
        echo "not ok $1 - $2"
        echo "# $3"
        failures=$((failures + 1))
    fi
}

# "name number-of-arguments" of each
documented=$(sed -n 's/^ \*   \([a-z_]*\)(\([a-z_, ]*\)) .*/\1 \2/p' "$header" | tr -d , |
    awk '{ print $1, NF - 1 }' | sort)
found=$(readelf -n "$program" 2>/dev/null | awk '
    /Provider: / { ours = $2 == "coman_hil" }
    /Name: / { name = $2 }
    /Arguments: / && ours { print name, NF - 1 }' | sort -u)

problem=
[ "$(echo "$documented" | wc -l)" -ge 8 ] || problem="only these are documented: $documented"
verdict 1 "the header documents the probes" "$problem"

problem=$(diff <(echo "$documented") <(echo "$found"))
verdict 2 "each is in the program with its arguments, and no other" "$problem"

problem=
"$program" help rt >/tmp/topic.$$
for name in $(echo "$documented" | cut -d' ' -f1); do
    grep -q "$name(" /tmp/topic.$$ || problem="$problem no $name"
done
rm -f /tmp/topic.$$
verdict 3 "the manual's topic names each" "$problem"
exit $((failures > 0))
