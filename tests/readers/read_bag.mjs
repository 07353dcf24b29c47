// SPDX-License-Identifier: BSD-3-Clause
// read_bag.mjs FILE: reads a ROS 1 bag, uncompressed or lz4, and prints what it has as JSON.
import rosbag from "@foxglove/rosbag";
import files from "@foxglove/rosbag/node.js";
import decompressLz4 from "@foxglove/wasm-lz4";

await decompressLz4.isLoaded;
const bag = new rosbag.Bag(new files.FileReader(process.argv[2]),
                           { decompress: { lz4: (data, size) => decompressLz4(data, size) } });
await bag.open();
const nanoseconds = ({ sec, nsec }) => BigInt(sec) * 1000000000n + BigInt(nsec);
const topics = {};
let last = 0n;
// The iterator sorts within chunks that overlap; ours do not.
for (const { startTime, endTime } of bag.chunkInfos) {
    if (nanoseconds(startTime) < last) throw new Error("chunks are not in the order of time");
    last = nanoseconds(endTime);
}
last = 0n;
for await (const one of bag.messageIterator()) {
    const found = topics[one.topic] ??=
        { messages: 0, type: bag.connections.get(one.connectionId).type };
    ++found.messages;
    const stamp = one.message.header.stamp;
    if (stamp.sec !== one.timestamp.sec || stamp.nsec !== one.timestamp.nsec)
        throw new Error(`${one.topic}: the bag's time is not the header's`);
    if (nanoseconds(stamp) < last) throw new Error(`${one.topic}: not in the order of time`);
    last = nanoseconds(stamp);
    const { data, width, height, step, encoding } = one.message;
    if (!data) continue;
    if (data.length !== step * height) throw new Error(`${one.topic}: ${data.length} bytes`);
    Object.assign(found, { bytes: data.length, width, height, step, encoding });
}
console.log(JSON.stringify({ topics, chunks: bag.chunkInfos.length }));
