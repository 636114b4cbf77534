#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# usage: summary.sh CTEST-VERBOSE-LOG CTEST-STATUS
# Counts the TAP lines of every test program in ctest's verbose log, shows what failed or was
# skipped, and closes with "N passed, N failed, N skipped". A program that dies, runs out of time or
# prints fewer results than its plan counts its missing results as failed. Exits 1 on a failure.
awk -v status="$2" '
function finish(number,    missing) {
    if (plan[number] > seen[number]) {
        missing = plan[number] - seen[number]
        failed += missing
        bad[number] = 1
        failures[++nfailures] = name[number] ": " missing " of its " plan[number] " tests gave no result"
    }
}
# "      Start  3: name"  and  "3: output" and " 3/12 Test  #3: name ....   Passed  0.01 sec"
/^ *Start +[0-9]+: / {
    number = $2; sub(/:.*/, "", number); name[number] = $3; order[++norder] = number; next
}
/^test [0-9]+$/ { next }
/^[0-9]+: / {
    number = $0; sub(/:.*/, "", number)
    line = $0; sub(/^[0-9]+: ?/, "", line)
    if (line ~ /^1\.\.[0-9]+/) {
        sub(/^1\.\./, "", line); plan[number] += line + 0
    } else if (line ~ /^(not )?ok / && line ~ /# *SKIP/) {
        skipped++; seen[number]++; reasons[++nreasons] = name[number] ": " line
    } else if (line ~ /^ok /) {
        passed++; seen[number]++
    } else if (line ~ /^not ok /) {
        failed++; seen[number]++; bad[number] = 1
        failures[++nfailures] = name[number] ": " line
    } else if (line ~ /^SKIP:/) {
        reasons[++nreasons] = name[number] ": " line
    }
    text[number] = text[number] line "\n"
    next
}
/Test +#[0-9]+: / {
    number = $0; sub(/^.*Test +#/, "", number); sub(/:.*/, "", number)
    finish(number)
    if ($0 !~ /Passed/ && !bad[number]) {
        bad[number] = 1; failed++
        line = $0; sub(/^.*Test +#[0-9]+: /, "", line)
        failures[++nfailures] = line
    }
    if ($0 ~ /Passed/ && !seen[number] && !plan[number]) { passed++ }
    seconds = $(NF - 1)
    printf "%-40s %7.1f s%s\n", name[number], seconds, bad[number] ? "  FAILED" : ""
}
END {
    for (i = 1; i <= norder; i++) {
        if (bad[order[i]]) {
            printf "\n--- output of %s\n", name[order[i]]
            n = length(text[order[i]])
            print n > 12000 ? "[...]\n" substr(text[order[i]], n - 12000) : text[order[i]]
        }
    }
    if (nreasons) { print "\nskipped:" }
    for (i = 1; i <= nreasons; i++) { print "  " reasons[i] }
    if (nfailures) { print "\nfailed:" }
    for (i = 1; i <= nfailures; i++) { print "  " failures[i] }
    if (status + 0 != 0 && failed == 0) { failed = 1; print "\nctest exited with " status }
    printf "\n%d passed, %d failed, %d skipped\n", passed, failed, skipped
    exit failed > 0
}' "$1"
