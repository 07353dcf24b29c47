// SPDX-License-Identifier: BSD-3-Clause
#include "export/bag_export.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "export/export.hpp"
#include "export/ros1_messages.hpp"

namespace versavis::client {

namespace {

struct Entry {
    OutputTime time;
    ItemPlace place;
    std::uint32_t stream;  ///< cameras first, then IMUs: also its connection
};

/// The recording is only nearly in this order; the places of all items are known by now.
std::vector<Entry> in_order(const Selection& selection, const SelectedSequence& sequence) {
    std::vector<Entry> entries;
    entries.reserve(sequence.frames.size() + sequence.samples.size());
    const auto cameras = static_cast<std::uint32_t>(selection.cameras.size());
    for (const auto& frame : sequence.frames)
        entries.push_back({frame.time, frame.place, frame.camera});
    for (const auto& sample : sequence.samples)
        entries.push_back({sample.time, sample.place, cameras + sample.imu});
    std::stable_sort(entries.begin(), entries.end(),
                     [](const Entry& a, const Entry& b) { return a.time < b.time; });
    return entries;
}

Expected<> write_frame(BagWriter& bag, const Entry& entry, std::uint32_t sequence,
                       const ExportFormat& format, const RecordedItem& item) {
    const auto data = unpack<FrameMetadata>(item.metadata);
    const auto pixels = export_pixels(format, data, item.payload);
    if (pixels.empty())
        return failure(item.stream, fmt::format("the pixels of frame {} are damaged", item.number),
                       "record again, or leave this camera out");
    const auto head = ros1_image_head(
        {sequence, entry.time.ns, item.stream}, data.width, data.height, format.encoding,
        data.width * format.channels * format.bytes, static_cast<std::uint32_t>(pixels.size()));
    return bag.write(entry.stream, entry.time.ns, head, pixels);
}

}  // namespace

Expected<> export_bag(const Recording& recording, const Selection& selection,
                      const SelectedSequence& sequence, const std::vector<ExportFormat>& formats,
                      const std::string& path, BagCompression compression,
                      const ExportWatch& watch) {
    auto bag = BagWriter::create(path, compression);
    if (!bag) return Unexpected(bag.error());
    for (const auto& camera : selection.cameras)
        bag->add_connection(image_topic(camera.name), ros1_image);
    for (const auto& imu : selection.imus) bag->add_connection(imu_topic(imu.name), ros1_imu);
    std::vector<std::uint32_t> numbers(selection.cameras.size() + selection.imus.size(), 0);
    const auto entries = in_order(selection, sequence);
    for (std::size_t done = 0; done < entries.size(); ++done) {
        if (watch.stopped()) return stopped_error();
        const Entry& entry = entries[done];
        const std::uint32_t number = numbers[entry.stream]++;
        Expected<> written;
        auto read = recording.at(entry.place, [&](const RecordedItem& item) {
            if (item.kind == ring::StreamKind::frames)
                written = write_frame(*bag, entry, number, formats[entry.stream], item);
            else
                written = bag->write(entry.stream, entry.time.ns,
                                     ros1_imu_message({number, entry.time.ns, item.stream},
                                                      unpack<ImuMetadata>(item.metadata)));
            return true;
        });
        if (!read) return read;
        if (!written) return written;
        watch.show("messages", done + 1, entries.size());
    }
    return bag->finish();
}

}  // namespace versavis::client
