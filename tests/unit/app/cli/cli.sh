#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: cli.sh COMAN-HIL
# The frame of the program: manuals, unknown words, exit statuses, where messages go. Prints TAP.
set -u
program=$1
source=${HIL_SOURCE_DIR:?}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$source/tests/service/tap.sh"
tap_show="$work/out $work/err"

problem=
# run STATUS ARGUMENTS...: runs the program; remembers whether the status is the expected one
run() {
    expected=$1
    shift
    "$program" "$@" >"$work/out" 2>"$work/err" </dev/null
    status=$?
    [ "$status" -eq "$expected" ] ||
        problem="$problem; exit status $status, expected $expected: $*"
}
# says FILE TEXT: FILE (out or err) holds TEXT
says() { grep -Fq -- "$2" "$work/$1" || problem="$problem; no \"$2\" in $1"; }
# silent FILE: FILE is empty
silent() { [ ! -s "$work/$1" ] || problem="$problem; $1 is not empty"; }

# conclude NAME: the test's result, with the problem
conclude() {
    test -z "$problem"
    result $? "$1" "$problem"
    problem=
}

echo 1..41

run 0 --help
says out 'usage: coman-hil COMMAND'
for command in run task check accel help version; do says out "  $command"; done
says out 'Exit status: 0 ok; 1'
silent err
conclude help_lists_every_command_and_the_exit_statuses

run 2
says err 'usage: coman-hil COMMAND'
silent out
conclude no_command_prints_the_usage_as_an_error

run 0 --help
for command in import dbc eds generate test plot; do
    run 0 "$command" --help
    says out '-o, --output '
done
mkdir "$work/short" "$work/long"
run 0 dbc "$source/config/rigs/coman.yaml" -o "$work/short"
run 0 dbc "$source/config/rigs/coman.yaml" --output "$work/long"
[ -e "$work/long/coman-torso.dbc" ] && diff -r "$work/short" "$work/long" >"$work/out" ||
    problem="$problem; not the same files"
conclude what_is_written_goes_to_output_or_o

run 0 dbc "$source/config/rigs/coman.yaml" -o "$work/new/deep"
[ -e "$work/new/deep/coman-torso.dbc" ] || problem="$problem; no file in a folder of its own"
run 0 eds "$source/config/rigs/coman-cia402.yaml" -o "$work/new/deeper"
[ -e "$work/new/deeper/coman-cia402-torso_0x01.eds" ] || problem="$problem; no EDS in its folder"
run 2 replay "$work/none" --http 0
says err 'none: cannot be read: No such'
conclude dbc_and_eds_make_their_folder_and_replay_misses_its_own

# In each of these: the names of commands that take a rig by its name
for name in $("$program" --completion=bash |
    awk -F';' '$2 == "operand" && $6 == "rigs" {print $1}' | sort -u); do
    "$program" list --help | tr '\n' ' ' | sed 's/  */ /g' |
        grep -q "rigs ([^)]*\b$name\b" || problem="$problem; no $name in list --help"
done
conclude the_manual_of_list_has_every_command_that_takes_a_rig

for spelling in taks tsak taskk; do
    run 2 run coman --$spelling squat
    says err "found unknown option --$spelling, expected --task"
done
conclude an_option_with_two_letters_swapped_is_recognized

# Numbers of things that grow
run 0 --help
grep -qE '\b(two|three|four|five|six) personalities' "$work/out" &&
    problem='a number of personalities'
grep -qE '[0-9]+ scenarios' "$source/README.md" && problem="$problem; a number of scenarios"
conclude neither_help_nor_readme_counts_what_is_listed_elsewhere

run 0 run coman --clock free --duration 0.05 --control none --quiet --record "$work/recording"
run 0 plot "$work/recording" --signal q_LKneeSag_rad
says out '<svg'
mkdir "$work/empty"
run 2 plot "$work/empty" --list
says err 'found no signals.csv in the directory, expected a recording'
if command -v script >/dev/null; then
    script -qec "$program plot $work/recording --signal q_LKneeSag_rad" "$work/typed" >/dev/null
    grep -q 'found a terminal to write an SVG to, expected --output' "$work/typed" &&
        ! grep -q '<svg' "$work/typed" || problem="$problem; an SVG in a terminal"
fi
conclude plot_takes_a_recording_and_fills_no_terminal

