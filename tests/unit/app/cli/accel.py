#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""usage: accel.py COMAN-HIL. Text in, text out: what accel answers, and what it refuses with its
place. Prints TAP."""
import hashlib
import os
import random
import subprocess
import sys

NUMBERS = 30 + 29 + 23  # q, v and tau of COMAN
COMMAND = [sys.argv[1], "accel", os.environ["HIL_SOURCE_DIR"] + "/config/robots/coman.yaml"]


def run(text, *options):
    done = subprocess.run([*COMMAND, *options], input=text, capture_output=True, timeout=60)
    return done.returncode, done.stdout.decode(), done.stderr.decode()


def line_with(start=NUMBERS, count=0, other=""):
    """A line of zeros with an upright base; other stands for the count numbers from start on."""
    words = ["1" if i == 3 else "0" for i in range(NUMBERS)]
    words[start:start + count] = [other] if other else []
    return " ".join(words).encode()


def refused(text, message):
    status, _, said = run(text)
    assert status == 2 and message in said and len(said) < 400, (message, said)


def the_answer_is_that_of_the_numeric_dynamics_to_the_last_bit():
    draw = random.Random(21)
    numbers = [f"{draw.randint(-1000, 1000) / 1024:.17g}" for _ in range(NUMBERS)]
    numbers[3:7] = "0.5", "-0.5", "0.5", "0.5"  # exactly a unit quaternion
    text = "# a comment\n\n   \t\n  # another\n" + "\t  ".join(numbers)  # no newline at the end
    status, out, said = run(text.encode())
    assert (status, said, len(out.split())) == (0, "", 29), said
    assert all(f"{float(word):.17g}" == word for word in out.split())
    found = hashlib.sha256(out.encode()).hexdigest()[:16]
    assert found == "1ddd0fb81ea7e5b8", found


def each_line_is_answered_before_the_next_one_is_written():
    with subprocess.Popen(COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        for _ in range(3):
            child.stdin.write(line_with() + b"\n")
            child.stdin.flush()
            assert b" -9.8" in child.stdout.readline()
        child.stdin.close()
        assert child.stdout.read() == b"" and child.wait(10) == 0


def nothing_is_said_about_nothing():
    for text in b"", b"\n\n#", b" " * (3 << 20):
        assert run(text) == (0, "", "")


def the_numbers_of_a_line_are_listed():
    status, out, _ = run(b"", "--list")
    names = out.splitlines()
    assert status == 0 and len(names) == NUMBERS
    assert names[0] == "base position x (m)" and names[6] == "base quaternion z (1)"
    assert names[7] == "RHipSag position (rad)" and names[29] == "LElbj position (rad)"
    assert names[30] == "base linear velocity x (m/s)" and names[36] == "RHipSag rate (rad/s)"
    assert names[59] == "RHipSag torque (N m)"


def lines_of_another_length_are_refused():
    refused(b"1 2 3\n", "stdin:1:6: found the end of the line after 3 numbers, expected 82, next "
                        "base quaternion w (1)")
    refused(b"# c\n1", "stdin:2:2: found the end of the line after 1 number, expected 82")
    refused(line_with() + b" 0",
            ": found one more number, expected the end of the line after 82")
    refused(b"1 " * (1 << 20), "stdin:1:165: found one more number")


def what_is_no_finite_number_is_refused():
    for word in "nan", "inf", "-inf", "1e999", "0x10", "1,5", "--1", "#", "1e":
        refused(line_with(7, 1, word),
                f'stdin:1:15: found "{word}", expected a finite number: RHipSag position (rad)')
    refused(b"7" * (3 << 20), 'stdin:1:1: found "7777')
    refused(b"\0" * 100, 'found "????')
    refused(line_with(40, 1, "1e200"), "stdin:1:1: found numbers so large")


def a_quaternion_has_nearly_unit_length():
    refused(line_with(3, 4, "1.002 0 0 0"),
            "stdin:1:7: found a quaternion of length 1.002, expected 1 within 0.001")
    refused(line_with(3, 4, "0 0 0 0"), "found a quaternion of length 0")
    exact, near = ([float(word) for word in run(line_with(3, 4, text))[1].split()]
                   for text in ("0.6 0 0.8 0", "0.6003 0 0.8004 0"))
    assert len(exact) == 29 and all(abs(a - b) < 1e-9 for a, b in zip(exact, near))


TESTS = (the_answer_is_that_of_the_numeric_dynamics_to_the_last_bit,
         each_line_is_answered_before_the_next_one_is_written, nothing_is_said_about_nothing,
         the_numbers_of_a_line_are_listed, lines_of_another_length_are_refused,
         what_is_no_finite_number_is_refused, a_quaternion_has_nearly_unit_length)
print(f"1..{len(TESTS)}")
for number, test in enumerate(TESTS, 1):
    try:
        test()
        print(f"ok {number} - {test.__name__}")
    except AssertionError as reason:
        print(f"not ok {number} - {test.__name__}\n# {reason}")
