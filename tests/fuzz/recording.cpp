// SPDX-License-Identifier: BSD-3-Clause
// Any file as a recording.
#include "recording/recording.hpp"

#include "fuzz.hpp"
#include "recording/mcap_reader.hpp"
#include "recording/recording_info.hpp"

using namespace versavis;
using namespace versavis::client;

namespace {

/// What tells the recordings of others apart.
void read_mcap(const std::string& path) {
    const auto reader = McapReader::open(path);
    if (!reader) return;
    McapBuffer buffer;
    for (const McapChunk& chunk : reader->chunks())
        if (const auto records = reader->load(chunk, buffer))
            static_cast<void>(reader->for_each(
                chunk, *records, [](const McapRecord&) -> Expected<bool> { return true; }));
    static_cast<void>(reader->top_level([](const McapRecord&) -> Expected<bool> { return true; }));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const fuzz::MemoryFile file({data, size});
    read_mcap(file.path());
    const auto recording = Recording::open_file(file.path());
    if (!recording) return 0;
    if (const auto info = recording_info(file.path(), *recording))
        static_cast<void>(info_text(*info));
    std::vector<ItemPlace> places;
    static_cast<void>(recording->for_each({}, [&](const RecordedItem& item) {
        places.push_back(item.place);
        return places.size() < 100;
    }));
    for (const ItemPlace& place : places)
        static_cast<void>(recording->at(place, [](const RecordedItem&) { return true; }));
    static_cast<void>(recording->glance({}, [](const RecordedItem&) { return true; }));
    static_cast<void>(recording->gaps());
    return 0;
}
