#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Every allocation and every system call of a start-up fails once; what the program then does is judged.

usage: fail_nth.py PROGRAM PRELOAD [--full] [--only PART-OF-NAME] [--kind allocation|syscall] [CASE n WHAT ...]

For every case (a command line of coman-hil) one process is loaded with PRELOAD (fail_nth.c), which
runs main in a fork for each call that is to fail. Promised for each of them:

- it ends within 20 s, not by a signal, with status 0, 3 (the system refused a call, memory ran out)
  or what else the case allows, and leaves no process behind;
- status 0 only when everything that it says and writes is the same as undisturbed (the failed call
  was in something optional);
- otherwise a message on standard error, which speaks of memory when that ran out, no success on
  standard output, and no file but those that are whole, as the undisturbed program leaves them.

Allocations: one for each place (stack of calls) that allocates, once and from there on; with --full
(or HIL_FAIL_NTH=full in the environment) every single one. System calls: some of each kind with one
error each; with --full each with each error. Prints TAP.
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zlib

SOURCE = os.environ.get("HIL_SOURCE_DIR", os.path.join(os.path.dirname(os.path.abspath(__file__)), "../.."))
RIGS = os.path.join(SOURCE, "config/rigs")
SHORTER = -1

# What may go wrong with a call: errnos of Linux on every architecture, or a transfer that is shorter.
EINTR, EIO, EAGAIN, ENOMEM, EACCES, EINVAL, ENFILE, EMFILE, ENOSPC, EPERM = 4, 5, 11, 12, 13, 22, 23, 24, 28, 1
EADDRINUSE, ENOBUFS = 98, 105
ERRNO_NAMES = {EINTR: "EINTR", EIO: "EIO", EAGAIN: "EAGAIN", ENOMEM: "ENOMEM", EACCES: "EACCES",
               EINVAL: "EINVAL", ENFILE: "ENFILE", EMFILE: "EMFILE", ENOSPC: "ENOSPC", EPERM: "EPERM",
               EADDRINUSE: "EADDRINUSE", ENOBUFS: "ENOBUFS", SHORTER: "shorter"}

# x86-64 numbers; calls that are not here cannot fail or are not the program's concern (brk, futex, ...)
CALLS = {
    0: ("read", [EIO, EINTR, SHORTER]), 1: ("write", [ENOSPC, EIO, EINTR, SHORTER]),
    2: ("open", [EMFILE, EACCES, EINTR]), 3: ("close", [EIO, EINTR]), 4: ("stat", [ENOMEM, EACCES]),
    5: ("fstat", [ENOMEM, EIO]), 6: ("lstat", [ENOMEM]), 7: ("poll", [ENOMEM, EINTR]), 8: ("lseek", [EINVAL]),
    9: ("mmap", [ENOMEM]), 10: ("mprotect", [ENOMEM]), 11: ("munmap", [ENOMEM]),
    13: ("rt_sigaction", [EINVAL]), 16: ("ioctl", [EIO, EINTR]), 17: ("pread64", [EIO, EINTR, SHORTER]),
    20: ("writev", [EIO, EINTR]), 21: ("access", [ENOMEM, EACCES]), 22: ("pipe", [EMFILE]),
    28: ("madvise", [ENOMEM]), 32: ("dup", [EMFILE]), 33: ("dup2", [EMFILE]), 41: ("socket", [EMFILE, ENOMEM, EACCES]),
    42: ("connect", [EACCES, EINTR]), 44: ("sendto", [ENOBUFS, EINTR, EAGAIN]), 49: ("bind", [EADDRINUSE, EACCES]),
    50: ("listen", [EADDRINUSE]), 51: ("getsockname", [ENOBUFS]), 54: ("setsockopt", [ENOMEM]),
    53: ("socketpair", [EMFILE]), 56: ("clone", [EAGAIN, ENOMEM]), 57: ("fork", [EAGAIN, ENOMEM]),
    58: ("vfork", [EAGAIN]), 61: ("wait4", [EINTR]), 72: ("fcntl", [EIO, EINTR]), 76: ("truncate", [EIO]),
    77: ("ftruncate", [ENOSPC, EINTR]), 79: ("getcwd", [ENOMEM]), 82: ("rename", [ENOSPC, EACCES]),
    83: ("mkdir", [ENOSPC, EACCES]), 84: ("rmdir", [EIO]), 87: ("unlink", [EIO]), 89: ("readlink", [EACCES]),
    99: ("sysinfo", [EINVAL]), 98: ("getrusage", [EINVAL]), 107: ("geteuid", []), 144: ("sched_setscheduler", [EPERM, EINVAL]),
    149: ("mlock", [ENOMEM, EPERM]), 151: ("mlockall", [ENOMEM, EPERM]), 157: ("prctl", [EINVAL]),
    203: ("sched_setaffinity", [EINVAL]), 204: ("sched_getaffinity", [EINVAL]), 217: ("getdents64", [EIO]),
    230: ("clock_nanosleep", [EINTR]), 257: ("openat", [EMFILE, EACCES, ENOMEM, EINTR]), 258: ("mkdirat", [ENOSPC]),
    262: ("newfstatat", [ENOMEM, EIO]), 263: ("unlinkat", [EIO]), 264: ("renameat", [ENOSPC]),
    273: ("set_robust_list", [EINVAL]), 283: ("timerfd_create", [EMFILE]), 284: ("eventfd", [EMFILE]),
    288: ("accept4", [EMFILE, EINTR]), 290: ("eventfd2", [EMFILE, ENOMEM]), 291: ("epoll_create1", [EMFILE]),
    293: ("pipe2", [EMFILE]), 302: ("prlimit64", [EPERM]), 316: ("renameat2", [ENOSPC]), 318: ("getrandom", [EINTR]),
    332: ("statx", [ENOMEM, EACCES]), 435: ("clone3", [EAGAIN, ENOMEM]), 59: ("execve", [ENOMEM, EACCES]),
    247: ("waitid", [EINTR]),
}


