// SPDX-License-Identifier: Apache-2.0
// usage: node mcap_read.mjs MODULES FILE: reads an MCAP file by @mcap/core with every checksum, by
// its index and again from front to end; a file without an end only so. Prints a JSON object: how
// it was read, messages a topic, and the content of each message on /signals and /contacts.
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";

const [modules, path] = process.argv.slice(2);
const require = createRequire(modules + "/package.json");
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { decompress } = require("fzstd");

const data = readFileSync(path);
const decompressHandlers = {
  zstd: (bytes, size) => decompress(bytes, new Uint8Array(Number(size))),
};
const readable = {
  size: async () => BigInt(data.length),
  read: async (offset, size) =>
    data.subarray(Number(offset), Number(offset) + Number(size)),
};
const text = new TextDecoder();

function note(into, topic, message) {
  const content = JSON.parse(text.decode(message.data));
  into.count[topic] = (into.count[topic] ?? 0) + 1;
  if (topic === "/signals") into.signals.push([Number(message.logTime), content]);
  if (topic === "/contacts") into.contacts.push([Number(message.logTime), content]);
}

function stream() {
  const found = { count: {}, signals: [], contacts: [], ended: false };
  const channels = new Map();
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  reader.append(data);
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Channel") channels.set(record.id, record.topic);
    if (record.type === "Message") note(found, channels.get(record.channelId), record);
  }
  found.ended = reader.done();
  return found;
}

async function indexed() {
  const found = { count: {}, signals: [], contacts: [] };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    note(found, reader.channelsById.get(message.channelId).topic, message);
  }
  return found;
}

const streamed = stream();
const by_index = streamed.ended ? await indexed() : null;
console.log(JSON.stringify({ streamed, by_index }));
