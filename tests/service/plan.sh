#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Sweeps: plans are frozen and the same again, cases are idempotent, results merge into the same
# bytes in whatever order they came, and what does not belong together is refused. Prints TAP.
set -u
program=$HIL_BINARY_DIR/coman-hil
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
. "$(dirname "$0")/tap.sh"
tap_show="$work/out"
cp "$HIL_SOURCE_DIR"/examples/sweep/*.yaml "$work"
cd "$work" || exit 1
sed -i 's/^samples: .*/samples: 6/' sweep.yaml
sed -i 's/^duration_s: .*/duration_s: 0.05/; s/\[-0.4, 0.4\]/[-0.4, 0.4], within_s: 0.04/' \
    squat.yaml

# run STATUS ARGUMENT...
run()
{
    local expected=$1
    shift
    timeout -k 5 60 "$program" test "$@" >"$work/out" 2>&1 </dev/null
    [ $? -eq "$expected" ]
}

says() { grep -q -e "$1" "$work/out"; }

echo 1..17

run 0 --plan sweep.yaml --output a.plan && says '^6 cases$' &&
    run 0 --plan sweep.yaml --output b.plan && cmp -s a.plan b.plan && [ "$(wc -l <a.plan)" -eq 7 ]
result $? "a sweep gives the same plan again"

sed 's/^seed: 1/seed: 2/' sweep.yaml >other.yaml
run 0 --plan other.yaml --output other.plan && ! cmp -s a.plan other.plan
result $? "another seed gives another plan"

for k in 1 2 3 4 5 6; do run 0 --case $k a.plan || echo "case $k" >>failures; done
run 0 --case 3 a.plan && says '^case 3 passed$' && [ ! -e failures ]
result $? "every case runs, and one that has run is not run again"

for k in 6 2 4 1 3; do run 0 --case $k b.plan; done
run 2 --merge b.plan && says 'b.plan: found no result of 1 of 6 cases, the first is case 5'
result $? "a gap is refused"

echo '{}' >b.plan.results/5.json
run 2 --case 5 b.plan && says '5.json: found no result.*: remove the file to run the case again' &&
    rm b.plan.results/5.json
result $? "a damaged result is not taken for one, and is told to be removed"

run 0 --case 5 b.plan && run 0 --merge b.plan && run 0 --merge a.plan &&
    says '^6 cases: 6 passed, 0 did not$' && cmp -s a.plan.xml b.plan.xml &&
    cmp -s a.plan.csv b.plan.csv && cmp -s <(sed 's/a\.plan/b.plan/' a.plan.html) b.plan.html &&
    [ "$(wc -l <a.plan.csv)" -eq 7 ] && ! grep -q 'src=\|href=' a.plan.html &&
    [ "$(python3 "$HIL_SOURCE_DIR/tests/service/junit.py" a.plan.xml)" = "6 0 0" ]
result $? "the merged files do not depend on the order of the cases"

cp a.plan.results/2.json a.plan.results/two.json
run 2 --merge a.plan && says 'two.json: found case 2 a second time'
result $? "a case that is there twice is refused"
rm a.plan.results/two.json

run 0 --case 1 other.plan && cp other.plan.results/1.json b.plan.results &&
    run 2 --merge b.plan && says '1.json: found a result of plan' &&
    run 2 --case 1 b.plan && says '1.json: found case 1 of plan.*: remove b.plan.results or give'
result $? "a result of another plan is refused"

cp other.plan kept.plan
run 2 --plan sweep.yaml --output other.plan && cmp -s other.plan kept.plan &&
    says 'other.plan.results: found results of plan.*: remove the folder or give the plan' &&
    run 0 --plan other.yaml --output other.plan && cmp -s other.plan kept.plan
result $? "a plan is not written beside results of another one, and again beside its own"

cp a.plan range.plan
run 0 --case 2 range.plan && run 0 --case 1-6 --jobs 2 range.plan &&
    [ "$(cut -d' ' -f1,2 out | tr '\n' ' ')" = "case 1 case 2 case 3 case 4 case 5 case 6 " ] &&
    diff -r a.plan.results range.plan.results
result $? "a range gives the bytes that each case gives alone, and tells of them in order"