class Case:
    """A command line; status: what it may end with beside 0 and 3; quiet: files that it may leave when it fails."""

    def __init__(self, name, arguments, keep=None, status=(), optional=False, prepare=None):
        self.name, self.arguments, self.keep, self.status = name, arguments, keep, status
        self.optional, self.prepare = optional, prepare


def rig(name):
    return os.path.join(RIGS, name + ".yaml")


RUN = r"ran its length|ticks,.* virtual|state hash|^  \w+ +can\d|boards:"
LOCAL = ["--clock", "free", "--transport", "local"]

CASES = [
    Case("run coman", ["run", rig("coman")] + LOCAL + ["--ticks", "20", "--task", "squat", "--record", "rec"], RUN),
    Case("run coman served", ["run", rig("coman")] + LOCAL + ["--ticks", "5", "--gateway", "0"], RUN),
    Case("run coman in real time", ["run", rig("coman"), "--transport", "local", "--clock", "real", "--ticks", "3"],
         r"state hash"),
    Case("run grasp", ["run", rig("grasp")] + LOCAL + ["--ticks", "5", "--task", "grasp", "--settle"], RUN),
    Case("run coman-fd", ["run", rig("coman-fd")] + LOCAL + ["--ticks", "5", "--energy"], RUN),
    Case("run coman-foc on the wire", ["run", rig("coman-foc")] + LOCAL + ["--ticks", "5", "--wire", "wire"], RUN),
    Case("check coman", ["check", rig("coman")]),
    Case("dbc", ["dbc", rig("coman"), "-o", "."]),
    Case("dbc of one bus", ["dbc", rig("coman"), "--bus", "torso"]),
    Case("plot", ["plot", "../signals.csv", "--signal", "a_rad", "--output", "plot.svg"]),
    Case("doctor", ["doctor", rig("coman"), "--measure", "0", "--local"], r"$^", status=(1,)),
    Case("generate", ["generate", os.path.join(SOURCE, "config/robots/coman.yaml")]),
    Case("test", ["test", os.path.join(SOURCE, "config/scenarios/wrong_length.yaml"), "--jobs", "1", "--junit", "j.xml"],
         r"$^", status=(1,)),
    Case("bench pendulum", ["bench", "pendulum", "--quick"], r"$^"),
    Case("accel", ["accel", os.path.join(SOURCE, "config/robots/coman.yaml"), "--list"]),
    Case("version", ["version"]),
]


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
                    self.files[os.path.relpath(path, root)] = zlib.crc32(text_of(path).encode()) if \
                        name not in ("summary.json", "j.xml") and os.path.isfile(path) else 0
                for name in folders:
                    if name != "coman-hil":  # the cache folder, which is kept on purpose
                        self.files[os.path.relpath(os.path.join(folder, name), root) + "/"] = 0


