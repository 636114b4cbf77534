# SPDX-License-Identifier: Apache-2.0
"""A client of the page's server on plain sockets, and a simulator that has such a server."""
import base64
import json
import os
import re
import signal
import socket
import struct
import subprocess
import tempfile
import time

from ready import wait_until_ready

PROGRAM = os.path.join(os.environ["HIL_BINARY_DIR"], "coman-hil")
RIGS = os.path.join(os.environ["HIL_SOURCE_DIR"], "config", "rigs")
WORK = tempfile.TemporaryDirectory()
PATIENCE_S = 30
HEADER = struct.Struct("<BBHIQqqqIIffff8H")
FIELDS = ("kind version flags skipped tick time_ns elapsed_ns sent_ns overruns lost speed mean p99 "
          "max nbody njoint ncontact nbus nboard nfault nsignal reserved").split()


class Simulator:
    """`coman-hil run RIG --http 0 ...`, until the end of the with."""

    def __init__(self, rig, *arguments):
        self.socket = tempfile.mktemp(dir=WORK.name)
        self.log = tempfile.NamedTemporaryFile("w+", dir=WORK.name, delete=False)
        if "--control" not in arguments:
            arguments = ("--control", self.socket, *arguments)
        ready = tempfile.mktemp(dir=WORK.name)
        self.process = subprocess.Popen(
            [PROGRAM, "run", os.path.join(RIGS, rig + ".yaml"), "--transport", "local", "--http",
             "0", "--ready", ready, "--quiet", *arguments],
            stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log)
        places = wait_until_ready(ready, self.process, PATIENCE_S, self.text)
        self.look, self.control = places["page_view"], places.get("page")
        self.port = int(re.search(r":(\d+)/", self.look)[1])

    def text(self):
        return open(self.log.name).read()

    def stop(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        return self.process.wait(PATIENCE_S)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()


def token(address):
    return address.split("=")[1]


def ask_http(port, path="/", host=None, headers=(), send=None):
    """The status and the body of an answer; send: the bytes of the request instead."""
    with socket.create_connection(("127.0.0.1", port), PATIENCE_S) as connection:
        lines = [f"GET {path} HTTP/1.1", f"Host: {host or f'127.0.0.1:{port}'}", *headers]
        connection.sendall(send if send is not None else "\r\n".join([*lines, "", ""]).encode())
        data = b""
        while part := connection.recv(65536):
            data += part
    head, _, body = data.partition(b"\r\n\r\n")
    return int(head.split()[1]), body, head.decode()


class Page:
    """A WebSocket; entered when there is an address."""

    def __init__(self, port, address=None, origin=None, source=None, stay=False):
        self.connection = socket.create_connection(("127.0.0.1", port), PATIENCE_S,
                                                   source and (source, 0))
        self.data = b""
        self.number = 0
        self.events = []
        key = base64.b64encode(os.urandom(16)).decode()
        extra = f"Origin: {origin}\r\n" if origin else ""
        self.connection.sendall(
            f"GET /socket HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\n{extra}"
            f"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n\r\n"
            .encode())
        while b"\r\n\r\n" not in self.data:
            self._more()
        head, _, self.data = self.data.partition(b"\r\n\r\n")
        self.status = int(head.split()[1])
        self.hello = None
        if address:
            self.send({"cmd": "enter", "token": token(address), **({"stay": True} if stay else {})})
            self.hello = self.receive()

    def send_frame(self, payload, opcode=1, first=0x80):
        size = len(payload)
        length = (bytes([0x80 | size]) if size < 126 else
                  b"\xfe" + struct.pack(">H", size) if size < 65536 else
                  b"\xff" + struct.pack(">Q", size))
        mask = os.urandom(4)
        self.connection.sendall(bytes([first | opcode]) + length + mask +
                                bytes(byte ^ mask[i % 4] for i, byte in enumerate(payload)))

    def send(self, message):
        self.send_frame(json.dumps(message).encode())

    def _more(self):
        part = self.connection.recv(65536)
        if not part:
            raise EOFError("the server has closed the connection")
        self.data += part

    def _take(self, size):
        while len(self.data) < size:
            self._more()
        taken, self.data = self.data[:size], self.data[size:]
        return taken

    def receive(self):
        """A message: an object, the bytes of a state or trace, or ("closed", status)."""
        first, size = self._take(2)
        if size == 126:
            size, = struct.unpack(">H", self._take(2))
        elif size == 127:
            size, = struct.unpack(">Q", self._take(8))
        payload = self._take(size)
        if first & 0xf == 8:
            return "closed", struct.unpack(">H", payload[:2])[0]
        return json.loads(payload) if first & 0xf == 1 else payload

    def until(self, wanted):
        """The first message that is wanted(message), or the end; events before it are kept."""
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            message = self.receive()
            if isinstance(message, tuple) or wanted(message):
                return message
            if isinstance(message, dict) and message.get("type") == "event":
                self.events.append(message)
        raise TimeoutError("other messages come, but not the one that is waited for")

    def ask(self, cmd, **keys):
        """The answer to a request; states before it are dropped, events kept."""
        self.number += 1
        self.send({"id": self.number, "cmd": cmd, **keys})
        return self.until(lambda message: isinstance(message, dict)
                          and message.get("id") == self.number)

    def state(self, kind=1, where=lambda message: True):
        """The next state, or binary message of a kind, of which where(message) holds."""
        message = self.until(lambda message: isinstance(message, bytes) and message[0] == kind
                             and where(message))
        assert isinstance(message, bytes), message
        return message

    def close(self):
        self.connection.close()


def header(state):
    return dict(zip(FIELDS, HEADER.unpack_from(state)))
