#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""A program as the host of a scenario: STEPs through raw CAN sockets, which socketcan.so connects
with the gateway, and answers frame 0x7f0 with the tick in which it was heard. leave N: ends after
N ticks with status 3. linger FILE: writes its process number and sleeps."""
import os
import select
import socket
import struct
import sys
import time

STEP, DONE, ASK, TELL = 0x6f0, 0x6ff, 0x7f0, 0x7f1


def bus(name):
    opened = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    opened.bind((name,))
    return opened


def put(opened, identifier, data):
    opened.send(struct.pack("=IB3x8s", identifier, len(data), data))


def get(opened):
    identifier, length, data = struct.unpack("=IB3x8s", opened.recv(16))
    return identifier, data[:length]


def heard(*opened):
    """What comes on any of them, in turn: DONE is handed over when all else has been read."""
    while True:
        for one in select.select(opened, [], [])[0]:
            yield get(one)


def main(what="", value="0"):
    if what == "linger":
        with open(value, "w") as file:
            print(os.getpid(), file=file)
        time.sleep(600)
    hip, shank = bus("left_hip"), bus("left_shank")
    tick = 0
    print("stepping", flush=True)
    while what != "leave" or tick < int(value):
        put(hip, STEP, struct.pack("<IH", tick, 1))
        asked = False
        for identifier, data in heard(hip, shank):
            asked |= identifier == ASK
            if identifier == DONE:
                tick = struct.unpack_from("<I", data)[0]
                break
        if asked:
            put(hip, TELL, struct.pack("<I", tick))
    sys.exit(3)


main(*sys.argv[1:])
