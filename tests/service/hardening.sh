#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: hardening.sh COMAN-HIL COMAN-HIL-BENCH
# What the programs are protected by, as readelf and objdump see it: position independent, no
# writable table of functions, no executable stack, guarded stack frames, checked buffers, marked
# targets of jumps. Prints TAP.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/of"

# has WHAT PATTERN NAME: a line of readelf that matches
has() {
    grep -qE "$2" "$work/of"
    result $? "$3: $1"
}

echo 1..16
if ! command -v readelf >/dev/null; then
    for n in $(seq 16); do echo "ok $n # SKIP no readelf"; done
    exit 0
fi
for program in "$1" "$2"; do
    name=$(basename "$program")
    readelf --wide --file-header --segments --dynamic "$program" >"$work/of" 2>/dev/null
    has "position independent" "Type: +DYN" "$name"
    has "the linker's tables are read-only" "GNU_RELRO" "$name"
    has "all functions are resolved at the start" "FLAGS.* NOW" "$name"
    grep -E "GNU_STACK" "$work/of" | grep -q "RW  "
    result $? "$name: the stack is not executable"
    ! grep -E "^  LOAD" "$work/of" | grep -q "RWE"
    result $? "$name: no segment is writable and executable"
    # whole-program notes need start-up files that have them, which Debian 12 does not
    if [ "$(uname -m)" = x86_64 ]; then
        objdump --disassemble=main --no-show-raw-insn "$program" >"$work/of" 2>/dev/null
        grep -A 1 "<main>:" "$work/of" | grep -q endbr64
        result $? "$name: targets of jumps are marked (CET)"
    else
        skip "$name: targets of jumps are marked (CET)" "x86-64 only"
    fi
    readelf --wide --dyn-syms "$program" >"$work/of" 2>/dev/null
    has "stack frames are guarded" " __stack_chk_fail" "$name"
    has "buffers are checked" " __(snprintf|vsnprintf|memcpy|read|fprintf)_chk" "$name"
done
exit $failed
