#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Instructions of one evaluation of COMAN's generated forward dynamics, by callgrind: a figure that
# does not depend on how busy the machine is. The budget holds for the AVX2 variant, which is the
# best that valgrind can run; elsewhere the figure is printed only.
program=$1
budget=8000
echo 1..3
if ! command -v valgrind >/dev/null; then
    for n in 1 2 3; do echo "ok $n # SKIP no valgrind"; done
    exit 0
fi

# instructions of the whole program with $2 evaluations of $1
total() {
    valgrind --tool=callgrind --callgrind-out-file=/dev/null "$program" "$1" "$2" 2>&1 >/dev/null |
        sed -n 's/.*Collected : \([0-9]*\).*/\1/p'
}

# of one evaluation: the difference of two runs leaves the rest of the program out
each() {
    one=$(total "$1" 1)
    many=$(total "$1" 101)
    echo $(((many - one) / 100))
}

variant=$(valgrind -q --tool=none "$program" forward 1)
plain=$(each forward)
wrenches=$(each wrenches)
implicit=$(each implicit)
echo "# $variant: forward $plain, with wrenches $wrenches, implicit $implicit instructions"
status=0

# check NUMBER WHAT CONDITION
check() {
    if [ "$variant" != avx2 ]; then
        echo "ok $1 - $2 # SKIP the budget is for avx2"
    elif [ "$3" -eq 1 ]; then
        echo "ok $1 - $2"
    else
        echo "not ok $1 - $2"
        status=1
    fi
}

check 1 "forward within $budget instructions" $((plain > 0 && plain <= budget))
check 2 "forward with wrenches within $budget instructions" $((wrenches > 0 && wrenches <= budget))
# twelve bodies of COMAN may touch something, and each brings a matrix of its own
check 3 "implicit within 1.4 times forward" $((implicit * 100 <= plain * 140))
exit $status
