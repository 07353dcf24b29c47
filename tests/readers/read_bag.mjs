// SPDX-License-Identifier: BSD-3-Clause
// read_bag.mjs FILE: reads an uncompressed ROS 1 bag and prints what it has as JSON.
import rosbag from "@foxglove/rosbag";
import files from "@foxglove/rosbag/node.js";

const bag = new rosbag.Bag(new files.FileReader(process.argv[2]));
await bag.open();
const topics = {};
for await (const one of bag.messageIterator()) {
    const found = topics[one.topic] ??= { messages: 0, type: one.message.constructor.name };
    ++found.messages;
    const stamp = one.message.header.stamp;
    if (stamp.sec !== one.timestamp.sec || stamp.nsec !== one.timestamp.nsec)
        throw new Error(`${one.topic}: the bag's time is not the header's`);
    if (one.message.data) found.bytes = one.message.data.length;
}
console.log(JSON.stringify({ topics, chunks: bag.chunkInfos.length }));