# A value that only the command can judge is refused with its option, a missing part with its name
run 2 plot "$work/recording" --signal q_LKneeSag_rad --from -1 --to 0
says err '--from, --to: found no row from -1 to 0 s, expected times within 0.01 to 0.05 s'
run 2 run walk-flat --clock free --task walk --set '[::1]:0' --control none
says err '--set: found "[::1]:0", expected NAME=VALUE'
run 2 run xl330-pendulum --clock free --task squat --control none
says err 'squat: the rig has no squat (tasks: squat)'
sed 's|^rig: .*|rig: ../nope.yaml|' "$source/config/scenarios/push_recovery.yaml" >"$work/lost.yaml"
line=$(grep -n '^rig:' "$work/lost.yaml" | cut -d: -f1)
run 2 test "$work/lost.yaml"
says err "lost.yaml:$line:6: "
says err 'nope.yaml: cannot be read'
conclude errors_name_the_option_or_the_place_that_is_to_be_changed

run 0 --version
says out 'coman-hil 0.'
cp "$work/out" "$work/version"
conclude version_is_printed

run 0 version
cmp -s "$work/out" "$work/version" || problem="differs from --version"
conclude version_is_a_command_too

run 2 chekc x
says err 'coman-hil: found unknown command "chekc", expected "check"'
silent out
conclude rejects_unknown_command_and_names_the_nearest

run 2 --nonsense
says err 'coman-hil: found unknown command "--nonsense", expected one that is listed by --help'
conclude rejects_unknown_option_before_the_command

problem=
for command in run task check accel; do
    "$program" "$command" --help >"$work/out" 2>"$work/err" ||
        problem="$problem; $command --help fails"
    says out "usage: coman-hil $command"
    says out '--help'
    silent err
    awk 'length($0) > 80 { exit 1 }' "$work/out" || problem="$problem; $command --help is too wide"
    "$program" help "$command" >"$work/help" || problem="$problem; help $command fails"
    cmp -s "$work/out" "$work/help" ||
        problem="$problem; help $command differs from $command --help"
done
conclude every_command_has_a_manual_of_eighty_columns

run 2 help chekc
says err 'expected "check"'
conclude help_of_an_unknown_command_names_the_nearest

run 0 help rt
says out 'The budget of a tick'
cp "$work/out" "$work/topic"
"$program" --help rt | cmp -s - "$work/topic" || problem="$problem; --help rt differs from help rt"
awk 'length($0) > 80 { exit 1 }' "$work/topic" || problem="$problem; it is too wide"
silent err
conclude help_has_topics_beside_the_commands

problem=
for command in run task check accel; do
    "$program" "$command" --nosuchoption >"$work/out" 2>"$work/err"
    status=$?
    [ $status -eq 2 ] || problem="$problem; $command: status $status"
    says err "coman-hil $command: found unknown option --nosuchoption"
    silent out
done
conclude every_command_refuses_unknown_options

run 2 check
says err 'coman-hil check: found no RIG, expected a rig'
conclude check_asks_for_its_file

run 0 check "$source/config/rigs/coman.yaml"
says out '24 bodies, 23 joints, 23 drives, 29 degrees of freedom, 28.3574 kg'
says out '5, 21 boards, 23 driven joints, 4 F/T sensors'
says out 'mesh of 504 faces on RFoot'
says out 'F/T     l_leg_ft, 2000 N, 40 N m, every 5 ms'
silent err
conclude check_prints_what_is_in_a_rig

run 0 check --robot "$source/config/robots/coman.yaml"
says out '28.3574 kg'
run_default=$(sed -n 's/.*hash //p' "$work/out")
silent err
conclude check_prints_what_is_in_a_robot

run 0 check --robot "$source/config/robots/coman.yaml" --variant forearms
says out '31.45386 kg'
[ "$(sed -n 's/.*hash //p' "$work/out")" != "$run_default" ] ||
    problem="$problem; same hash as the default"
conclude check_knows_the_variants_of_a_robot

run 2 check "$source/config/rigs/coman.yaml" --variant forearms
says err '--variant: found without --robot'
conclude check_refuses_a_variant_without_a_robot

sed 's/WaistYaw, spare/WaistYow, spare/' "$source/config/rigs/coman.yaml" >"$work/bad"
mkdir -p "$work/config/rigs" &&
    ln -s "$source/config/robots" "$source/config/meshes" "$work/config/"
