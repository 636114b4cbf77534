#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: completion.sh COMAN-HIL COMAN-HIL-BENCH
# The completion scripts: what bash offers for command lines, by running its completion function as
# bash does, what fish offers, and the syntax of the one for zsh. Prints TAP.
set -u
program=$1 bench=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "${HIL_SOURCE_DIR:?}/tests/service/tap.sh"
tap_show="$work/out"
"$program" --completion=bash >"$work/coman-hil" && . "$work/coman-hil"
"$bench" --completion=bash >"$work/coman-hil-bench" && . "$work/coman-hil-bench"
cd "$work" || exit 1
mkdir recordings
touch mine.yaml signals.csv

# offer WORD...: what is offered for the last word, which may be empty, in "$work/out"
offer() {
    COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
    case $1 in *-bench) _coman_hil_bench ;; *) _coman_hil ;; esac
    printf '%s\n' "${COMPREPLY[@]}" >"$work/out"
}
# offers NAME EXPECTED WORD...: exactly these, in any order
offers() {
    local name=$1 expected=$2
    shift 2
    offer "$@"
    [ "$(tr ' ' '\n' <<<"$expected" | sort)" = "$(sort "$work/out")" ]
    result $? "$name"
}
# options PROGRAM COMMAND: a line for each option that --help lists, "-o, --output DIR" as two
options() {
    "$1" "$2" --help |
        sed -nE 's/^  (-[a-z]), (--[a-z-]+)( [^ ]+)?( .*)?$/\1\3\n\2\3/p; t
                 s/^  (-[a-z-]+)( [^ ]+)?( .*)?$/\1\2/p'
}
# what a command's --help says for zsh: options with their arguments, places with operands
zsh_expected() {
    local operand number=0
    options "$program" "$1" | sed 's/^[^ ]*$/& /' | grep -v '^--help '
    for operand in $("$program" "$1" --help |
        sed -nE '1s/^usage: [a-z-]+ [a-z]+ ?(\[OPTIONS\])?//p'); do
        number=$((number + 1))
        case $operand in *...) printf '*' ;; *) printf %s $number ;; esac
        operand=${operand%...}
        case $operand in \[*\]) printf ': ' ;; *) printf ' ' ;; esac
        tr -d '[]' <<<"$operand"
    done
}
# the same as its script says it to _arguments: NAME=[TEXT]:ARGUMENT:... and NUMBER:NAME:...
zsh_found() {
    zsh -fc "_arguments() { print -rl -- \$@ }
        words=(coman-hil $1 '') CURRENT=3; source $work/_coman-hil" |
        sed -E 's/\\\[/\x01/g; s/\\\]/\x02/g; s/\\:/\x03/g' | grep -v '^--help' |
        sed -nE "s/^\*?(-[a-z-]+)=?\[[^]]*\](:([^:']*).*)?$/\1 \3/p
                 s/^([0-9]+|\*)(:?):([^:]*):.*/\1\2 \3/p" | tr '\1\2\3' '[]:'
}

echo 1..31
commands=$("$program" --help | sed -n '/^coman-hil COMMAND/q; s/^  \([a-z]\+\) .*/\1/p')
offers "every command" "$(echo $commands --help --version)" "$program" ""
offers "commands that begin so" "check" "$program" ch

wrong=0
for command in $commands; do
    options=$(options "$program" "$command" | cut -d ' ' -f 1)
    offer "$program" "$command" -
    [ "$(sort <<<"$options")" = "$(sort "$work/out")" ] || {
        wrong=1
        break
    }
done
result $wrong "every option that --help lists, of every command"
subjects=$("$bench" --help | sed -n '/^coman-hil-bench COMMAND/q; s/^  \([a-z]\+\) .*/\1/p')
wrong=0
for command in $subjects; do
    options=$(options "$bench" "$command" | cut -d ' ' -f 1)
    offer "$bench" "$command" -
    [ "$(sort <<<"$options")" = "$(sort "$work/out")" ] || {
        wrong=1
        break
    }
done
result $wrong "the same of the benchmarks"

offers "words of an option" "real lockstep free" "$program" run coman --clock ""
offers "the same behind =" "lockstep" "$program" run coman --clock = l
offers "and of nothing behind =" "ideal wire" "$program" run coman --wire =
offers "rigs by name" "walkman" "$program" run walkm
offers "rigs behind options with values" "walkman" "$program" run --duration 5 --clock = free walkm
offers "no second rig" "" "$program" run coman ""
offers "tasks, then rigs" "squat" "$program" task sq
offers "rigs after tasks" "walkman" "$program" task squat walkm
offers "more scenarios" "push_recovery" "$program" test brown_out push
offers "robots of a benchmark" \
    "ak80-6-pendulum arm coman hyq hyq-leg sea-rmd-x8 walkman xl330-pendulum" \
    "$bench" dynamics ""
