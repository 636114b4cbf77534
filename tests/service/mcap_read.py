# SPDX-License-Identifier: Apache-2.0
"""Reads MCAP files from the specification (mcap.dev/spec) alone, every checksum and index held
against the bytes; zstd through the system's library. read(bytes) is strict: a whole file with all
that an indexed one has. recover(bytes) takes what a file without an end still holds."""
import ctypes
import json
import struct
import zlib

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, SUMMARY_OFFSET, DATA_END = 11, 14, 15

zstd = ctypes.CDLL("libzstd.so.1")
zstd.ZSTD_decompress.restype = ctypes.c_size_t
zstd.ZSTD_decompress.argtypes = [ctypes.c_char_p, ctypes.c_size_t, ctypes.c_char_p,
                                 ctypes.c_size_t]


class Broken(Exception):
    """What the file does not keep of the specification."""


def must(good, what):
    if not good:
        raise Broken(what)


class Fields:
    """The fields of a record, one after the other."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, size):
        must(self.at + size <= len(self.data), "a record ends within a field")
        self.at += size
        return self.data[self.at - size:self.at]

    def number(self, size):
        return int.from_bytes(self.take(size), "little")

    def text(self):
        return self.take(self.number(4)).decode()

    def numbers(self, key, value):
        inner = Fields(self.take(self.number(4)))
        pairs = []
        while inner.at < len(inner.data):
            pairs.append((inner.number(key), inner.number(value)))
        return pairs

    def done(self):
        must(self.at == len(self.data), "a record is longer than its fields")


def records(data, at=0):
    """(opcode, offset, end, content) of each whole record."""
    while at + 9 <= len(data):
        size = struct.unpack_from("<Q", data, at + 1)[0]
        if at + 9 + size > len(data):
            return
        yield data[at], at, at + 9 + size, data[at + 9:at + 9 + size]
        at += 9 + size


def decompress(data, size):
    out = ctypes.create_string_buffer(size)
    must(zstd.ZSTD_decompress(out, size, data, len(data)) == size, "a chunk does not decompress")
    return out.raw


class File:
    def __init__(self):
        self.library, self.schemas, self.channels, self.chunks = None, {}, {}, []
        self.messages = []  # (topic, time, content)

    def take_definition(self, opcode, fields):
        if opcode == SCHEMA:
            key, value = fields.number(2), (fields.text(), fields.text(), fields.text())
            json.loads(value[2])
            must(key and self.schemas.setdefault(key, value) == value, "two schemas of one number")
        else:
            key, schema = fields.number(2), fields.number(2)
            value = (fields.text(), fields.text(), schema)
            fields.numbers(1, 1)
            must(schema in self.schemas, "a channel before its schema")
            must(self.channels.setdefault(key, value) == value, "two channels of one number")
        fields.done()

    def take_chunk(self, start, end, content):
        """Returns what the indexes have to say of it."""
        fields = Fields(content)
        first, last, size, crc = (fields.number(n) for n in (8, 8, 8, 4))
        must(fields.text() == "zstd", "a chunk that is not zstd")
        packed = fields.take(fields.number(8))
        fields.done()
        data = decompress(packed, size)
        must(zlib.crc32(data) == crc, "a chunk's checksum")
        index, times = {}, []
        for opcode, at, until, message in records(data):
            must(opcode == MESSAGE, "something else than a message in a chunk")
            channel, sequence, time, publish = struct.unpack_from("<HIQQ", message)
            must(channel in self.channels, "a message before its channel")
            index.setdefault(channel, []).append((time, at))
            times.append(time)
            self.messages.append((self.channels[channel][0], time, json.loads(message[22:])))
            must(publish == time, "two times")
            last_end = until
        must(last_end == size, "a chunk ends within a message")
        must((first, last) == (min(times), max(times)), "a chunk's span")
        self.chunks.append({"first": first, "last": last, "start": start, "length": end - start,
                            "index": index, "packed": len(packed), "size": size})
        return index


def read_data(data, file, at):
    """Up to the end of the data, or of what there is. Returns where that is."""
    expected = None  # of the chunk before: channels whose index has not come yet
    for opcode, start, end, content in records(data, at):
        if opcode == MESSAGE_INDEX:
            fields = Fields(content)
            channel, entries = fields.number(2), fields.numbers(8, 8)
            must(expected and expected.pop(channel, None) == entries, "an index of messages")
            file.chunks[-1].setdefault("where", {})[channel] = start
            file.chunks[-1]["until"] = end
        elif opcode == DATA_END:
            must(not expected, "messages without an index")
            must(Fields(content).number(4) == zlib.crc32(data[:start]), "the checksum of the data")
            return end
        else:
            must(not expected, "messages without an index")
            if opcode == CHUNK:
                expected = dict(file.take_chunk(start, end, content))
            else:
                must(opcode in (SCHEMA, CHANNEL), f"record {opcode} in the data")
                file.take_definition(opcode, Fields(content))
    return None


def open_file(data):
    must(data[:8] == MAGIC, "the magic at the begin")
    file = File()
    opcode, _, end, content = next(records(data, 8))
    fields = Fields(content)
    must(opcode == HEADER and fields.text() == "", "the header")
    file.library = fields.text()
    return file, end


def check_chunk_index(chunk, fields):
    found = [fields.number(8) for _ in range(4)]
    must(found == [chunk[k] for k in ("first", "last", "start", "length")], "an index of chunks")
    must(dict(fields.numbers(2, 8)) == chunk["where"], "where the indexes of a chunk are")
    must(fields.number(8) == chunk["until"] - chunk["start"] - chunk["length"], "their length")
    must((fields.text(), fields.number(8), fields.number(8)) ==
         ("zstd", chunk["packed"], chunk["size"]), "the sizes of a chunk")
    fields.done()


def check_statistics(file, fields):
    counts = {}
    for topic, _, _ in file.messages:
        counts[topic] = counts.get(topic, 0) + 1
    times = [time for _, time, _ in file.messages] or [0]
    found = [fields.number(n) for n in (8, 2, 4, 4, 4, 4, 8, 8)]
    must(found == [len(file.messages), len(file.schemas), len(file.channels), 0, 0,
                   len(file.chunks), min(times), max(times)], f"the statistics: {found}")
    must({file.channels[c][0]: n for c, n in fields.numbers(2, 8) if n} == counts,
         "the counts of messages")
    fields.done()


def read(data):
    """A whole file; Broken says what is wrong with it."""
    must(data[-8:] == MAGIC, "the magic at the end")
    file, at = open_file(data)
    summary = read_data(data, file, at)
    must(summary, "there is no end of the data")
    schemas, channels, chunks = dict(file.schemas), dict(file.channels), list(file.chunks)
    groups = {}
    for opcode, start, end, content in records(data[:-8], summary):
        fields = Fields(content)
        if opcode in (SCHEMA, CHANNEL):
            file.take_definition(opcode, fields)
        elif opcode == CHUNK_INDEX:
            check_chunk_index(chunks.pop(0), fields)
        elif opcode == STATISTICS:
            check_statistics(file, fields)
        elif opcode == SUMMARY_OFFSET:
            kind, begin, length = fields.number(1), fields.number(8), fields.number(8)
            groups["at"] = groups.get("at", start)
            must(groups.pop(kind) == (begin, begin + length), f"the offset of group {kind}")
            continue
        else:
            must(opcode == FOOTER and end == len(data) - 8, "a record of the summary")
            must(groups.pop("at") == struct.unpack_from("<Q", content, 8)[0] and not groups and
                 struct.unpack_from("<Q", content)[0] == summary, "the footer")
            must(zlib.crc32(data[summary:end - 4]) == struct.unpack_from("<I", content, 16)[0],
                 "the checksum of the summary")
            break
        groups[opcode] = (groups.get(opcode, (start,))[0], end)
    must(not chunks and (schemas, channels) == (file.schemas, file.channels), "the summary")
    return file


def recover(data):
    """What a file without an end holds: all up to its last whole chunk."""
    file, at = open_file(data)
    try:
        must(read_data(data, file, at) is None, "it has an end")
    except StopIteration as error:
        raise Broken("no record") from error
    return file
