#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Allocations and system calls of a start-up fail, one at a time; what the program does is judged.

usage: fail_nth.py PROGRAM PRELOAD [--full] [--only PART-OF-NAME] [--kind allocation|syscall]
       [--sanitized]

--sanitized: the program has a sanitizer, which allocates and maps memory for itself and gives up
without: no allocation fails then (tests/unit/app/fail_memory.c does that), and no mmap.

For every case (a command line of coman-hil) one process is loaded with PRELOAD (fail_nth.c), which
runs main in a fork for each call that is to fail. Promised for each of them:

- it ends within 90 s, not by a signal, with status 0, 3 (the system refused a call, memory ran out)
  or what else the case allows, and leaves no process behind;
- status 0 only when everything that it says and writes is the same as undisturbed (the failed call
  was in something optional);
- otherwise a message on standard error, which speaks of memory when that ran out, no success on
  standard output, and no file but those that are whole, as the undisturbed program leaves them.

Places are stacks of calls that allocate. Allocations: one for each of the last places of a case,
which are those of the command itself, and for some before, most of which read YAML like any other;
in turns just that one, or all from there on. System calls: some of each kind with one error each.
Which ones depends on the case's name, so that cases complement each other. With --full (or
HIL_FAIL_NTH=full in the environment): every allocation, all from each place on too, and every call
with each error. Prints TAP.
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zlib

SOURCE = os.environ.get("HIL_SOURCE_DIR", os.path.join(os.path.dirname(__file__), "../.."))
RIGS = os.path.join(SOURCE, "config/rigs")
FIRST_PLACES, LAST_PLACES = 6, 18

# What may go wrong with a call: errnos of Linux on every architecture, or a shorter transfer.
SHORTER = -1
EPERM, EINTR, EIO, EAGAIN, ENOMEM, EACCES, EINVAL, EMFILE, ENOSPC = 1, 4, 5, 11, 12, 13, 22, 24, 28
EADDRINUSE, ENOBUFS = 98, 105
ERRNO_NAMES = {
    SHORTER: "shorter", EPERM: "EPERM", EINTR: "EINTR", EIO: "EIO", EAGAIN: "EAGAIN",
    ENOMEM: "ENOMEM", EACCES: "EACCES", EINVAL: "EINVAL", EMFILE: "EMFILE", ENOSPC: "ENOSPC",
    EADDRINUSE: "EADDRINUSE", ENOBUFS: "ENOBUFS"}

# x86-64 numbers. What is not here cannot fail (getpid), is the C library's own affair (futex) or
# gives no errno (brk).
CALLS = {
    0: ("read", [EIO, EINTR, SHORTER]),
    1: ("write", [ENOSPC, EIO, EINTR, SHORTER]),
    3: ("close", [EIO, EINTR]),
    5: ("fstat", [ENOMEM, EIO]),
    7: ("poll", [ENOMEM, EINTR]),
    8: ("lseek", [EINVAL]),
    9: ("mmap", [ENOMEM]),
    10: ("mprotect", [ENOMEM]),
    11: ("munmap", [ENOMEM]),
    13: ("rt_sigaction", [EINVAL]),
    16: ("ioctl", [EIO, EINTR]),
    17: ("pread64", [EIO, EINTR, SHORTER]),
    20: ("writev", [EIO, EINTR]),
    21: ("access", [ENOMEM, EACCES]),
    22: ("pipe", [EMFILE]),
    28: ("madvise", [ENOMEM]),
    41: ("socket", [EMFILE, ENOMEM, EACCES]),
    42: ("connect", [EACCES, EINTR]),
    44: ("sendto", [ENOBUFS, EINTR, EAGAIN]),
    49: ("bind", [EADDRINUSE, EACCES]),
    50: ("listen", [EADDRINUSE]),
    51: ("getsockname", [ENOBUFS]),
    53: ("socketpair", [EMFILE]),
    54: ("setsockopt", [ENOMEM]),
    56: ("clone", [EAGAIN, ENOMEM]),
    57: ("fork", [EAGAIN, ENOMEM]),
    58: ("vfork", [EAGAIN]),
    59: ("execve", [ENOMEM, EACCES]),
    61: ("wait4", [EINTR]),
    72: ("fcntl", [EIO, EINTR]),
    77: ("ftruncate", [ENOSPC, EINTR]),
    79: ("getcwd", [ENOMEM]),
    82: ("rename", [ENOSPC, EACCES]),
    83: ("mkdir", [ENOSPC, EACCES]),
    84: ("rmdir", [EIO]),
    87: ("unlink", [EIO]),
    89: ("readlink", [EACCES]),
    91: ("fchmod", [EPERM]),
    98: ("getrusage", [EINVAL]),
    99: ("sysinfo", [EINVAL]),
    144: ("sched_setscheduler", [EPERM, EINVAL]),
    149: ("mlock", [ENOMEM, EPERM]),
    151: ("mlockall", [ENOMEM, EPERM]),
    157: ("prctl", [EINVAL]),
    203: ("sched_setaffinity", [EINVAL]),
    204: ("sched_getaffinity", [EINVAL]),
    217: ("getdents64", [EIO]),
    230: ("clock_nanosleep", [EINTR]),
    257: ("openat", [EMFILE, EACCES, ENOMEM, EINTR]),
    262: ("newfstatat", [ENOMEM, EIO]),
    273: ("set_robust_list", [EINVAL]),
    283: ("timerfd_create", [EMFILE]),
    290: ("eventfd2", [EMFILE, ENOMEM]),
    293: ("pipe2", [EMFILE]),
    302: ("prlimit64", [EPERM]),
    318: ("getrandom", [EINTR]),
    435: ("clone3", [EAGAIN, ENOMEM]),
}

