// SPDX-License-Identifier: BSD-3-Clause
// read_mcap.mjs FILE [--stream]: reads an MCAP file as a stream and by its indexes, with all
// checksums, decodes each message, and prints what it has as JSON. Files that tests make byte by byte
// may have channels without a schema. --stream: of a file that may be cut off, up to its last whole
// chunk.
import fs from "node:fs";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";

const bytes = fs.readFileSync(process.argv[2]);
const cutOff = process.argv[3] === "--stream";

class Memory {
    async size() { return BigInt(bytes.length); }
    async read(offset, length) {
        return new Uint8Array(bytes.buffer, bytes.byteOffset + Number(offset), Number(length));
    }
}

// What a message says must fit its channel, its stamp, and its own size.
const bytesOfPixel = { mono8: 1, mono16: 2, rgb8: 3, bgr8: 3 };
const checks = {
    "sensor_msgs/msg/Image"(message) {
        const pixel = bytesOfPixel[message.encoding] ?? (/^bayer_/.test(message.encoding) ? 1 : 0);
        return pixel > 0 && message.is_bigendian === 0 && message.step >= message.width * pixel
            && message.data.length === message.step * message.height;
    },
    "sensor_msgs/msg/CompressedImage"({ data, format }) {
        return Buffer.from(data.subarray(1, 4)).toString() === "PNG"
            && /^(\w+); png compressed \1$/.test(format);
    },
    "sensor_msgs/msg/CameraInfo"({ width, height, k, r, p }) {
        return width > 0 && height > 0 && k.length === 9 && r.length === 9 && p.length === 12;
    },
    "sensor_msgs/msg/Imu"(message) {
        return message.orientation_covariance[0] === -1
            && Number.isFinite(message.linear_acceleration.z);
    },
    "sensor_msgs/msg/MagneticField": ({ magnetic_field: { x } }) => Number.isFinite(x),
    "sensor_msgs/msg/Temperature": ({ temperature }) => Number.isFinite(temperature),
    "sensor_msgs/msg/TimeReference": ({ source }) => source.length > 0,
    "nmea_msgs/msg/Sentence": ({ sentence }) => /^[$!][ -~]*$/.test(sentence),
    "std_msgs/msg/String": ({ data }) => typeof JSON.parse(data) === "object",
    "versavis_msgs/msg/Item": ({ kind, metadata, payload, length }) => kind >= 1 && kind <= 7
        && metadata.length === 12 && payload.length === (kind === 1 ? 8 : length),
    "versavis_msgs/msg/Stamp": ({ width, height, stride, format }) => width > 0 && height > 0
        && stride >= width && format.length > 0,
    "versavis_msgs/msg/Event": ({ kind, reason }) => kind.length > 0 && reason.length > 0,
    "versavis_msgs/msg/Gap": ({ reason }) => /^(lost|restarted|gone|epoch)$/.test(reason),
};

const nanoseconds = ({ sec, nsec }) => BigInt(sec) * 1000000000n + BigInt(nsec);

// Decodes messages of `cdr` and notes what they are, by topic.
class Decoder {
    #readers = new Map();
    topics = {};

    take(channel, schema, message) {
        if (schema.data.length === 0) return;
        const fail = why => { throw new Error(`${channel.topic}: ${why}`); };
        if (channel.messageEncoding !== "cdr") fail(`its encoding is ${channel.messageEncoding}`);
        if (schema.encoding !== "ros2msg") fail(`the schema's encoding is ${schema.encoding}`);
        if (!this.#readers.has(channel.id)) {
            const definition = parse(new TextDecoder().decode(schema.data), { ros2: true });
            this.#readers.set(channel.id, new MessageReader(definition, { timeType: "sec,nsec" }));
        }
        const decoded = this.#readers.get(channel.id).readMessage(message.data);
        if (message.publishTime !== message.logTime) fail("it was published at another time");
        const { header, time_ns: time } = decoded;
        if (header && nanoseconds(header.stamp) !== message.logTime) fail("the stamp is another");
        const stamped = /\/(Item|Stamp|Event)$/.test(schema.name);
        if (stamped && time !== message.logTime) fail("its time is another");
        const source = channel.topic === "/utc" ? "board" : channel.metadata.get("stream");
        if (header && header.frame_id !== source) fail(`the frame is ${header.frame_id}`);
        const check = checks[schema.name] ?? fail(`nobody expects ${schema.name}`);
        if (!check(decoded)) fail("its parts do not fit one another");
        const { encoding, format, width, height, step } = decoded;
        const found = this.topics[channel.topic] ??= { type: schema.name, messages: 0,
            encoding: encoding ?? format, width, height, step };
        ++found.messages;
    }
}

const streamed = {};
const decoder = new Decoder();
const channels = new Map();
const schemas = new Map();
let done = false;
let end = "";
const reader = new McapStreamReader({ validateCrcs: true });
reader.append(bytes);
const next = () => {
    try {
        return reader.nextRecord();
    } catch (error) {
        if (!cutOff) throw error;
        end = error.message;
    }
};
for (let record; (record = next());) {
    if (record.type === "Schema") schemas.set(record.id, record);
    if (record.type === "Channel") channels.set(record.id, record);
    if (record.type === "Footer") done = true;
    if (record.type !== "Message") continue;
    const channel = channels.get(record.channelId);
    decoder.take(channel, schemas.get(channel.schemaId), record);
    streamed[channel.topic] = (streamed[channel.topic] ?? 0) + 1;
}

if (cutOff) {
    console.log(JSON.stringify({ streamed, decoded: decoder.topics, done, end }));
    process.exit(0);
}

const indexed = {};
const file = await McapIndexedReader.Initialize({ readable: new Memory() });
for await (const message of file.readMessages({ validateCrcs: true })) {
    const topic = file.channelsById.get(message.channelId).topic;
    indexed[topic] = (indexed[topic] ?? 0) + 1;
}
const attachments = [];
for await (const one of file.readAttachments({ validateCrcs: true })) attachments.push(one.name);
const metadata = [];
for await (const one of file.readMetadata()) metadata.push(one.name);

console.log(JSON.stringify({
    streamed, indexed, done, attachments, metadata,
    decoded: decoder.topics,
    chunks: file.chunkIndexes.length,
    messages: Number(file.statistics.messageCount),
}));
