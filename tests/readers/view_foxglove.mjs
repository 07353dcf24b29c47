// SPDX-License-Identifier: BSD-3-Clause
// view_foxglove.mjs URL PROTOCOL MESSAGES [PAUSE_MS]: looks at a server as Foxglove does, by its own
// client: subscribes to all channels, decodes each message by its schema, and prints as JSON what
// came, by topic, once each has had MESSAGES. PAUSE_MS: it first reads nothing for so long.
import crypto from "node:crypto";
import protocolPackage from "@foxglove/ws-protocol";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import WebSocket from "ws";

const { FoxgloveClient } = protocolPackage;
const [url, protocol, wanted, pause] = process.argv.slice(2);
const socket = new WebSocket(url, [protocol]);
const client = new FoxgloveClient({ ws: socket });
const rare = "/versavis/events";  // of which nobody knows when the next comes
const topics = {};
const subscriptions = new Map();
const status = [];
let info = null;

let finished = false;
function finish(code, error) {
    if (finished) return;
    finished = true;
    const text = JSON.stringify({ info, protocol: socket.protocol, topics, status, error },
        (_, value) => typeof value === "bigint" ? String(value) : value);
    process.stdout.write(text, () => process.exit(code));
}

/** An image by its contents, not its bytes; and whatever else a message says. */
function summary(type, message) {
    const { data, ...rest } = message;
    if (!(data instanceof Uint8Array)) return message;
    return { ...rest, bytes: data.length, magic: Buffer.from(data.subarray(0, 3)).toString("hex"),
        sha256: crypto.createHash("sha256").update(data).digest("hex") };
}

client.on("error", (error) => finish(1, String(error.message ?? error)));
client.on("close", () => finish(1, "the server closed the connection"));
client.on("serverInfo", (event) => { info = event; });
client.on("status", (event) => { status.push(event); });
client.on("advertise", (channels) => {
    for (const channel of channels) {
        const id = client.subscribe(channel.id);
        const reader = new MessageReader(parse(channel.schema, { ros2: true }));
        subscriptions.set(id, { channel, reader });
        topics[channel.topic] = { type: channel.schemaName, messages: [] };
    }
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
    const { channel, reader } = subscriptions.get(subscriptionId);
    const message = summary(channel.schemaName, reader.readMessage(data));
    const { messages } = topics[channel.topic];
    messages.push({ time: String(timestamp), age_ms: Date.now() - Number(timestamp / 1000000n),
        message });
    const lacks = Object.entries(topics).some(([name, topic]) =>
        topic.messages.length < (name === rare ? 1 : wanted));
    if (!lacks && topics["/cam0/image_raw"]) finish(0, null);
});
if (pause) {
    socket.once("open", () => setTimeout(() => {
        socket.pause();
        setTimeout(() => {
            for (const [name, topic] of Object.entries(topics))
                if (name !== rare) topic.messages = [];
            socket.resume();
        }, Number(pause));
    }, 1500));
}