MAPPING = (9, 10, 11, 28)


class Case:
    """A command line, run in ROOT/work.

    keep: which lines of standard output are the same each time; None = all
    status: what it may end with beside 0 and 3
    """

    def __init__(self, name, arguments, keep=None, status=(), program="coman-hil"):
        self.name, self.arguments, self.keep, self.status = name, arguments, keep, status
        self.program = program


def rig(name):
    return os.path.join(RIGS, name + ".yaml")


COMAN = os.path.join(SOURCE, "config/robots/coman.yaml")
RUN = r"ran its length|ticks,.* virtual|state hash|^  \w+ +can\d|boards:"

def run(name, *arguments, clock="free"):
    return ["run", rig(name), "--transport", "local", "--clock", clock] + list(arguments)


CASES = [
    Case("run coman", run("coman", "--ticks", "20", "--task", "squat", "--record", "rec"), RUN),
    Case("run served", run("hyq-leg", "--ticks", "5", "--gateway", "0"), RUN),
    Case("run controlled", run("hyq-leg", "--ticks", "5", "--control", "ctl.sock"), RUN),
    Case("run in real time", run("hyq-leg", "--ticks", "3", "--task", "hold", clock="real"),
         r"ran its length"),
    Case("run grasp", run("grasp", "--ticks", "5", "--task", "grasp", "--settle"), RUN),
    Case("run coman-fd", run("coman-fd", "--ticks", "5", "--energy"), RUN),
    Case("run coman-foc on the wire", run("coman-foc", "--ticks", "5", "--wire", "wire"), RUN),
    Case("check coman", ["check", rig("coman")]),
    Case("dbc", ["dbc", rig("coman"), "-o", "."]),
    Case("dbc of one bus", ["dbc", rig("coman"), "--bus", "torso"]),
    Case("eds", ["eds", rig("coman-cia402"), "-o", "."]),
    Case("plot", ["plot", "../signals.csv", "--signal", "a_rad", "--output", "plot.svg"]),
    Case("doctor", ["doctor", rig("coman"), "--measure", "0", "--local"], r"$^", status=(1,)),
    Case("generate", ["generate", COMAN]),
    Case("test", ["test", os.path.join(SOURCE, "config/scenarios/wrong_length.yaml"), "--jobs", "1",
                  "--junit", "j.xml"], r"$^", status=(1,)),
    Case("test --merge", ["test", "--merge", "../one.xml", "--junit", "j.xml"], r"$^"),
    Case("bench ticks", ["ticks", rig("hyq-leg"), "--seconds", "0.1"], r"$^",
         program="coman-hil-bench"),
    Case("ctl subscribe", ["ctl", "--socket", "none", "subscribe", "x", "--udp", "127.0.0.1:9"],
         r"$^", status=(1,)),
    Case("accel", ["accel", COMAN, "--list"]),
    Case("version", ["version"]),
]

JUNIT = """<?xml version="1.0" encoding="UTF-8"?>
<testsuites tests="1" failures="0" errors="0" time="0.100">
  <testsuite name="one" tests="1" failures="0" errors="0" time="0.100">
    <testcase classname="scenarios.one" name="one" time="0.100">
      <properties>
        <property name="file" value="one.yaml"/>
      </properties>
    </testcase>
  </testsuite>
</testsuites>
"""


def put(path, text, mode=0o600):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "w", encoding="ascii") as file:
        file.write(text)
    os.chmod(path, mode)


def prepare(root):
    """What the cases read."""
    rows = ("%g,%g\n" % (0.01 * i, i * i) for i in range(100))
    put(root + "/signals.csv", "time_s,a_rad\n" + "".join(rows))
    put(root + "/one.xml", JUNIT)


def text_of(path):
    with open(path, "rb") as file:
        return file.read().decode(errors="replace")


