// SPDX-License-Identifier: BSD-3-Clause
// read_mcap.mjs FILE: reads an MCAP file by its indexes and as a stream, with all checksums, and
// prints what it has as JSON.
import fs from "node:fs";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";

const bytes = fs.readFileSync(process.argv[2]);

class Memory {
    async size() { return BigInt(bytes.length); }
    async read(offset, length) {
        return new Uint8Array(bytes.buffer, bytes.byteOffset + Number(offset), Number(length));
    }
}

const streamed = {};
const reader = new McapStreamReader({ validateCrcs: true });
const topics = new Map();
reader.append(bytes);
let done = false;
for (let record; (record = reader.nextRecord());) {
    if (record.type === "Channel") topics.set(record.id, record.topic);
    if (record.type === "Footer") done = true;
    if (record.type !== "Message") continue;
    const topic = topics.get(record.channelId);
    streamed[topic] = (streamed[topic] ?? 0) + 1;
}

const indexed = {};
let last = -1n;
let ordered = true;
const file = await McapIndexedReader.Initialize({ readable: new Memory() });
for await (const message of file.readMessages({ validateCrcs: true })) {
    const topic = file.channelsById.get(message.channelId).topic;
    indexed[topic] = (indexed[topic] ?? 0) + 1;
    ordered &&= message.logTime >= last;
    last = message.logTime;
}
const attachments = [];
for await (const one of file.readAttachments({ validateCrcs: true })) attachments.push(one.name);
const metadata = [];
for await (const one of file.readMetadata()) metadata.push(one.name);

console.log(JSON.stringify({
    streamed, indexed, ordered, done, attachments, metadata,
    chunks: file.chunkIndexes.length,
    messages: Number(file.statistics.messageCount),
}));
