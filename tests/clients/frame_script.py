# SPDX-License-Identifier: Apache-2.0
"""Frame scripts: what an unmodified client says to boards, and what they must answer. A script is
lines of words; # begins a comment.

    rig NAME [JSON]     the rig, with changes of keys; JSON may not contain #
    bus NAME            of the lines that follow
    watch ID/MASK ...   every frame of boards whose identifier is so under a mask must be expected
    send FRAME          sent in the next tick
    answer FRAME        the next watched frame, within 10 ms
    soon MS FRAME       seen within so long, whether it is watched or not
    never MS FRAME      not seen within so long
    wait MS             time passes, and no watched frame comes

Frames are as candump writes them: 70F#FF, 01000201#R (remote), 00008001##150 (CAN FD; the first
digit behind ## holds the flags, 1 = bit rate switch), with eight digits of 29 bits; x in what is
expected stands for any digit."""
import json
import re

import can
import coman_hil

PATIENCE_TICKS = 10


class Mismatch(AssertionError):
    """What came is not what the script says, with its line."""


def text_of(message):
    """A frame as candump writes it."""
    digits = 8 if message.is_extended_id else 3
    data = "R" if message.is_remote_frame else message.data.hex().upper()
    if message.is_fd:
        data = f"#{int(message.bitrate_switch)}{data}"
    return f"{message.arbitration_id:0{digits}X}#{data}"


def message_of(text, bus):
    """A frame to send."""
    identifier, data = text.split("#", 1)
    remote, fd = data.startswith("R"), data.startswith("#")
    flags, data = (int(data[1], 16), data[2:]) if fd else (0, data)
    return can.Message(arbitration_id=int(identifier, 16), is_extended_id=len(identifier) == 8,
                       is_remote_frame=remote, channel=bus,
                       is_fd=fd, bitrate_switch=bool(flags & 1),
                       data=b"" if remote else bytes.fromhex(data), check=True)


def is_like(text, pattern):
    """Whether a frame is an expected one."""
    return re.fullmatch(pattern.upper().replace("X", "[0-9A-F]"), text) is not None


class Player:
    """Plays the lines of a script to a simulator of its rig."""

    def __init__(self, simulator):
        self.simulator = simulator
        self.bus = None
        self.watched = []
        self.waiting = []   # watched frames that have come and were not expected yet
        self.tick_frames = []

    def step(self, ticks):
        """Runs on; collects what is watched, and all frames of these ticks."""
        self.simulator.step(ticks)
        self.tick_frames = [text_of(frame) for frame in self.simulator.frames(self.bus)]
        self.waiting += [text for text in self.tick_frames
                         if any(int(text.split("#")[0], 16) & mask == value
                                for value, mask in self.watched)]

    def answer(self, pattern):
        """Takes the next watched frame."""
        for _ in range(PATIENCE_TICKS):
            if self.waiting:
                break
            self.step(1)
        found = self.waiting.pop(0) if self.waiting else "none"
        if not is_like(found, pattern):
            raise Mismatch(f"found {found}, expected {pattern}")

    def sees(self, pattern, ticks):
        """Whether a frame comes within so many ticks."""
        self.step(ticks)
        return any(is_like(text, pattern) for text in self.tick_frames)

    def line(self, word, *rest):
        """Plays one line."""
        if word != "answer" and self.waiting:
            raise Mismatch(f"found {self.waiting[0]}, which is not expected")
        if word == "bus":
            self.bus = rest[0]
        elif word == "watch":
            self.watched = [tuple(int(part, 16) for part in each.split("/")) for each in rest]
        elif word == "send":
            self.simulator.send(message_of(rest[0], self.bus))
        elif word == "answer":
            self.answer(rest[0])
        elif word == "wait":
            self.step(int(rest[0]))
        elif word in ("soon", "never"):
            if self.sees(rest[1], int(rest[0])) == (word == "never"):
                raise Mismatch(f"{rest[1]} {'came' if word == 'never' else 'did not come'} "
                               f"within {rest[0]} ms")
            if word == "soon":  # what else is watched came while waiting for it
                self.waiting = [text for text in self.waiting if not is_like(text, rest[1])]
        else:
            raise ValueError(f"found \"{word}\", expected a word of a frame script")


def lines_of(path):
    """The lines with words, with their numbers."""
    for number, line in enumerate(path.read_text().splitlines(), 1):
        words = re.sub(r"(^|\s)#.*", "", line).split()
        if words:
            yield number, words


def play(path, program):
    """Plays a script to a simulator. Raises what does not match, with file and line."""
    lines = list(lines_of(path))
    rig = lines[0][1]
    if rig[0] != "rig":
        raise ValueError(f"{path.name}:{lines[0][0]}: found \"{rig[0]}\", expected rig NAME")
    changes = json.loads(" ".join(rig[2:])) if rig[2:] else None
    with coman_hil.Simulator(rig[1], hold="always", changes=changes,
                             program=program) as simulator:
        player = Player(simulator)
        for number, words in lines[1:]:
            try:
                player.line(*words)
            except (Mismatch, ValueError, TypeError) as error:
                raise Mismatch(f"{path.name}:{number}: {error}") from error
        player.line("wait", "1")
        player.line("wait", "1")  # judges what came in the first