rm range.plan.results/[135].json
sed -i 's/"plan": "[0-9a-f]*"/"plan": "0000000000000000"/' range.plan.results/4.json
run 2 --case 3-5 range.plan && says '^case 3 passed$' && says '4.json: found case 4 of plan 0' &&
    says '^case 5 passed$' && [ -e range.plan.results/5.json ] && [ ! -e range.plan.results/1.json ]
result $? "a case of a range that has no result leaves the others theirs"

run 2 --case 3-2 a.plan && says 'case: found "3-2"' && run 2 --case 0-2 a.plan &&
    run 2 --case 2- a.plan && run 2 --case 1,2 a.plan && run 2 --case 1-7 a.plan &&
    says 'found case 7, expected 1 to 6' && run 2 --case 1-2 --output d a.plan &&
    says 'found --output with cases 1-2' && run 2 --case 1-100001 a.plan &&
    run 2 --merge --jobs 2 a.plan
result $? "a range that is none is refused"

sed -i 's/"binary": "[0-9a-f]*"/"binary": "00"/' a.plan.results/6.json
run 2 --merge a.plan && says '6.json: found a result of program 00' && run 2 --case 6 a.plan &&
    says 'found a result of program 00'
result $? "results of two programs are refused"

rm -r a.plan.results
sed -i 's/^duration_s: .*/duration_s: 0.06/' squat.yaml
run 2 --case 4 a.plan && says 'has changed since the plan was made' &&
    [ -z "$(ls a.plan.results)" ]
result $? "a scenario that has changed since is refused, and no result is written"

sed -i 's/Waist: /Waits: /' squat.yaml
run 2 --plan sweep.yaml --output c.plan && says 'squat.yaml:14:27: found unknown body "Waits"' &&
    sed -i 's/Waits: /Waist: /' squat.yaml && sed 's/-1.5, 12/-1.81, 12/' sweep.yaml >light.yaml &&
    run 2 --plan light.yaml --output c.plan &&
    says 'light.yaml:[0-9]*:[0-9]*: with mass_kg = -1.81.*squat.yaml:14:.*more than -1.80087 kg' &&
    sed 's/mass_kg/mass/' sweep.yaml >wrong.yaml && run 2 --plan wrong.yaml --output c.plan &&
    says 'squat.yaml: found unknown parameter "mass"' && run 2 --plan sweep.yaml &&
    run 2 --plan --merge a.plan && run 2 --case 7 b.plan && says 'found case 7, expected 1 to 6' &&
    run 2 --case 1 sweep.yaml && says 'sweep.yaml:1: found no head' && [ ! -e c.plan ]
result $? "what cannot be is refused where it stands"

# within FILE:LINE, the sweep's own, before what is said of the scenario
sed 's/^scenarios: .*/scenarios: [squat.yaml, nothing.yaml]/' sweep.yaml >missing.yaml
sed '/^parameters:/,$d' sweep.yaml >plain.yaml
sed 's/^hold/hoold/; s/^clock/clook/; s/^duration_s/duration/' squat.yaml >broken.yaml
sed -i 's/^scenarios: .*/scenarios: [broken.yaml]/' plain.yaml
at=$(grep -n '^scenarios' sweep.yaml | cut -d: -f1)
run 2 --plan missing.yaml --output c.plan &&
    says "missing.yaml:$at:[0-9]*: nothing.yaml: cannot be" &&
    run 2 --plan plain.yaml --output c.plan &&
    says "plain.yaml:[0-9]*:[0-9]*: broken.yaml:[0-9]*:[0-9]*: " && [ ! -e c.plan ]
result $? "an error in a scenario names the line of the sweep that brings it in"

sed 's/delay_s: .*/delay_s: {grid: [0.001, 2000]}/' sweep.yaml >late.yaml
sed 's/delay_s: .*/delay_s: {uniform: [0.001, 2000]}/' sweep.yaml >drawn.yaml
run 2 --plan late.yaml --output c.plan &&
    says 'late.yaml:[0-9]*:[0-9]*: with .*delay_s = 2000: squat.yaml:19:5: ' &&
    says 'found "2000", expected delay=1e-06 to 1 s' && run 2 --plan drawn.yaml --output c.plan &&
    says "drawn.yaml:[0-9]*:[0-9]*: with .*delay_s = [0-9.]*: squat.yaml:19:5: " && [ ! -e c.plan ]
result $? "a delay of half an hour is refused before anything runs"
exit $failed
