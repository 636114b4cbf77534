#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""What a state, a frame or a verdict depends on takes no elementary function from the C library.

Libraries differ in the last place of sine and exponential from version to version and from CPU to
CPU; base/portable_math.h does not. Reads with nm what the libraries named as arguments leave
undefined. Exact functions (sqrt, floor, round, ldexp, fmod, fmin, fmax) are allowed. Prints TAP.
"""
import os
import re
import subprocess
import sys

FORBIDDEN = re.compile(
    r"(a?(sin|cos|tan)h?|atan2|sincos|exp|exp2|exp10|expm1|log|log2|log10|log1p|pow|cbrt|hypot"
    r"|erfc?|[lt]gamma|fma)[fl]?")
# Simbody calls the C library as it likes and is a module of its own: rigs with its engine are not
# promised the same bits.
# Generated dynamics take portable_sincos; the library's only where they are linked without it.
EXEMPT = re.compile(r"\w+_dynamics\.c\.o")


def undefined(library):
    """Pairs (object file, symbol) that the library takes from elsewhere."""
    lines = subprocess.run(["nm", "-A", "-u", library], check=True, text=True,
                           capture_output=True).stdout.splitlines()
    for line in lines:
        place, _, symbol = line.rpartition(" U ")
        if symbol:
            yield place.strip().rstrip(":").split(":")[-1], symbol.split("@")[0]


def main():
    libraries = sys.argv[1:]
    print(f"1..{len(libraries)}")
    failed = False
    for number, library in enumerate(libraries, 1):
        found = {(place, symbol) for place, symbol in undefined(library)
                 if FORBIDDEN.fullmatch(symbol) and not EXEMPT.fullmatch(place)}
        name = os.path.basename(library)
        failed = failed or bool(found)
        print(f"{'not ok' if found else 'ok'} {number} - {name} has the same bits on every machine")
        for place, symbol in sorted(found):
            print(f"# {place} takes {symbol} from the C library: use portable_{symbol}")
    return failed


sys.exit(main())
