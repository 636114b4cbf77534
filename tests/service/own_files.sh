#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: own_files.sh COMAN-HIL
# Files that are none: no command waits for a pipe, takes a device or a socket for a file, follows a
# link below the folder that it was given, writes over what it reads, or removes what it has not
# made. Every command has a time limit. Prints TAP.
set -u
program=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/said"
cd "$work" || exit 1

# says STATUS TEXT ARGUMENT...: the command ends so, soon, and says so; TEXT "" is anything
says()
{
    local expected=$1 text=$2 status
    shift 2
    timeout -k 1 60 "$program" "$@" >said 2>&1 </dev/null
    status=$?
    [ $status -eq "$expected" ] && grep -qF -- "$text" said ||
        { echo "status $status of $*, expected $expected and: $text" >>said && false; }
}
# each FUNCTION: the function succeeds with each line of the standard input as its words
each()
{
    local line words
    while read -r line; do
        read -ra words <<<"$line"
        "$1" "${words[@]}" || return 1
    done
}
quick=(--clock free --transport local --duration 0.05 --control none --quiet)
examples=$HIL_SOURCE_DIR/examples/sweep

cat >one.urdf <<'END'
<robot name="r"><link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0"
ixz="0" iyz="0"/></inertial></link></robot>
END
cat >two.urdf <<'END'
<robot name="r"><link name="b"/><link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1"
izz="1" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><mesh filename="a.obj"/></geometry>
</collision></link><joint name="j" type="revolute"><parent link="b"/><child link="a"/><axis
xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/></joint></robot>
END
printf 'v %s\n' '0 0 0' '1 0 0' '0 1 0' '0 0 1' >a.obj
printf 'f %s\n' '1 3 2' '1 2 4' '1 4 3' '2 3 4' >>a.obj
cat >wrong.yaml <<'END'
name: wrong
description: Fails at once.
rig: coman
duration_s: 0.05
expectations:
  - {name: never, signal: LElbj.voltage, reaches: [5, 6], within_s: 0.02}
END
cp "$examples"/*.yaml . && sed -i 's/^samples: .*/samples: 1/' sweep.yaml
sed -i 's/^duration_s: .*/duration_s: 0.05/' squat.yaml
mkfifo pipe
python3 -c 'import socket; socket.socket(socket.AF_UNIX).bind("socket")'
truncate -s 3G huge

echo 1..12

says 0 "" run coman "${quick[@]}" --record rec --record-format both
result $? "a run is recorded for what follows"

# ---- inputs ----
no_file()
{
    local what
    for what in pipe socket /dev/zero; do
        says 2 "$what: found no regular file, expected a file" "${@//FILE/$what}" || return 1
    done
}
each no_file <<'END'
check FILE
test FILE
test FILE --list
test FILE --plan -o plan
test FILE --case 1
test FILE --merge
plot FILE --list
plot FILE --signal x -o x.svg
identify xl330-pendulum --recording FILE --free R_ohm
run coman --stimulus FILE --control none --transport local
run coman --task follow --trajectory FILE --control none --transport local
import FILE -o x
END
result $? "pipes, sockets and devices are no files to read, and nothing waits for them"

says 2 "expected at most" identify xl330-pendulum --recording huge --free R_ohm &&
    says 2 "expected at most" check huge && says 2 "expected at most" test huge
result $? "a file beyond what is read is refused by its size"

# ---- outputs ----
no_output()
{
    says 3 "pipe: a pipe that nobody reads" "${@//FILE/pipe}" &&
        says 2 "socket: found a socket, expected a file" "${@//FILE/socket}" && [ -S socket ]
}
each no_output <<'END'
dbc coman --bus torso -o FILE
plot rec --signal q_LKneeSag_rad -o FILE
test --plan sweep.yaml -o FILE
test squat.yaml --junit FILE
run coman --clock free --transport local --duration 0.05 --control none --quiet --ready FILE
END
result $? "nothing waits for the reader of a pipe, and a socket is not replaced"

timeout 60 cat pipe >heard &
says 0 "" dbc coman --bus torso -o pipe ||
    { sleep 1 && says 0 "" dbc coman --bus torso -o pipe; }
status=$?
wait $!
[ $status -eq 0 ] && [ -s heard ] && says 0 "" dbc coman --bus torso -o /dev/null &&
    "$program" dbc coman --bus torso -o /dev/stdout </dev/null | grep -v /dev/stdout |
    cmp -s - heard && "$program" dbc coman --bus torso -o >(cat >other) </dev/null
result $? "a pipe that somebody reads, /dev/null and /dev/stdout are written to"

