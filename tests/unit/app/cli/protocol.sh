#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: protocol.sh COMAN-HIL
# The pages on what the boards speak: those of docs/protocol are what the program prints, they have
# every message and signal of the DBC files of rigs, and every fault. Prints TAP.
set -u
program=$1
source=${HIL_SOURCE_DIR:?}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$source/tests/service/tap.sh"
tap_show="$work/out"

# has_all_of RIG PROTOCOL: all frames that a rig's DBC files name are on the page
has_all_of() {
    mkdir "$work/$1" && "$program" dbc "$1" -o "$work/$1" >/dev/null &&
        sed -n 's/^BO_ [0-9]* \([A-Za-z0-9_]*\).*/\1/p; s/^VAL_ [0-9]* command //p' \
            "$work/$1"/*.dbc | tr ' ";' '\n\n\n' |
        sed -n 's/^ALL_//; s/^\([A-Z][A-Z0-9_]*[A-Z]\)\(_[01]\)\{0,1\}$/\1/p' | sort -u |
        grep -vxE 'STEP|DONE|MANAGEMENT' >"$work/names" # the loop's, and a name of all commands
    [ -s "$work/names" ] || return 1
    while read -r name; do
        grep -qE "^### $name$|^Answer: $name," "$work/$2.md" || echo "$1: $name is not on the page"
    done <"$work/names" >"$work/out"
    [ ! -s "$work/out" ]
}

pages=$(cd "$source/docs/protocol" && echo *.md)
echo 1..$(($(echo "$pages" | wc -w) + 15))
for page in $pages; do
    name=${page%.md}
    "$program" protocol $name >"$work/$name.md" 2>"$work/out" &&
        diff "$source/docs/protocol/$name.md" "$work/$name.md" >"$work/out"
    result $? "docs/protocol/$name.md is what \`coman-hil protocol $name\` prints"
done

for topic in rig robot scenario; do
    "$program" help $topic --markdown 2>&1 | diff "$source/docs/reference/$topic.md" - >"$work/out"
    result $? "docs/reference/$topic.md is what \`coman-hil help $topic --markdown\` prints"
done

# from another description of the protocol: the header that people read
has() { grep -qF -- "$2" "$work/$1.md" || echo "no \"$2\"" >>"$work/out"; }
"$program" protocol "$source/tests/service/checked.yaml" >"$work/checked.md" 2>"$work/out"
has checked '- byte 2 `state`: u8; 0 = idle, 1 = run'
has checked '- bits 12-15 `state`: u4; 0 = idle, 1 = run'
[ ! -s "$work/out" ]
result $? "fields that carry a state have the names of the states of the file"
: >"$work/out"
has icub 'Host to board, id 0x000 + a, byte 0 = 0x09, 2 bytes.'
has icub 'Answer: id 0x000 + 0x10 a, byte 0 = 0x07, 3 bytes.'
has icub 'Board to host, id 0x101 + 0x10 a, 8 bytes, every 4 ms.'
has icub 'Host to board, id 0x70f, byte 0 = 0xff, 1 byte.'
has icub '- bytes 2-3 `value`: u16 be'
has icub '- byte 1 `period`: u8, ms, 1 to 255 ms'
has icub 'Board to host, id 0x503 + 0x10 a, 8 bytes, every 1 ms.'
has icub 'Host to board, id 0x200 + a, byte 0 = 0x34, 4 to 8 bytes.'
[ ! -s "$work/out" ]
result $? "identifiers, lengths and ranges of icub"
has foc 'Host to board, id 0x10f, 8 bytes, every 1 ms.'
has foc 'Board to host, id 0x100 + 0x10 a, 8 bytes, every 1 ms.'
has foc '- bit 14: set-point expired'
[ ! -s "$work/out" ]
result $? "identifiers, lengths and faults of foc"
has compact 'Host to board, id 0x020, 5 bytes.'
has compact 'Board to host, id 0x100 + s, 8 bytes, every 1 ms.'
has compact '- bits 22-37 `deflection`: i16, in 1e-05 rad, -0.32768 to 0.32767 rad'
has compact 'Answer: REPLY, id 0x6a0 + a, 7 bytes.'
has compact-fd 'Board to host, id 0x120 + a, 64 bytes, CAN FD with bit rate switch, every 1 ms.'
has compact-fd 'Board to host, id 0x240 + a, 32 bytes, CAN FD with bit rate switch, every 1 ms.'
[ ! -s "$work/out" ]
result $? "identifiers, lengths, scales and ranges of compact"

: >"$work/out"
has cia402 'Host to board, id 0x200 + n, 8 bytes, every 1 ms.'
has cia402 'Board to host, id 0x180 + n + 0x100 k, 8 bytes, every 1 ms.'
has cia402 'Answer: SDO_REPLY, id 0x580 + n, 8 bytes.'
has cia402 '- bit 7: following error'
has cia402 '- 0x6041 `Statusword`: u16, ro, TPDO'
has cia402 '- 0x607d:1-2 `Software position limit`: i32, rw, in 1e-05 rad'
[ ! -s "$work/out" ]
result $? "identifiers, faults and objects of cia402"

has_all_of coman icub && has_all_of coman-imu icub
result $? "every frame of the rigs coman and coman-imu is on the page"
has_all_of coman-foc foc
result $? "every frame of the rig coman-foc is on the page"
has_all_of coman-compact-imu compact && has_all_of coman-fd-imu compact-fd
result $? "every frame of the rigs coman-compact-imu and coman-fd-imu is on the page"
has_all_of coman-cia402 cia402
result $? "every frame of the rig coman-cia402 is on the page"

"$program" protocol icbu >"$work/out" 2>&1
[ $? -eq 2 ] && grep -q 'expected icub' "$work/out"
result $? "an unknown protocol is refused with the nearest"
"$program" protocol odrive >"$work/odrive" 2>"$work/out" &&
    "$program" protocol "$source/config/protocols/odrive.yaml" 2>"$work/out" | diff "$work/odrive" -
result $? "a protocol that a file describes goes by its name"
"$program" protocol odriv >"$work/out" 2>&1
[ $? -eq 2 ] && grep -q 'found no protocol "odriv", expected "odrive"' "$work/out"
result $? "an unknown name is refused with the nearest"
exit "$failed"
