#!/usr/bin/python3 -ISB
# SPDX-License-Identifier: Apache-2.0
"""First process of the guest that run.sh boots: prepares the machine, runs the command, powers off.
One program, because user-mode Linux is slow at starting processes: as a script of some forty
commands this took longer than the kernel's own start.

It reads from the folder HIL_WORK, strings that end in NUL each: "environment" has variables as
NAME=VALUE, "command" the command's words, before which an empty one says that the command takes
the place of this process. It writes "output" (the command's, or why there is none) and "status".
"""
import ctypes
import os
import signal
import socket
import struct
import sys
import traceback

INTERFACES, FAILED = 5, 71
MS_RDONLY, MS_REMOUNT = 1, 32
SYS_FINIT_MODULE, POWER_OFF = 313, 0x4321FEDC
SIOCSIFFLAGS, IFF_UP, IFF_RUNNING = 0x8914, 1, 0x40
RTM_NEWLINK, NLM_F_REQUEST, NLM_F_ACK, NLM_F_EXCL, NLM_F_CREATE = 16, 1, 4, 0x200, 0x400
IFLA_IFNAME, IFLA_LINKINFO, IFLA_INFO_KIND = 3, 18, 1
DEVICES = {"null": 3, "zero": 5, "full": 7, "random": 8, "urandom": 9}
MODULES = ("net/can/can", "net/can/can-raw", "net/can/can-bcm", "net/can/can-gw",
           "drivers/net/can/dev/can-dev", "drivers/net/can/vcan", "drivers/net/can/vxcan")
WORK = os.environ["HIL_WORK"]  # from the kernel's command line
LIBC = ctypes.CDLL(None, use_errno=True)


def power_off(status):
    """Never returns: a first process that ends is a kernel panic."""
    with open(WORK + "/status", "w") as file:
        file.write("%d\n" % status)
    os.sync()
    LIBC.reboot(POWER_OFF)
    signal.pause()


def require(result, what):
    if result:
        raise OSError(ctypes.get_errno(), "%s: %s" % (what, os.strerror(ctypes.get_errno())))


def mount(kind, path, flags=0, data=None):
    require(LIBC.mount(b"none", path.encode(), kind.encode(), ctypes.c_ulong(flags),
                       data and data.encode()), "cannot mount %s at %s" % (kind, path))


def mount_host_directory(path, flags=0):
    """Mounts a directory of the host at the path that it has there, over what lies above it."""
    os.makedirs(path, exist_ok=True)
    mount("hostfs", path, 0, path)
    mount("hostfs", path, MS_REMOUNT | flags, path)


def make_devices():
    mount("tmpfs", "/dev")
    os.umask(0)
    for name, minor in DEVICES.items():
        os.mknod("/dev/" + name, 0o20666, os.makedev(1, minor))
    os.umask(0o22)
    os.mkdir("/dev/shm")
    os.symlink("/proc/self/fd", "/dev/fd")


def attribute(kind, data):
    return struct.pack("=HH", 4 + len(data), kind) + data + bytes(-len(data) % 4)


def create_interface(netlink, name):
    """Creates a virtual CAN interface, which is up."""
    link = struct.pack("=BxHiII", 0, 0, 0, IFF_UP, IFF_UP)
    link += attribute(IFLA_IFNAME, name.encode())
    link += attribute(IFLA_LINKINFO, attribute(IFLA_INFO_KIND, b"vcan"))
    flags = NLM_F_REQUEST | NLM_F_CREATE | NLM_F_EXCL | NLM_F_ACK
    netlink.send(struct.pack("=IHHII", 16 + len(link), RTM_NEWLINK, flags, 0, 0) + link)
    code = struct.unpack_from("=i", netlink.recv(4096), 16)[0]
    if code:
        raise OSError(-code, "cannot create %s: %s" % (name, os.strerror(-code)))


def prepare_can():
    folder = "/usr/lib/uml/modules/%s/kernel/" % os.uname().release
    for name in MODULES:
        file = os.open(folder + name + ".ko", os.O_RDONLY)
        require(LIBC.syscall(SYS_FINIT_MODULE, file, b"", 0), "cannot load " + name)
        os.close(file)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        request = ctypes.create_string_buffer(struct.pack("16sh", b"lo", IFF_UP | IFF_RUNNING), 40)
        require(LIBC.ioctl(any_socket.fileno(), ctypes.c_ulong(SIOCSIFFLAGS), request),
                "cannot set lo up")
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0) as netlink:
        for number in range(INTERFACES):
            create_interface(netlink, "can%d" % number)


def read_words(name):
    with open(WORK + "/" + name) as file:
        return file.read().split("\0")[:-1]


def become(command, output):
    """Becomes the command, which writes to a file of HIL_WORK."""
    out = os.open(WORK + "/" + output, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    os.dup2(os.open("/dev/null", os.O_RDONLY), 0)
    os.dup2(out, 1)
    os.dup2(out, 2)
    try:
        os.execvp(command[0], command)
    except OSError as error:
        os.write(1, b"guest: cannot run %s: %s\n" % (command[0].encode(), str(error).encode()))
        os._exit(127)


def run(command):
    """Runs the command to its end; its status as a shell has it. Orphans are ours to wait for."""
    pid = os.fork()
    if pid == 0:
        become(command, "output")
    ended = 0
    while ended != pid:
        ended, status = os.wait()
    return os.waitstatus_to_exitcode(status) % 256 if os.WIFEXITED(status) else (
        128 + os.WTERMSIG(status))


def main():
    mount("proc", "/proc")
    mount("sysfs", "/sys")
    make_devices()
    mount("tmpfs", "/run")
    mount("tmpfs", "/tmp")
    mount_host_directory(WORK)
    for word in read_words("environment"):
        os.environ.__setitem__(*word.split("=", 1))
    os.environ.update(PATH="/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
                      HOME="/root", LC_ALL="C.UTF-8")
    os.environ.pop("PYTHONHASHSEED", None)
    mount_host_directory(os.environ["HIL_SOURCE_DIR"], MS_RDONLY)
    mount_host_directory(os.environ["HIL_BINARY_DIR"])
    prepare_can()
    os.chdir(os.environ["HIL_BINARY_DIR"])
    command = read_words("command")
    if not command[0]:
        become(command[1:], "console")
    power_off(run(command))


try:
    main()
except BaseException:
    reason = traceback.format_exc()
    sys.stdout.write(reason)
    sys.stdout.flush()
    with open(WORK + "/output", "a") as failed:
        failed.write("Bail out! guest: %s\n" % reason.strip().splitlines()[-1])
    power_off(FAILED)