offers "files where no name begins so" "mine.yaml" "$program" check min
offers "folders for a recording" "recordings" "$program" run coman --record ""
offers "commands of ctl" "statistics status" "$program" ctl stat

# lines NAME EXPECTED WORD...: exactly these lines, in any order
lines() {
    local name=$1 expected=$2
    shift 2
    offer "$@"
    [ "$(sort <<<"$expected")" = "$(sort "$work/out")" ]
    result $? "$name"
}
offers "joints of the rig on the line" "LKneeSag" "$program" task sweep coman --joint LKn
COMP_WORDS=("$program" run --joint LKn coman) COMP_CWORD=3 COMPREPLY=()
_coman_hil
[ "${COMPREPLY[*]}" = LKneeSag ]
result $? "also when the cursor stands before it"
offers "drives of the catalogue" "$("$program" list drives --names | grep '^m')" \
    "$program" import --drive m
offers "settings of tasks" "walk.step_s= walk.step_length_m=" "$program" run coman --set walk.st
lines "faults, their spaces quoted" 'motor\ LKneeSag\ jam' "$program" run coman --fault \
    'motor\ LKneeSag\ j'
lines "faults within quotes" 'motor LKneeSag jam' "$program" run coman --fault "'motor LKneeSag j"
"$program" list faults coman --names >"$work/faults"
offer "$program" run coman --fault "'"
[ -s "$work/faults" ] && cmp -s "$work/out" "$work/faults"
result $? "all faults of the rig"

"$program" --completion=zsh >"$work/_coman-hil"
if command -v zsh >/dev/null; then
    wrong=0
    for command in $commands; do
        zsh_expected "$command" | sort >"$work/expected"
        zsh_found "$command" | sort | diff "$work/expected" - >"$work/out" || {
            wrong=1
            break
        }
    done
    result $wrong "zsh is told the arguments and operands that --help names, of every command"
    zsh -n "$work/_coman-hil" >"$work/out" 2>&1 &&
        "$bench" --completion=zsh >"$work/_coman-hil-bench" &&
        zsh -n "$work/_coman-hil-bench" >"$work/out" 2>&1
    result $? "zsh understands its scripts"
else
    skip "zsh is told what --help names" "zsh is not installed"
    skip "zsh understands its scripts" "zsh is not installed"
fi

# fish_offers EXPECTED LINE: fish offers exactly these lines, in any order
fish_offers() {
    local expected=$1
    PATH=$work/bin:$PATH HOME=$work fish --no-config -c "source $work/coman-hil.fish
        complete -C'$2'" 2>"$work/err" | cut -f 1 >"$work/out"
    [ "$(sort <<<"$expected")" = "$(sort "$work/out")" ]
}
if command -v fish >/dev/null; then
    mkdir "$work/bin"
    ln -s "$(realpath "$program")" "$work/bin/coman-hil"
    "$program" --completion=fish >"$work/coman-hil.fish"
    "$bench" --completion=fish >"$work/coman-hil-bench.fish"
    fish --no-execute "$work/coman-hil.fish" && fish --no-execute "$work/coman-hil-bench.fish"
    result $? "fish understands its scripts"
    fish_offers "$commands" 'coman-hil '
    result $? "fish: every command"
    fish_offers $'real\nlockstep\nfree' 'coman-hil run coman --clock '
    result $? "fish: words of an option"
    fish_offers walkman 'coman-hil run --duration 5 walkm' &&
        fish_offers squat 'coman-hil task sq' && fish_offers walkman 'coman-hil task squat walkm'
    result $? "fish: rigs and tasks in their places"
    fish_offers LKneeSag 'coman-hil task sweep coman --joint LKn' &&
        fish_offers $'walk.step_s=\nwalk.step_length_m=' 'coman-hil run coman --set walk.st' &&
        fish_offers 'motor LKneeSag jam' 'coman-hil run coman --fault motor\ LKneeSag\ j'
    result $? "fish: what a rig has"
else
    for name in "understands its scripts" "every command" "words of an option" \
        "rigs and tasks in their places" "what a rig has"; do
        skip "fish: $name" "fish is not installed"
    done
fi
exit $failed