class Outcome:
    """What one run said and left."""

    def __init__(self, answer, root, case):
        word = answer.split(" ")
        self.kind, self.status = word[0], int(word[1])
        self.seen, self.left, self.where = int(word[3]), int(word[5]), [w for w in word[6:] if w]
        self.out, self.err = text_of(root + "/out"), text_of(root + "/err")
        self.said = self.out if case.keep is None else "\n".join(
            re.sub(r" in [0-9.]+ s, real-time factor [0-9.]+", "", line)
            for line in self.out.splitlines() if re.search(case.keep, line))
        self.files = {}
        for base in ("work", "tmp"):
            for folder, folders, names in os.walk(os.path.join(root, base)):
                for name in names:
                    path = os.path.join(folder, name)
                    timed = name in ("summary.json", "j.xml") or not os.path.isfile(path)
                    self.files[os.path.relpath(path, root)] = \
                        0 if timed else zlib.crc32(text_of(path).encode())
                for name in folders:
                    self.files[os.path.relpath(os.path.join(folder, name), root) + "/"] = 0


class Server:
    """The program, loaded once, to be run again and again."""

    def __init__(self, program, preload, case):
        self.case, self.root = case, tempfile.mkdtemp(prefix="fail-nth-")
        prepare(self.root)
        environment = {
            "LD_PRELOAD": preload, "FAIL_NTH_ROOT": self.root,
            "PATH": self.root + "/bin:" + os.environ["PATH"], "TMPDIR": self.root + "/tmp",
            "XDG_CACHE_HOME": self.root + "/tmp", "HOME": self.root + "/tmp",
            "ASAN_OPTIONS": "verify_asan_link_order=0:detect_leaks=0:allocator_may_return_null=1"}
        self.clean()
        self.process = subprocess.Popen([program] + case.arguments, stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, env=environment, text=True)
        self.runs = 0

    def clean(self):
        for name in ("work", "tmp"):
            shutil.rmtree(os.path.join(self.root, name), ignore_errors=True)
            os.mkdir(os.path.join(self.root, name), 0o700)

    def run(self, request):
        self.clean()
        self.process.stdin.write(request + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline().rstrip("\n")
        if answer == "unsupported":
            return None
        if not answer:
            raise SystemExit("Bail out! the server of %s ended" % self.case.name)
        self.runs += 1
        return Outcome(answer, self.root, self.case)

    def close(self):
        self.process.stdin.close()
        self.process.wait()
        shutil.rmtree(self.root, ignore_errors=True)


def judge(case, calm, outcome, what):
    """What is wrong with an outcome, as a list of sentences."""
    wrong = []
    if outcome.kind == "signal":
        return ["hangs" if outcome.status == 14 else "killed by signal %d" % outcome.status]
    if outcome.left:
        wrong.append("leaves %d processes" % outcome.left)
    if outcome.status == calm.status:
        if outcome.said != calm.said:
            wrong.append("status %d, but it says something else" % outcome.status)
        # a file that could not be looked at or removed stays, and so does the folder that it is in
        about = outcome.where[-1] if outcome.where else ""
        stay = [os.path.basename(about), os.path.basename(os.path.dirname(about))]
        differ = sorted((name, content)
                        for name, content in set(outcome.files.items()) ^ set(calm.files.items())
                        if not about or os.path.basename(name.rstrip("/")) not in stay)
        if differ:
            wrong.append("status %d, but it leaves other files: %s" % (outcome.status, differ))
        return wrong
    if outcome.status not in (3,) + case.status + ((2,) if what == EACCES else ()):
        wrong.append("status %d" % outcome.status)
    message = [line for line in outcome.err.splitlines() if line.startswith("coman-hil")]
    if outcome.status in case.status:
        message += outcome.out.splitlines()
    # glibc makes EAGAIN of what a thread lacks, and has words of its own for what a library does
    if not message:
        wrong.append("status %d without a message" % outcome.status)
    elif what == ENOMEM and not re.search("[Mm]emory|thread|shared object", "\n".join(message)):
        wrong.append("does not speak of memory")
    if "ERROR: AddressSanitizer" in outcome.err or "runtime error" in outcome.err:
        wrong.append("a sanitizer's finding")
    finished = "state hash" in outcome.out or "standard output could not be written" in outcome.err
    extra = sorted(name for name, content in outcome.files.items()
                   if name not in calm.files or (content != calm.files[name] and not finished) or
                   (name.endswith("/") and not finished))
    if extra:
        wrong.append("leaves %s" % ", ".join(extra))
    if calm.said and outcome.said == calm.said and not finished:
        wrong.append("status %d, but it reports success" % outcome.status)
    return wrong


def symbols(where, limit=9):
    """MODULE+OFFSET as function names, as far as addr2line knows them."""
    names = []
    for place in where:
        module, _, offset = place.partition("+0x")
        if "libfail_nth" in module or "libfn" in module:
            continue
        if not offset or "/libc" in module:
            continue
        found = subprocess.run(["addr2line", "-fse", module, hex(int(offset, 16) - 1)],
                               capture_output=True, text=True, check=False).stdout.split("\n")
        names.append(found[0] + (" " + found[1] if len(found) > 1 and "?" not in found[1] else ""))
    return "; ".join(names[:limit])


class Report:
    def __init__(self):
        self.number, self.failed, self.findings = 0, 0, 0

    def result(self, good, name):
        self.number += 1
        self.failed += not good
        print("%s %d - %s" % ("ok" if good else "not ok", self.number, name), flush=True)

    def finding(self, what, wrong, outcome, detail):
        self.findings += 1
        if self.findings <= 400:
            print("# %s: %s" % (what, "; ".join(wrong)))
            print("#   at %s" % detail)
            for line in (outcome.err.splitlines() or ["(nothing on standard error)"])[-3:]:
                print("#   | %s" % line[:300])
            sys.stdout.flush()


def salt_of(case):
    return zlib.crc32(case.name.encode())


def chosen_allocations(places, salt):
    """(n, span) of the allocations that fail."""
    first, last = places[:-LAST_PLACES], places[-LAST_PLACES:]
    step = max(1, len(first) // FIRST_PLACES)
    for i, n in enumerate(first[salt % step::step] + last):
        yield n, (i + salt) % 2


def all_allocations(places, count):
    for n in range(1, count + 1):
        yield n, 1
    for n in places:
        yield n, 0


def fail_allocations(server, report, full):
    case = server.case
    calm = server.run("a 0 0")
    places = sorted(int(n) for n in calm.where)
    chosen = list(all_allocations(places, calm.seen) if full else
                  chosen_allocations(places, salt_of(case)))
    found = 0
    for n, span in chosen:
        outcome = server.run("a %d %d" % (n, span))
        wrong = judge(case, calm, outcome, ENOMEM)
        if wrong:
            found += 1
            extent = "" if span else " and all that follow"
            report.finding("%s, allocation %d%s" % (case.name, n, extent), wrong, outcome,
                           symbols(outcome.where))
    report.result(not found, "%s: %d allocations fail in turn, of %d from %d places"
                  % (case.name, len(chosen), calm.seen, len(places)))


def chosen_calls(count, salt):
    """Up to three of the calls of a kind: the first, the last, one between."""
    return sorted({1, count, 1 + salt % count})


def fail_calls(server, report, full):
    case, start = server.case, server.runs
    calm = server.run("s -1 0 0 0")
    if calm is None:
        print("# SKIP: system calls are intercepted on x86-64 only")
        return
    kinds = sorted((int(n), int(count)) for n, count in (word.split(":") for word in calm.where))
    found, unknown = 0, []
    for number, count in kinds:
        if number not in CALLS or (number in MAPPING and "--sanitized" in sys.argv):
            unknown.append(number)
            continue
        name, errnos = CALLS[number]
        for n in range(1, count + 1) if full else chosen_calls(count, salt_of(case) + number):
            for what in errnos if full else [errnos[(n + number) % len(errnos)]]:
                outcome = server.run("s %d %d 1 %d" % (number, n, what))
                wrong = judge(case, calm, outcome, what)
                if wrong:
                    found += 1
                    report.finding("%s, %s %d (%d) %s" % (case.name, name, n, number,
                                                          ERRNO_NAMES[what]),
                                   wrong, outcome, " ".join(outcome.where))
    report.result(not found, "%s: system calls of %d kinds fail, %d runs"
                  % (case.name, len(kinds) - len(unknown), server.runs - start))


def main():
    arguments = sys.argv[1:]
    full = "--full" in arguments or os.environ.get("HIL_FAIL_NTH") == "full"
    only = arguments[arguments.index("--only") + 1] if "--only" in arguments else ""
    kind = arguments[arguments.index("--kind") + 1] if "--kind" in arguments else ""
    report = Report()
    # a copy elsewhere does not find the peers of the benchmarks: ODE dies of a failed allocation
    folder = tempfile.TemporaryDirectory(prefix="fail-nth-program-")
    for program in arguments[0], arguments[0] + "-bench":
        shutil.copy2(program, folder.name)
    for case in CASES:
        if only not in case.name:
            continue
        server = Server(os.path.join(folder.name, case.program), os.path.abspath(arguments[1]),
                        case)
        if kind != "syscall" and "--sanitized" not in sys.argv:
            fail_allocations(server, report, full)
        if kind != "allocation":
            fail_calls(server, report, full)
        server.close()
    print("1..%d" % report.number)
    return 1 if report.failed else 0


sys.exit(main())
