#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: user_job.sh CMAKE COMAN_HIL
# The repository of examples/ci, as a user runs it: copied into an empty folder, with an installed
# client library. Its job passes, and fails when the controller has a fault. vcan.sh runs in
# user-mode Linux. Prints TAP.
set -u
cmake=$1 program=$2
work=$(mktemp -d "$HIL_BINARY_DIR/user_job-XXXXXX")
trap 'rm -rf "$work"' EXIT
. "$HIL_SOURCE_DIR/tests/service/tap.sh"
tap_show="$work/out"
PATH=$(dirname "$program"):$PATH
export PATH PYTHON=/usr/bin/python3 PYTHONPATH=$HIL_SOURCE_DIR/python

if [ "${3:-}" = guest ]; then
    echo 1..2
    cp -r "$HIL_SOURCE_DIR/examples/ci" "$work/vcan" && cd "$work/vcan" || exit 1
    sh vcan.sh >"$work/out" 2>&1
    result $? "both boards answer over vcan"
    # as `docker run --cap-add NET_ADMIN` has it, with no other privilege
    rm -f ready
    unshare --net setpriv --bounding-set -all,+net_admin sh -ec '
        ip link add can0 type vcan
        ip link set can0 up
        exec sh vcan.sh' >"$work/out" 2>&1
    result $? "a name space of its own and NET_ADMIN are enough"
    exit $failed
fi

"$cmake" --install "$HIL_BINARY_DIR" --component client --prefix "$work/prefix" >"$work/out" 2>&1
PKG_CONFIG_PATH=$(dirname "$(find "$work/prefix" -name coman-hil-client.pc)")
export PKG_CONFIG_PATH

# job: runs the job; fills in $cases and $failures from its JUnit files
job() {
    sh job.sh >"$work/out" 2>&1
    local status=$?
    cases=$(cat results/*.xml | grep -o '<testcase ' | wc -l)
    failures=$(cat results/*.xml | grep -o '<failure' | wc -l)
    return $status
}

echo 1..5
cp -r "$HIL_SOURCE_DIR/examples/ci" "$work/robot" && cd "$work/robot" || exit 1
job && [ "$cases $failures" = "4 0" ]
result $? "the job passes with four cases"
sed -i 's/JAM_TICKS = 48/JAM_TICKS = 1000000/' controller.c
job
[ $? = 1 ] && [ "$failures" = 1 ] && [ -s results/switches_off/candump.log ] &&
    grep -q 'message="the board does not trip: .*seen 1 times.*expected 0' results/scenarios.xml
result $? "a controller that overlooks a jam fails the job, which keeps frames and says the value"
make clean >"$work/out" 2>&1 && [ ! -e results ]
result $? "make clean removes the results"
python=$(/usr/bin/python3 -c 'import sys, yaml
for name in sys.argv[1:]:
    text = open(name).read()
    assert yaml.safe_load(text) and "sh job.sh" in text, name
' github-workflow.yml gitlab-ci.yml 2>&1)
[ -z "$python" ] || echo "$python" >"$work/out"
[ -z "$python" ]
result $? "the workflows are YAML and run the job"
bash "$HIL_SOURCE_DIR/tests/bus/uml/run.sh" -t 120 bash "$0" "$cmake" "$program" guest \
    >"$work/out" 2>&1
result $? "vcan.sh works in a kernel that has vcan"
exit $failed