class Server:
    """The program, loaded once, to be run again and again."""

    def __init__(self, program, preload, case):
        self.case, self.root = case, tempfile.mkdtemp(prefix="fail-nth-")
        with open(self.root + "/signals.csv", "w", encoding="ascii") as file:
            file.write("time_s,a_rad\n" + "".join("%g,%g\n" % (0.01 * i, i * i) for i in range(100)))
        environment = {"LD_PRELOAD": preload, "FAIL_NTH_ROOT": self.root, "PATH": os.environ["PATH"],
                       "TMPDIR": self.root + "/tmp", "XDG_CACHE_HOME": self.root + "/tmp", "HOME": self.root + "/tmp",
                       "ASAN_OPTIONS": "verify_asan_link_order=0:detect_leaks=0:allocator_may_return_null=1"}
        self.clean()
        self.process = subprocess.Popen([program] + case.arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        env=environment, text=True)
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
        if outcome.files != calm.files:
            differ = sorted(set(outcome.files.items()) ^ set(calm.files.items()))
            wrong.append("status %d, but it leaves other files: %s" % (outcome.status, differ))
        return wrong
    if outcome.status not in (3,) + case.status + ((2,) if what == EACCES else ()):
        wrong.append("status %d" % outcome.status)
    message = [line for line in outcome.err.splitlines() if line.startswith("coman-hil")]
    if outcome.status in case.status:
        message += outcome.out.splitlines()
    # glibc makes EAGAIN of whatever a new thread lacks
    if not message:
        wrong.append("status %d without a message" % outcome.status)
    elif what == ENOMEM and not re.search("[Mm]emory|thread", "\n".join(message)):
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
        found = subprocess.run(["addr2line", "-fse", module, hex(int(offset, 16) - 1)], capture_output=True, text=True,
                               check=False).stdout.split("\n")
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


def fail_allocations(server, report, full):
    case = server.case
    calm = server.run("a 0 0")
    places = sorted(int(n) for n in calm.where)
    chosen = range(1, calm.seen + 1) if full else places
    found = 0
    for n in chosen:
        for span in (1, 0) if not full or n in places else (1,):
            outcome = server.run("a %d %d" % (n, span))
            wrong = judge(case, calm, outcome, ENOMEM)
            if wrong:
                found += 1
                report.finding("%s, allocation %d%s" % (case.name, n, "" if span else " and all that follow"),
                               wrong, outcome, symbols(outcome.where))
    report.result(not found, "%s: %d of %d allocations from %d places fail, %d runs"
                  % (case.name, len(chosen), calm.seen, len(places), server.runs))


def chosen_calls(count, salt):
    """Up to five of the n-th calls of a kind: first, last, and some between."""
    if count <= 5:
        return range(1, count + 1)
    step = (count - 1) / 4.0
    return sorted({1, count} | {int(1 + step * i + (salt * 7 % int(step + 1))) % count + 1 for i in range(1, 4)})


def fail_calls(server, report, full):
    case, start = server.case, server.runs
    calm = server.run("s -1 0 0 0")
    if calm is None:
        print("# SKIP: system calls are intercepted on x86-64 only")
        return
    kinds = sorted((int(n), int(count)) for n, count in (word.split(":") for word in calm.where))
    found, unknown = 0, []
    for number, count in kinds:
        if number not in CALLS:
            unknown.append(number)
            continue
        name, errnos = CALLS[number]
        for n in range(1, count + 1) if full else chosen_calls(count, number):
            for what in errnos if full else errnos[(n + number) % len(errnos):][:1] if errnos else []:
                outcome = server.run("s %d %d 1 %d" % (number, n, what))
                wrong = judge(case, calm, outcome, what)
                if wrong:
                    found += 1
                    report.finding("%s, %s %d (%d) %s" % (case.name, name, n, number, ERRNO_NAMES[what]), wrong, outcome,
                                   " ".join(outcome.where))
    report.result(not found, "%s: system calls of %d kinds fail, %d runs" % (case.name, len(kinds), server.runs - start))


def main():
    arguments = sys.argv[1:]
    full = "--full" in arguments or os.environ.get("HIL_FAIL_NTH") == "full"
    only = arguments[arguments.index("--only") + 1] if "--only" in arguments else ""
    kind = arguments[arguments.index("--kind") + 1] if "--kind" in arguments else ""
    report = Report()
    for case in CASES:
        if only not in case.name:
            continue
        server = Server(os.path.abspath(arguments[0]), os.path.abspath(arguments[1]), case)
        if kind != "syscall":
            fail_allocations(server, report, full)
        if kind != "allocation":
            fail_calls(server, report, full)
        server.close()
    print("1..%d" % report.number)
    return 1 if report.failed else 0


sys.exit(main())
