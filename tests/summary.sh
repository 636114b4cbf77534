#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# ctest --verbose | summary.sh [ALLOWED]
# Counts the TAP lines of every test program, shows which took longest and what failed or was
# skipped, and closes with "N passed, N failed, N skipped". A program that dies, runs out of time or
# prints fewer results than its plan counts its missing results as failed. With the file ALLOWED
# (tests/allowed_skips.txt) a skip that is not in it counts as failed. Exits 1 on a failure or when
# nothing ran.
exec awk -v allowed_file="${1:-}" '
# Reads ALLOWED: "PROGRAM: NAME  # REASON", where * stands for any text and # begins a remark
function read_allowed(    line) {
    while ((getline line <allowed_file) > 0) {
        sub(/ *#.*/, "", line)
        if (line == "") {
            continue
        }
        gsub(/[][().+?^$|{}\\]/, "\\\\&", line)
        gsub(/\*/, ".*", line)
        allowed[++nallowed] = "^" line "$"
    }
    if (!nallowed) {
        failures[++nfailures] = "no list of allowed skips in " allowed_file
        failed++
    }
}
# Counts one skipped test; NAME is that of the test in its program
function count_skip(number, test, reason,    what, i) {
    what = name[number] ": " test
    for (i = 1; i <= nallowed; i++) {
        if (what ~ allowed[i]) {
            break
        }
    }
    if (allowed_file != "" && i > nallowed) {
        failed++; bad[number] = 1
        failures[++nfailures] = what ": skipped, which tests/allowed_skips.txt does not allow" \
                                (reason == "" ? "" : ": " reason)
        return
    }
    skipped++
    reasons[++nreasons] = what (reason == "" ? "" : " # " reason)
}
BEGIN {
    if (allowed_file != "") {
        read_allowed()
    }
}
function finish(number,    missing) {
    if (plan[number] > seen[number]) {
        missing = plan[number] - seen[number]
        failed += missing
        bad[number] = 1
        failures[++nfailures] = sprintf("%s: %d of its %d tests gave no result",
                                        name[number], missing, plan[number])
    }
}
# "      Start  3: name"
/^ *Start +[0-9]+: / {
    number = $2; sub(/:.*/, "", number); name[number] = $3; order[++norder] = number
    next
}
# "3: a line that the test has printed"
/^[0-9]+: / {
    number = $0; sub(/:.*/, "", number)
    line = $0; sub(/^[0-9]+: ?/, "", line)
    text[number] = text[number] line "\n"
    if (line ~ /^1\.\.0+ *# *SKIP/) { # a program that skips itself
        sub(/^1\.\.0+ *# *SKIP */, "", line)
        seen[number]++; count_skip(number, "all", line)
    } else if (line ~ /^1\.\.[0-9]+/) {
        sub(/^1\.\./, "", line); plan[number] += line + 0
    } else if (line ~ /^(not )?ok [0-9]+.*# *SKIP/) { # "not ok" of cmocka
        reason = line; sub(/^.*# *SKIP */, "", reason)
        sub(/^(not )?ok [0-9]+ *-? */, "", line); sub(/ *# *SKIP.*$/, "", line)
        if (line == "") { # of cmocka: the name stands after the word
            line = reason; reason = said[number]
        }
        seen[number]++; count_skip(number, line, reason)
        said[number] = ""
    } else if (line ~ /^ok [0-9]/) {
        passed++; seen[number]++
    } else if (line ~ /^not ok [0-9]/) {
        failed++; seen[number]++; bad[number] = 1
        failures[++nfailures] = name[number] ": " line
    } else if (line ~ /^SKIP:/) { # why, on the line before
        said[number] = line; sub(/^SKIP: */, "", said[number])
    }
    next
}
# " 3/12 Test  #3: name .........   Passed    0.01 sec"
/^ *[0-9]+\/[0-9]+ Test +#[0-9]+: / {
    number = $0; sub(/^.*Test +#/, "", number); sub(/:.*/, "", number)
    finish(number)
    if ($0 !~ /   Passed / && !bad[number]) {
        bad[number] = 1; failed++
        line = $0; sub(/^.*Test +#[0-9]+: /, "", line)
        failures[++nfailures] = line
    }
    if ($0 ~ /   Passed / && !seen[number]) {
        passed++
    }
    printf "%-40s %7.1f s%s\n", name[number], $(NF - 1), bad[number] ? "  FAILED" : ""
    fflush()
    time[number] = $(NF - 1)
}
# The longest of a run that had more than them
function show_slowest(count,    i, number, longest, sum) {
    if (norder <= count) {
        return
    }
    for (number in time) {
        sum += time[number]
    }
    printf "\nthe %d slowest, of %.0f s in all:\n", count, sum
    for (i = 1; i <= count; i++) {
        longest = ""
        for (number in time) {
            if (longest == "" || time[number] > time[longest]) {
                longest = number
            }
        }
        if (longest == "") {
            return # the run was ended
        }
        printf "  %-38s %7.1f s\n", name[longest], time[longest]
        delete time[longest]
    }
}
END {
    show_slowest(10)
    for (i = 1; i <= norder; i++) {
        if (bad[order[i]]) {
            shown = text[order[i]]
            size = length(shown)
            if (size > 12000) {
                shown = "[...]\n" substr(shown, size - 12000)
            }
            printf "\n--- output of %s\n%s", name[order[i]], shown
        }
    }
    if (nreasons) {
        print "\nskipped:"
    }
    for (i = 1; i <= nreasons; i++) {
        print "  " reasons[i]
    }
    if (nfailures) {
        print "\nfailed:"
    }
    for (i = 1; i <= nfailures; i++) {
        print "  " failures[i]
    }
    printf "\n%d passed, %d failed, %d skipped\n", passed, failed, skipped
    exit failed > 0 || passed == 0
}'