cp "$work/bad" "$work/config/rigs/bad.yaml"
line=$(grep -n WaistYow "$work/bad" | cut -d: -f1)
run 2 check "$work/config/rigs/bad.yaml"
says err "coman-hil check: $work/config/rigs/bad.yaml:$line:"
says err 'found unknown joint "WaistYow", expected "WaistYaw"'
silent out
conclude check_says_what_is_wrong_and_where_and_prints_nothing_else

run 2 check "$work/none.yaml"
says err "none.yaml: cannot be read: No such file or directory"
silent out
conclude check_says_that_a_file_is_missing

run 2 check "$work"
says err 'found a directory, expected a file'
conclude check_refuses_a_directory

run 2 check --robot "$source/config/rigs/coman.yaml"
says err 'found unknown key "robot" in a robot'
conclude check_refuses_a_rig_as_a_robot

run 2 run "$source/config/rigs/coman.yaml" --duration abc --record "$work/record"
says err 'coman-hil run: --duration: found "abc", expected a number of seconds more than 0 and '
silent out
[ ! -e "$work/record" ] || problem="$problem; the record was started"
conclude run_starts_nothing_when_the_command_line_is_wrong

run 2 run coman --duration 0
says err 'found "0", expected a number of seconds more than 0 and at most 10000000'
run 2 run coman --duration -1
says err 'found "-1", expected a number of seconds more than 0 and at most 10000000'
conclude run_lasts_longer_than_nothing

cp "$source/examples/sweep/sweep.yaml" "$source/examples/sweep/squat.yaml" "$work"
run 2 test "$work/sweep.yaml"
says err "sweep.yaml: found a sweep: --plan with --output PLAN makes its plan"
run 0 test --plan "$work/sweep.yaml" --output "$work/squat.plan"
run 2 test "$work/squat.plan"
says err "squat.plan: found a plan: --case CASES runs cases of it"
conclude test_says_how_sweeps_and_plans_are_given

problem=
for noun in rig robot scenario task bus board fault signal; do
    "$program" help $noun >"$work/out" 2>"$work/err" || problem="$problem; help $noun fails"
    [ "$(wc -l <"$work/out")" -ge 5 ] || problem="$problem; help $noun says next to nothing"
    awk 'length($0) > 80 { exit 1 }' "$work/out" || problem="$problem; help $noun is too wide"
    "$program" help ${noun}s >"$work/plural" 2>&1 || [ $noun = task ] || [ $noun = bus ] ||
        problem="$problem; help ${noun}s fails"
done
conclude help_knows_every_noun

# the first rig that the manual has a user write
mkdir "$work/first"
sed -n 's/^  \(extends\|name\|supply_v\)/\1/p' "$source/app/cli/manual/rig.txt" \
    >"$work/first/mine.yaml"
run 0 check "$work/first/mine.yaml"
says out 'rig         mine'
conclude the_example_of_help_rig_is_a_rig

cd "$work"
run 0 list
for noun in Rigs Robots Scenarios Tasks; do says out "$noun (coman-hil"; done
for name in coman-foc walkman push_recovery grasp; do says out "  $name "; done
awk 'length($0) > 80 { exit 1 }' "$work/out" || problem="$problem; it is too wide"
silent err
for noun in rigs robots scenarios; do
    "$program" list $noun --names >"$work/out" 2>"$work/err"
    (cd "$source/config/$noun" && ls -- *.yaml) | sed 's/.yaml$//' | LC_ALL=C sort >"$work/expected"
    cmp -s "$work/out" "$work/expected" || problem="$problem; $noun are not those of config"
    "$program" list $noun | grep -E 'yaml|malformed|found' >"$work/out" &&
        problem="$problem; $noun without a description: $(cat "$work/out")"
done
conclude a_built_tree_lists_what_is_in_it_with_a_line_each

run 2 list nonsense
says err 'found "nonsense", expected rigs, robots, scenarios, drives'
conclude list_refuses_what_it_does_not_know

# names, from a folder that has no files of them
run 0 check coman
says out "rig         coman, "
run 0 check --robot walkman
says out 'robot       WALK-MAN'
run 0 test --list push_recovery
says out 'push_recovery force_n=10'
run 2 run comna --duration 1
says err 'coman-hil run: found no rig "comna", expected "coman"'
run 2 check --robot walkmna
says err 'found no robot "walkmna", expected "walkman"'
run 2 test push_recovry
says err 'found no scenario "push_recovry", expected "push_recovery"'
sed 's|file: ../robots/coman.yaml|file: coman|' "$source/config/rigs/coman.yaml" \
    >"$work/config/rigs/named.yaml"
