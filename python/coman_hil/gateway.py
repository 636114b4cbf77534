# SPDX-License-Identifier: Apache-2.0
"""All buses of a simulator on one connection, as a bus of python-can.

    bus = GatewayBus("127.0.0.1", 29536)
    bus.send(can.Message(arbitration_id=0x001, data=b"\\x09\\x50", is_extended_id=False,
                         channel="left_leg"))
    message = bus.recv(1.0)          # message.channel is "torso", "left_leg", ...

One connection has one order: in lockstep every command takes part in the STEP that is sent after
it, on this machine and over a network. Of the DONE frames only the last one comes, that of the bus
of the STEP; by then every frame of the STEP has come. The protocol is in gateway.md.
"""
from __future__ import annotations

import re
import select
import socket
from collections import deque
from typing import Optional, Tuple

import can

from .errors import GatewayError, SimulatorTimeout

FRAME = re.compile(r"< (frame|fdframe|rtr) (\w+) (?:(\w\w) )?(\d+\.\d+) (\w*) (\S+) >"
                   r"|< error (.*?) >")
ROW = re.compile(r"< row (.*?) >")
# kind, identifier, flags, seconds, data, bus, error: what FRAME finds, all as text
RawFrame = Tuple[str, str, str, str, str, str, str]


def command_text(message: can.Message) -> str:
    """What the gateway is told to send a message; its channel is the name of the bus."""
    if not message.channel:
        raise can.CanOperationError("the message has no channel: the name of its bus")
    identifier = "%08X" if message.is_extended_id else "%03X"
    words = [identifier % message.arbitration_id]
    if message.is_remote_frame:
        words = ["sendrtr", *words, str(message.dlc)]
    else:
        if message.is_fd:
            flags = message.bitrate_switch + 2 * message.error_state_indicator
            words = ["fdsend", *words, str(flags)]
        else:
            words = ["send", *words]
        words += [str(len(message.data)), *("%x" % byte for byte in message.data)]
    return f"< {' '.join(words)} {message.channel} >"


def message_of(frame: RawFrame) -> can.Message:
    """A frame of the gateway as python-can has it; timestamp is virtual time in s."""
    kind, word, flags_text, time_s, data, bus, _ = frame
    flags = int(flags_text or "0", 16)
    return can.Message(
        timestamp=float(time_s), arbitration_id=int(word, 16), channel=bus,
        is_extended_id=len(word) == 8, is_remote_frame=kind == "rtr",
        data=None if kind == "rtr" else bytes.fromhex(data), is_fd=kind == "fdframe",
        bitrate_switch=bool(flags & 1), error_state_indicator=bool(flags & 2))


class GatewayBus(can.BusABC):
    """All buses of a simulator; a message's channel is the name of its bus."""

    def __init__(self, host: str, port: int, timeout_s: float = 10.0, **arguments) -> None:
        """Connects, or raises GatewayError; timeout_s is for each answer meanwhile."""
        self._text = ""
        self._messages: deque[can.Message] = deque()
        try:
            self._socket = socket.create_connection((host, port), timeout_s)
        except OSError as error:
            raise GatewayError(f"{host}:{port}: {error.strerror or error}") from None
        try:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for say, answer in (("", "< hi >"), ("< open all >", "< ok >"),
                                ("< rawmode >", "< ok >")):
                self._socket.sendall(say.encode())
                heard = self._socket.recv(256).decode(errors="replace")
                if heard != answer:
                    raise GatewayError(f"{host}:{port} answered {heard!r} to {say!r}")
            super().__init__(channel="all", **arguments)
        except OSError as error:
            self._socket.close()
            raise GatewayError(f"{host}:{port}: {error}") from None
        except BaseException:
            self._socket.close()
            raise

    def send(self, msg: can.Message, timeout: Optional[float] = None) -> None:
        self.send_text(command_text(msg))

    def send_text(self, text: str) -> None:
        """Sends commands of the gateway as they are."""
        try:
            self._socket.sendall(text.encode())
        except socket.timeout:
            raise SimulatorTimeout("the simulator does not read what is sent to it") from None
        except OSError as error:
            raise GatewayError(f"the simulator has closed the connection: {error}") from None

    def ask(self, word: str, timeout_s: float = 10.0) -> list[str]:
        """The rows with which the run answers `tell WORD`: a part of the client table by number,
        or "dropped"."""
        self.send_text(f"< tell {word} >")
        text = self._text
        while "< ok >" not in text:
            if not select.select([self._socket], [], [], timeout_s)[0]:
                raise SimulatorTimeout(f"no answer to tell {word} within {timeout_s:g} s")
            received = self._socket.recv(1 << 18)
            text += received.decode()
            if not received or "< error " in text:
                raise GatewayError(f"the simulator answered {text[-80:]!r} to tell {word}")
        answer, self._text = text.split("< ok >", 1)
        rows = ROW.findall(answer)
        self._text = ROW.sub("", answer) + self._text
        return rows

    def receive_frames(self, timeout_s: Optional[float]) -> list[RawFrame]:
        """All frames that have come, at least one unless there is none for timeout_s; what is
        incomplete waits for its end. Raises GatewayError for a refusal and at the end of the
        connection."""
        if not select.select([self._socket], [], [], timeout_s)[0]:
            return []
        try:
            received = self._socket.recv(1 << 18)
        except OSError as error:
            raise GatewayError(f"the simulator has closed the connection: {error}") from None
        if not received:
            raise GatewayError("the simulator has closed the connection")
        text = self._text + received.decode()
        end = text.rfind(">") + 1
        self._text = text[end:]
        frames = FRAME.findall(text, 0, end)
        for frame in frames:
            if frame[6]:
                raise GatewayError(f"the simulator answered: {frame[6]}")
        return frames

    def _recv_internal(self, timeout: Optional[float]) -> Tuple[Optional[can.Message], bool]:
        if not self._messages:
            self._messages.extend(map(message_of, self.receive_frames(timeout)))
        return (self._messages.popleft() if self._messages else None), False

    def shutdown(self) -> None:
        super().shutdown()
        self._socket.close()
