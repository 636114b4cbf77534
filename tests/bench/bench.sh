#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: bench.sh COMAN-HIL-BENCH
# The benchmarks from outside: manuals, what is refused, the files it writes, and that it works
# without other simulators. Figures are looked at for errors, never for times. Prints TAP.
set -u
program=$1
source=${HIL_SOURCE_DIR:?}
module=${HIL_BINARY_DIR:?}/tests/libhil-peers.so
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
. "$source/tests/service/tap.sh"
tap_show="out err"

# run STATUS ARGUMENTS...: runs bench; remembers whether the status is the expected one
run() {
    expected=$1
    shift
    "$program" "$@" >out 2>err </dev/null
    status=$?
    problem=
    [ "$status" -eq "$expected" ] || problem="exit status $status, expected $expected"
}
# says FILE TEXT: FILE holds TEXT
says() { grep -Fq -- "$2" "$1" || problem="$problem; no \"$2\" in $1"; }
# lines FILE N: FILE has N lines
lines() { [ "$(wc -l <"$1")" -eq "$2" ] || problem="$problem; not $2 lines in $1"; }

# conclude NAME: the test's result, with the problem
conclude() {
    test -z "$problem"
    result $? "$1" "$problem"
}

echo 1..9

run 0 --help
says out '  dynamics'
says out '  paper'
conclude help_lists_the_benchmarks

run 2
says err 'usage: coman-hil-bench'
conclude no_name_prints_the_usage_as_an_error

run 2 contcat
says err 'expected "contact"'
conclude unknown_name_is_refused_with_the_nearest

run 4 dynamics "$source/config/robots/coman.yaml" --peers "$work/none.so"
says err none.so
conclude missing_module_that_was_named_is_an_error

# alone: a copy of the program has no module beside it
mkdir -p far/away
cp "$program" far/away/
far/away/coman-hil-bench dynamics "$source/config/robots/hyq-leg.yaml" --rounds 1 >out 2>err
status=$?
problem=
[ $status -eq 0 ] || problem="exit status $status"
says err 'found no libhil-peers.so'
says err 'ours only'
says out generic
conclude without_other_simulators_ours_are_measured

# cases of 4 s, once, so that their ticks take far longer than a start: what it counts, not the time
run 0 throughput hyq-leg --rounds 1 --seconds 4 --peers "$module" -o throughput.json
says out 'simulated s/core-hour'
says out 'hyq-leg'
python3 - throughput.json <<'END' || problem="$problem; figures"
import json, sys
file = json.load(open(sys.argv[1]))
(rig,) = file["rigs"]
assert (file["format_version"], file["rounds"], file["case_s"]) == (2, 1, 4)
assert (rig["rig"], rig["task"], rig["buses"], rig["axes"]) == ("hyq-leg", "hold", 1, 2)
for name in "simulated_s_per_core_hour", "cases_per_core_hour", "case_mb", "start_in_range_ms":
    assert rig[name]["median"] > 0, name
assert (rig["mujoco_s_per_core_hour"] is None) == (file["mujoco"] is None)
assert rig["standing_s_per_core_hour"] is None, "a leg on a bench"
END
conclude throughput_measures_whole_cases

# a figure of one that stands says that it was still there at the end, in both simulators
run 0 throughput "$source/config/rigs/coman.yaml" --alone --rounds 1 --seconds 2 \
    --peers "$module" -o throughput.json
says out 'standing on its feet'
python3 - throughput.json <<'END' || problem="$problem; figures"
import json, sys
file = json.load(open(sys.argv[1]))
(rig,) = file["rigs"]
assert rig["standing_s_per_core_hour"]["median"] > 0
assert rig["simulated_s_per_core_hour"] is None, "no case ran"
assert (rig["mujoco_standing_s_per_core_hour"] is None) == (file["mujoco"] is None)
END
conclude throughput_stands

# refuses STATUS WORD ARGUMENTS...: no measurement, and WORD in what is said
refuses() {
    expected=$1
    word=$2
    shift 2
    run "$expected" throughput "$@"
    says err "$word"
    refused="$refused$problem"
}
refused=
refuses 2 no-such-rig no-such-rig
refuses 2 danse hyq-leg --task danse
refuses 2 --rounds hyq-leg --rounds 0
refuses 2 --seconds hyq-leg --seconds 0.01
refuses 4 none.so hyq-leg --peers "$work/none.so"
problem=$refused
conclude throughput_refuses_what_it_cannot_measure

run 0 dynamics "$source/config/robots/coman.yaml" --rounds 2 --out results --peers "$module"
says out "speed: of the whole robot, times "
says results/dynamics.csv 'engine,version,degrees_of_freedom,median_us,low_us,high_us,difference'
version=$("$HIL_BINARY_DIR/coman-hil" --version | cut -d' ' -f2)
for dof in 12 18 21 29; do says results/dynamics.csv "generic,$version,$dof,"; done
says results/dynamics.svg '</svg>'
# ours and theirs compute the same: the last column
awk -F, 'NR > 1 && !($7 <= 1e-10) { bad = 1 } END { exit bad }' results/dynamics.csv ||
    problem="$problem; differences beyond 1e-10"
conclude dynamics_writes_its_table_and_plot

exit "$failed"