run 0 check "$work/config/rigs/named.yaml"
says out 'robot       COMAN'
sed 's|file: ../robots/coman.yaml|file: comna|' "$source/config/rigs/coman.yaml" \
    >"$work/config/rigs/named.yaml"
run 2 check "$work/config/rigs/named.yaml"
says err 'named.yaml:'
says err 'found no robot "comna", expected "coman"'
conclude names_go_wherever_files_do_and_the_nearest_is_offered

ln -s "$source/config" "$work/shipped"
printf 'extends: shipped/rigs/coman.yaml\nrobot: {added_mass_kg: {Waist: 2}}\n' >"$work/heavy.yaml"
run 0 check "$work/heavy.yaml"
says out 'dynamics fastest'
"$program" doctor --local --measure 0 "$work/heavy.yaml" >"$work/out" 2>"$work/err"
says out 'built-in generated dynamics ('
"$program" run --transport local --clock free --ticks 2 --control none "$work/heavy.yaml" \
    >"$work/out" 2>"$work/err" </dev/null || problem="$problem; it does not run"
says err 'built-in generated dynamics ('
! grep -q folder "$work/err" || problem="$problem; speaks of a folder"
conclude added_masses_are_inputs_of_built_in_dynamics_and_it_is_said

run 0 bench
for subject in contact dynamics paper throughput; do says out "  $subject "; done
run 0 bench contact --help
says out 'usage: coman-hil-bench contact'
run 2 bench contcat
says err 'expected "contact"'
conclude bench_lists_its_subjects_and_runs_them

problem=
for shell in bash zsh; do
    "$program" --completion=$shell >"$work/out" 2>"$work/err" || problem="$problem; $shell fails"
    silent err
done
run 2 --completion=tcsh
conclude completion_scripts_are_printed

run 2 help fooo
says err 'found unknown command or topic "fooo"'
says err 'the topics are rig, robot, scenario, bus, board, fault, signal, rt'
run 2 help scenaro
says err 'expected "scenario"'
conclude help_speaks_of_topics

# quiet: the summary, and warnings; not quiet: where the lines are that a flood leaves out
run 0 run coman --clock free --duration 0.2 --task squat --quiet
says out 'state hash'
silent err
run 0 run coman --clock free --duration 0.3 --hold none --quiet \
    --fault 'board left_leg/2 hung 0.1..'
says out 'state hash'
! grep -Ev 'warning|time-out|limit|ground|left_leg' "$work/err" ||
    problem="$problem; more than warnings"
run 0 run coman --clock free --duration 0.2 --task squat --record "$work/flood"
says err "more like it ($work/flood/events.log has all), the last:"
run 0 run coman --clock free --duration 0.2 --task squat
says err 'more like it (run --record DIR: DIR/events.log has all), the last:'
conclude quiet_is_quiet_and_a_flood_says_where_its_lines_are

# a rig that lacks something for a task; not when something else is wrong
run 2 run coman --clock free --duration 0.1 --task walk
says err 'no inertial board, expected one on the pelvis; rigs that can run the task walk: '
says err 'walk-flat'
run 2 run hyq --clock free --duration 0.1 --task grasp
says err 'rigs that can run the task grasp: '
! grep -q 'walk-flat' "$work/err" || problem="$problem; walk-flat grasps"
for wrong in '--task walkk' '--task sweep' '--task squat --set squat.nonsense=1'; do
    # shellcheck disable=SC2086  # words
    run 2 run coman --clock free --duration 0.1 $wrong
    ! grep -q 'rigs that can' "$work/err" || problem="$problem; $wrong is of the rig"
done
conclude a_task_names_the_rigs_that_can

problem=
if [ -e /dev/full ]; then
    "$program" check "$source/config/rigs/coman.yaml" >/dev/full 2>"$work/err"
    status=$?
    [ $status -eq 3 ] || problem="exit status $status, expected 3"
    says err 'standard output could not be written'
    conclude output_that_cannot_be_written_is_an_error
else
    skip output_that_cannot_be_written_is_an_error "no /dev/full"
fi
exit "$failed"
