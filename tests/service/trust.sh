#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: trust.sh COMAN-HIL
# What a rig of somebody else must not decide: where it is recorded outside this folder, and who
# reaches its page. --trust lets it, and so does a file that is installed. Prints TAP.
set -u
program=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/said"
mkdir "$work/here" && cd "$work/here" || exit 1

# rig NAME LINE...: a rig file of these lines
rig()
{
    local name=$1
    shift
    printf '%s\n' "extends: coman" "name: $name" "$@" >"$name.yaml"
}
# starts STATUS ARGUMENT...: a short run ends so
starts()
{
    local expected=$1
    shift
    timeout -k 5 60 "$program" run "$@" --clock free --duration 0.05 --control none --quiet \
        --transport local >"$work/said" 2>&1 </dev/null
    local status=$?
    [ $status -eq "$expected" ] || { echo "status $status" >>"$work/said" && false; }
}
said() { grep -q -e "$1" "$work/said"; }

echo 1..9

rig up 'record: {directory: ../stolen}'
starts 2 up.yaml && [ ! -e ../stolen ] &&
    said 'up.yaml:3:21: found "../stolen", expected a directory below.*--trust.*--record DIR'
result $? "a recording above this folder is refused where it stands, with what to type"

rig absolute "record: {directory: $work/stolen}"
rig hidden 'record: {directory: a/../../stolen}'
starts 2 absolute.yaml && starts 2 hidden.yaml && [ ! -e ../stolen ]
result $? "an absolute one, and one that goes up on the way"

mkdir ../elsewhere
ln -s ../elsewhere door
rig door 'record: {directory: door/stolen}'
starts 2 door.yaml && [ -z "$(ls ../elsewhere)" ]
result $? "one through a link"

rig below 'record: {directory: mine}'
starts 0 below.yaml && [ -s mine/summary.json ] && starts 0 up.yaml --record chosen &&
    [ -s chosen/summary.json ] && [ ! -e ../stolen ]
result $? "a folder below, and that of the command line, are taken"

starts 0 up.yaml --trust && [ -s ../stolen/summary.json ]
result $? "--trust lets the rig decide"

rig open 'page: {listen: "0.0.0.0:0"}'
rig six 'page: {listen: "[::]:0"}'
starts 2 open.yaml && said 'open.yaml:3:16: found "0.0.0.0:0", which other machines can reach' &&
    said 'type --trust .*--http' && starts 2 six.yaml && starts 0 open.yaml --http none &&
    starts 0 open.yaml --http 0 && starts 0 open.yaml --trust && said 'the page is not encrypted'
result $? "a page for other machines is refused, unless it is trusted or the command line decides"

rig closed 'page: {listen: "0"}'
rig named 'page: {listen: "127.0.0.1:0"}'
rig wrong 'page: {listen: "127.0.0.1:http"}'
starts 0 closed.yaml && starts 0 named.yaml && starts 2 wrong.yaml &&
    said 'wrong.yaml:3:16: listen: found "127.0.0.1:http", expected PORT or HOST:PORT'
tests_address=$?
starts 0 closed.yaml --http localhost:0 && starts 2 closed.yaml --http 80000 &&
    said 'found "80000", expected PORT or HOST:PORT, as in 8080, PORT from 0 to 65535' &&
    [ $tests_address -eq 0 ]
result $? "a page for this machine needs no trust, and an address that is none is told of its place"

# A program in PREFIX/bin has its rigs in PREFIX/share/coman-hil, as the service has them in /etc
mkdir -p "$work/usr/bin" "$work/usr/share"
cp -rL "$HIL_SOURCE_DIR/config" "$work/usr/share/coman-hil"
cp "$program" "$work/usr/bin/coman-hil"
program=$work/usr/bin/coman-hil
rm -rf ../stolen
cp up.yaml open.yaml "$work/usr/share/coman-hil/rigs"
starts 0 up && [ -s ../stolen/summary.json ] && starts 0 open
result $? "a rig that is installed is trusted"

starts 2 ./open.yaml && said 'open.yaml:3:16' &&
    printf '%s\n' 'extends: open' 'name: more' >more.yaml && starts 0 more.yaml
result $? "another of the same name is not; what a rig extends is judged by its own place"
exit $failed
