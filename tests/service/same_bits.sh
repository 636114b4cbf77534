#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# The same bits on every machine: the state hash and the recorded frames of runs of the rigs, with
# the kernels of each instruction set that this machine has, are those of same_bits.txt; and no
# instruction of the program multiplies and adds at once, which rounds otherwise than the two that
# another machine has for it (compilers have made some although they were told not to). Prints TAP.
#
#   same_bits.sh              judges
#   same_bits.sh RIG:TASK...  judges these rows
#   same_bits.sh --write      prints the table as it is now, for a change that is meant to move it
#
# HIL_EMULATOR, a command that runs programs of another architecture, stands before the program;
# HIL_INSTRUCTIONS are the sets that are looked at, all without it.
set -u
program=(${HIL_EMULATOR:-} "$HIL_BINARY_DIR/coman-hil")
known=(${HIL_INSTRUCTIONS:-plain avx2 avx512})
table=$(dirname "$0")/same_bits.txt
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show=$work/out

# bits SET RIG[@wire] TASK TICKS: the hash of the state and that of the frames at the end of a run,
bits()
{
    local task=(--task "$3") rig=${2%@wire} wire=ideal
    [ "$rig" != "$2" ] && wire=wire
    [ "$3" = none ] && task=(--hold none)
    rm -rf "$work/record"
    COMAN_HIL_INSTRUCTIONS=$1 timeout -k 5 "${HIL_LIMIT_S:-100}" "${program[@]}" run \
        "$HIL_SOURCE_DIR/config/rigs/$rig.yaml" --transport local --clock free --control none \
        --wire $wire --ticks "$4" "${task[@]}" --record "$work/record" \
        >"$work/out" 2>&1 </dev/null || return
    echo "$(sed -n 's/^ *state hash //p' "$work/out") $(md5sum <"$work/record/candump.log" |
        cut -c 1-16)"
}

rows()
{
    awk -v wanted=" $* " '!/^#/ && (wanted ~ /^ *$/ || index(wanted, " " $1 ":" $2 " "))' "$table"
}

if [ "${1:-}" = --write ]; then
    grep '^#' "$table"
    rows | while read -r rig task ticks _; do
        echo "$rig $task $ticks $(bits plain "$rig" "$task" "$ticks")"
    done
    exit
fi

# What the processor has, as the program says
sets=()
for set in "${known[@]}"; do
    COMAN_HIL_INSTRUCTIONS=$set "${program[@]}" version >"$work/out" 2>&1 && sets+=("$set")
done
[ "${#sets[@]}" -gt 0 ] || { echo "Bail out! the program does not start"; exit 1; }

echo "1..$(($(rows "$@" | wc -l) * ${#known[@]} + 1))"

# The C library's own functions, where it is linked in, begin with two underscores: what runs in the
# loop calls none of them (portable_rule.py)
name="no instruction of the program multiplies and adds at once"
disassembler=${OBJDUMP:-objdump}
if ! command -v "$disassembler" >/dev/null; then
    skip "$name" "no $disassembler"
else
    "$disassembler" --disassemble --no-show-raw-insn "$HIL_BINARY_DIR/coman-hil" |
        awk '/>:$/ {function_name = $2}
            function_name ~ /^<__/ {next}
            /\t(vfn?m(add|sub)[a-z0-9]*|fn?m(add|sub)|fml[as])[ \t]/ {print function_name, $0}' \
            >"$work/out"
    if [ "${PIPESTATUS[0]}" -eq 0 ] && [ ! -s "$work/out" ]
    then ok "$name"; else not_ok "$name"; fi
fi
while read -r rig task ticks hash frames; do
    for set in "${known[@]}"; do
        name="$rig, task $task, has the bits of the table with $set instructions"
        if [[ " ${sets[*]} " != *" $set "* ]]; then
            skip "$name" "this machine does not have them"
            continue
        fi
        found=$(bits "$set" "$rig" "$task" "$ticks")
        echo "# expected $hash $frames, found $found" >>"$work/out"
        if [ "$found" = "$hash $frames" ]; then ok "$name"; else not_ok "$name"; fi
    done
done < <(rows "$@")
exit "$failed"
