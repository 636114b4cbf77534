# SPDX-License-Identifier: Apache-2.0
"""All buses of a simulator on one connection, as a bus of python-can.

    bus = EveryBus("127.0.0.1", 29536)
    bus.send(can.Message(arbitration_id=0x001, data=b"\\x09\\x50", is_extended_id=False,
                         channel="left_leg"))
    message = bus.recv(1.0)          # message.channel is "torso", "left_leg", ...

One connection has one order: in lockstep every command takes part in the STEP that is sent after
it, on this machine and over a network. Of the DONE frames only the last one comes, that of the bus
of the STEP; by then every frame of the STEP has come. The protocol is in gateway.md.
"""
import re
import select
import socket
from collections import deque

import can

FRAME = re.compile(r"< (frame|fdframe|rtr) (\w+) (?:(\w\w) )?(\d+\.\d+) (\w*) (\S+) >"
                   r"|< error (.*?) >")


class EveryBus(can.BusABC):
    def __init__(self, host, port, patience_s=10.0, **arguments):
        self._socket = socket.create_connection((host, port), patience_s)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._text, self._messages = "", deque()
        for say, answer in (("", "< hi >"), ("< open all >", "< ok >"), ("< rawmode >", "< ok >")):
            self._socket.sendall(say.encode())
            heard = self._socket.recv(256).decode()
            if heard != answer:
                self._socket.close()
                raise can.CanInitializationError(f"{host}:{port} answered {heard!r} to {say!r}")
        self._socket.settimeout(None)
        super().__init__(channel="all", **arguments)

    def send(self, message, timeout=None):
        if not message.channel:
            raise can.CanOperationError("the message has no channel: the name of its bus")
        words = ["%08X" % message.arbitration_id if message.is_extended_id
                 else "%03X" % message.arbitration_id]
        if message.is_remote_frame:
            words = ["sendrtr", *words, str(message.dlc)]
        else:
            if message.is_fd:
                flags = message.bitrate_switch + 2 * message.error_state_indicator
                words = ["fdsend", *words, str(flags)]
            else:
                words = ["send", *words]
            words += [str(len(message.data)), *("%x" % byte for byte in message.data)]
        self._socket.sendall(f"< {' '.join(words)} {message.channel} >".encode())

    def _recv_internal(self, timeout):
        if not self._messages and select.select([self._socket], [], [], timeout)[0]:
            received = self._socket.recv(65536)
            if not received:
                raise can.CanOperationError("the simulator has closed the connection")
            self._read(self._text + received.decode())
        return (self._messages.popleft() if self._messages else None), False

    def _read(self, text):
        """Takes complete messages; what is incomplete waits for its end."""
        end = text.rfind(">") + 1
        self._text = text[end:]
        for kind, word, flags, time_s, data, bus, error in FRAME.findall(text, 0, end):
            if error:
                raise can.CanOperationError(f"the simulator answered: {error}")
            flags = int(flags or "0", 16)
            self._messages.append(can.Message(
                timestamp=float(time_s), arbitration_id=int(word, 16), channel=bus,
                is_extended_id=len(word) == 8, is_remote_frame=kind == "rtr",
                data=None if kind == "rtr" else bytes.fromhex(data), is_fd=kind == "fdframe",
                bitrate_switch=bool(flags & 1), error_state_indicator=bool(flags & 2)))

    def shutdown(self):
        super().shutdown()
        self._socket.close()