# ---- an output that is an input ----
"$program" list robots >/dev/null
cp "$HIL_SOURCE_DIR"/config/rigs/xl330-pendulum.yaml rig.yaml
mkdir -p tree/rigs && cp -r "$HIL_SOURCE_DIR"/config/robots "$HIL_SOURCE_DIR"/config/drives tree/ &&
    cp rig.yaml tree/rigs/rig.yaml && rm rig.yaml
ln rec/signals.csv hard.svg
says 0 "" run tree/rigs/rig.yaml "${quick[@]}" --record swing --record-period 1 --record-format csv
sum=$(cat rec/signals.csv sweep.yaml squat.yaml tree/rigs/*.yaml tree/robots/*.yaml | cksum)
no_overwrite()
{
    says 2 ", which is read here, expected another one to write" "$@"
}
each no_overwrite <<'END'
plot rec --signal q_LKneeSag_rad -o hard.svg
test --plan sweep.yaml -o sweep.yaml
test --plan sweep.yaml -o ./squat.yaml
test squat.yaml --junit squat.yaml
identify tree/rigs/rig.yaml --recording swing/signals.csv --free R_ohm -o tree/rigs/rig.yaml
identify tree/rigs/rig.yaml --recording swing/signals.csv --free R_ohm -o swing/signals.csv
dbc tree/rigs/rig.yaml --bus servo -o tree/rigs/rig.yaml
dbc tree/rigs/rig.yaml --bus servo -o tree/robots/xl330-pendulum.yaml
END
[ $? -eq 0 ] && [ "$(cat rec/signals.csv sweep.yaml squat.yaml tree/rigs/*.yaml \
    tree/robots/*.yaml | cksum)" = "$sum" ]
result $? "no output takes the place of an input, by whatever name"

says 2 "expected a name that ends in .svg or .png" plot rec --signal q_LKneeSag_rad -o y.jpg &&
    [ ! -e y.jpg ]
result $? "a plot is not named after a format that it has not"

# ---- links below the folder that was given ----
mkdir -p far given o/x && echo precious >far/candump.log && echo precious >far/r.yaml
ln -s given results && ln -s ../far given/wrong && ln -s ../../far o/x/meshes
says 0 "1 cases" test --plan sweep.yaml -o o/p && ln -s ../far o/p.results
says 1 "found a symbolic link" test -o results wrong.yaml &&
    says 2 "o/p.results: found a symbolic link" test --case 1 o/p &&
    says 2 "o/x/meshes: found a symbolic link" import two.urdf -o o/x --force &&
    [ "$(ls far | xargs)" = "candump.log r.yaml" ] && [ "$(sort -u far/*)" = precious ]
result $? "links below the given folder are not followed"
rm given/wrong
says 1 "" test -o results wrong.yaml && [ -s given/wrong/signals.csv ]
result $? "the folder given may be one"

# ---- imports ----
says 2 "one.urdf: found no joint" import one.urdf -o one && [ ! -e one ]
result $? "an import that fails names its file and leaves no folder"

mkdir -p w/drives w/meshes && echo precious >w/meshes/a-shell1.obj
cp "$HIL_SOURCE_DIR"/config/drives/xl330.yaml w/drives/ 2>/dev/null ||
    cp "$(ls "$HIL_SOURCE_DIR"/config/drives/*.yaml | head -1)" w/drives/xl330.yaml
cp w/drives/xl330.yaml . && echo "# mine" >>w/drives/xl330.yaml
says 2 "w/drives/xl330.yaml: found it there already" import two.urdf -o w --drive ./xl330.yaml &&
    says 2 "a-shell1.obj: found it there" import two.urdf -o w --drive w/drives/xl330.yaml &&
    grep -q mine w/drives/xl330.yaml && [ "$(cat w/meshes/a-shell1.obj)" = precious ] &&
    [ ! -e w/robots ] &&
    says 0 "" import two.urdf -o w --drive w/drives/xl330.yaml --force &&
    grep -q mine w/drives/xl330.yaml && grep -q '^v' w/meshes/a-shell1.obj
result $? "the first import asks before it writes over drives and meshes"

# ---- the link of --slcan ----
ln -s far mine && ln -s /dev/pts/999999 left
says 2 "mine there already" run xl330-pendulum "${quick[@]}" --gateway 0 --slcan servo=mine &&
    [ -L mine ] && says 0 "" run xl330-pendulum "${quick[@]}" --gateway 0 --slcan servo=left &&
    [ ! -L left ]
result $? "--slcan replaces what a killed run has left and no other link"
exit $failed
