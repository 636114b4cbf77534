#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# usage: completion.sh COMAN-HIL COMAN-HIL-BENCH
# The completion scripts: what bash offers for command lines, by running its completion function as
# bash does, and the syntax of the one for zsh. Prints TAP.
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
# the same as its script says it: 'NAME=[TEXT]:ARGUMENT:...' and 'NUMBER:NAME:...'
zsh_found() {
    sed -n "/^    $1)\$/,/^ *;;/p" "$work/_coman-hil" |
        sed -E 's/\\\[/\x01/g; s/\\\]/\x02/g; s/\\:/\x03/g' |
        sed -nE "s/^ +'\*?(-[a-z-]+)=?\[[^]]*\](:([^:']*).*)?'.*/\1 \3/p
                 s/^ +'([0-9]+|\*)(:?):([^:]*):.*/\1\2 \3/p" | tr '\1\2\3' '[]:'
}

echo 1..19
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
offers "robots of a benchmark" "coman hyq hyq-leg walkman" "$bench" dynamics ""
offers "files where no name begins so" "mine.yaml" "$program" check min
offers "folders for a recording" "recordings" "$program" run coman --record ""
offers "commands of ctl" "statistics status" "$program" ctl stat

"$program" --completion=zsh >"$work/_coman-hil"
wrong=0
for command in $commands; do
    zsh_expected "$command" | sort >"$work/expected"
    zsh_found "$command" | sort | diff "$work/expected" - >"$work/out" || {
        wrong=1
        break
    }
done
result $wrong "zsh is told the arguments and operands that --help names, of every command"

if command -v zsh >/dev/null; then
    zsh -n "$work/_coman-hil" >"$work/out" 2>&1 &&
        "$bench" --completion=zsh >"$work/_coman-hil-bench" &&
        zsh -n "$work/_coman-hil-bench" >"$work/out" 2>&1
    result $? "zsh understands its scripts"
else
    skip "zsh understands its scripts" "zsh is not installed"
fi
exit $failed
