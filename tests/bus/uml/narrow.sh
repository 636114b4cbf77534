#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# What machines with a large XSAVE area do to user-mode Linux, on any machine: a guest whose
# buffer of floating-point registers is too small panics, and runs with the ptrace that run.sh
# preloads. Prints TAP.
# usage: narrow.sh NARROW_LIBRARY
here=$(cd "$(dirname "$0")" && pwd)
. "$here/../../service/tap.sh"
export HIL_UML_PRELOAD=$1
# what the narrowed guest loses at each of its page faults are AVX registers, so that its C
# library must not use them, as nothing in a guest uses AMX
without=-AVX2,-AVX_Fast_Unaligned_Load,-AVX512F,-AVX512VL
export HIL_UML_ENVIRONMENT=GLIBC_TUNABLES=glibc.cpu.hwcaps=$without
log=$(mktemp)
trap 'rm -f "$log"' EXIT
tap_show=$log

if [ "$("$HIL_BINARY_DIR/tests/xsave_area")" -le 576 ]; then
    printf '1..1\nok 1 - uml_narrow # SKIP the CPU has no vector registers beyond SSE\n'
    exit 0
fi
HIL_UML_XSAVE=never bash "$here/run.sh" -t 30 true >"$log" 2>&1
status=$?
if grep -q '# SKIP' "$log"; then
    cat "$log"
    exit 0
fi
echo 1..3
[ $status -eq 70 ] && grep -q 'Bail out!' "$log"
result $? "a guest whose buffer is too small does not start"
grep -qE 'put_fp_registers|ptrace set fp regs failed' "$log" # Linux 6.1; 6.12
result $? "it panics as on machines with AMX, where it puts floating-point registers back"
HIL_UML_XSAVE=always bash "$here/run.sh" -t 90 /bin/sh -c \
    'ip -br link show type vcan
    awk "BEGIN { for (n = 0; n < 100000; n++) s += sqrt(n); print s }"' \
    >"$log" 2>&1 && [ "$(grep -c '^can[0-4] ' "$log")" = 5 ] && grep -q '^2.10817e+07$' "$log"
result $? "with the preloaded ptrace it runs and calculates"
exit $failed
