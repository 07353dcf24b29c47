// SPDX-License-Identifier: BSD-3-Clause
#include "recording/recording_info.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "kind_name.hpp"
#include "versavis/pixel_format.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

/// Steps of a stamp that are no pause of the stream: another epoch, or another clock.
constexpr Duration longest_step = seconds(3600);

struct StreamFacts {
    std::uint64_t items = 0;
    OutputTime first;
    OutputTime last;
    Duration longest_gap;
    std::uint64_t backwards = 0;
    std::uint64_t suspect = 0;
    std::uint64_t repeated = 0;
    std::uint64_t without_pixels = 0;
    std::set<std::uint64_t> lives;
    std::set<std::uint32_t> epochs;
    std::string format;
    bool compressed = false;

    void take(const RecordedItem& item) {
        if (items == 0) first = item.time;
        if (items > 0 && item.time < last) ++backwards;
        if (items > 0 && item.time - last < longest_step)
            longest_gap = std::max(longest_gap, item.time - last);
        last = item.time;
        ++items;
        lives.insert(item.life);
        if (item.kind == ring::StreamKind::frames) take_frame(item);
        if (item.kind == ring::StreamKind::imu) take_sample(item);
    }

    void take_frame(const RecordedItem& item) {
        const auto data = unpack<FrameMetadata>(item.metadata);
        if ((data.flags & flag_suspect) != 0) ++suspect;
        if (item.place.image == ItemPlace::no_image) ++without_pixels;
        epochs.insert(data.epoch);
        if (format.empty())
            format = fmt::format("{} x {} {}", data.width, data.height,
                                 pixel_format_name(data.pixel_format));
    }

    void take_sample(const RecordedItem& item) {
        const auto data = unpack<ImuMetadata>(item.metadata);
        if ((data.flags & flag_suspect) != 0) ++suspect;
        if ((data.flags & flag_repeated) != 0) ++repeated;
        epochs.insert(data.epoch);
    }

    double rate() const {
        const Duration span = last - first;
        return items < 2 || span.ns <= 0
                   ? 0
                   : static_cast<double>(items - 1) * 1e9 / static_cast<double>(span.ns);
    }
};

json stream_json(const RecordedStream& stream, const StreamFacts& facts) {
    json one{{"name", stream.name},
             {"kind", kind_name(stream.kind)},
             {"items", facts.items},
             {"rate_hz", facts.rate()},
             {"first_ns", facts.first.ns},
             {"last_ns", facts.last.ns},
             {"longest_gap_ns", facts.longest_gap.ns},
             {"backwards", facts.backwards},
             {"lives", facts.lives.size()}};
    if (!facts.epochs.empty()) one["epochs"] = facts.epochs.size();
    if (stream.kind == ring::StreamKind::frames)
        one.update({{"format", facts.format},
                    {"suspect", facts.suspect},
                    {"without_pixels", facts.without_pixels}});
    if (stream.kind == ring::StreamKind::imu)
        one.update({{"suspect", facts.suspect}, {"repeated", facts.repeated}});
    return one;
}

/// From the first stamp to the last. The inputs of pairing and clock may be from minutes before
/// the recording: it counts where there is nothing else.
std::pair<OutputTime, OutputTime> extent(const std::vector<RecordedStream>& all,
                                         const std::map<std::string, StreamFacts>& streams) {
    using ring::StreamKind;
    for (const bool stamped : {true, false}) {
        std::optional<std::pair<OutputTime, OutputTime>> found;
        for (const RecordedStream& stream : all) {
            const StreamFacts& its = streams.at(stream.name);
            const bool has_stamps =
                stream.kind == StreamKind::frames || stream.kind == StreamKind::imu ||
                stream.kind == StreamKind::events || stream.kind == StreamKind::nmea;
            if (its.items == 0 || has_stamps != stamped) continue;
            if (!found) found.emplace(its.first, its.last);
            found->first = std::min(found->first, its.first);
            found->second = std::max(found->second, its.last);
        }
        if (found) return *found;
    }
    return {};
}

json gaps_json(const std::vector<RecordedGap>& gaps) {
    json list = json::array();
    for (const auto& gap : gaps)
        list.push_back({{"stream", gap.stream},
                        {"reason", gap.reason},
                        {"items", gap.items},
                        {"time_ns", gap.time.ns}});
    return list;
}

std::string metadata_value(const std::map<std::string, std::string>& values,
                           const std::string& key) {
    const auto found = values.find(key);
    return found == values.end() ? std::string() : found->second;
}

std::string stream_line(const json& one) {
    std::string line = fmt::format("  {:<16} {:<8} {:>9} items {:>9.2f} Hz, longest gap {:.1f} ms",
                                   one["name"].get<std::string>(), one["kind"].get<std::string>(),
                                   one["items"].get<std::uint64_t>(), one["rate_hz"].get<double>(),
                                   one["longest_gap_ns"].get<double>() / 1e6);
    if (one.contains("format")) line += ", " + one["format"].get<std::string>();
    const auto count = [&](const char* key, const char* name) {
        if (const auto items = one.value(key, std::uint64_t{0}); items > 0)
            line += fmt::format(", {} {}", items, name);
    };
    count("suspect", "suspect");
    count("repeated", "repeated");
    count("without_pixels", "without pixels");
    count("backwards", "stamps before their predecessor");
    if (one.value("lives", std::size_t{1}) > 1)
        line += fmt::format(", {} runs of the service", one["lives"].get<std::size_t>());
    return line + "\n";
}

}  // namespace

Expected<json> recording_info(const std::string& path, const Recording& recording) {
    std::map<std::string, StreamFacts> streams;
    auto read = recording.glance({}, [&](const RecordedItem& item) {
        streams[item.stream].take(item);
        return true;
    });
    if (!read) return Unexpected(read.error());
    const auto gaps = recording.gaps();
    if (!gaps) return Unexpected(gaps.error());
    const RecordingFacts& facts = recording.facts();
    const std::vector<std::string> damages = recording.damages();
    json info{{"file", path},
              {"files", facts.files},
              {"bytes", facts.bytes},
              {"whole", facts.defect.empty() && facts.missing.empty() && damages.empty()},
              {"defect", facts.defect},
              {"missing", facts.missing},
              {"damages", damages},
              {"good_bytes", facts.good_end},
              {"chunks", facts.chunks},
              {"output_clock", metadata_value(facts.metadata, "output_clock")},
              {"instance", metadata_value(facts.metadata, "instance")},
              {"part", metadata_value(facts.metadata, "part")},
              {"recorder", metadata_value(facts.metadata, "recorder")},
              {"streams", json::array()},
              {"gaps", gaps_json(*gaps)},
              {"attachments", json::array()}};
    for (const auto& stream : recording.streams())
        info["streams"].push_back(stream_json(stream, streams[stream.name]));
    const auto [first, last] = extent(recording.streams(), streams);
    info["begin_ns"] = first.ns;
    info["duration_ns"] = (last - first).ns;
    for (const auto& one : recording.attachments())
        info["attachments"].push_back(
            {{"name", one.name}, {"media_type", one.media_type}, {"bytes", one.content.size()}});
    return info;
}

std::string info_text(const json& info) {
    std::string text = fmt::format(
        "{}: {:.1f} MB, {:.1f} s, output clock {}, instance {}, part {}\n",
        info["file"].get<std::string>(), info["bytes"].get<double>() / 1e6,
        info["duration_ns"].get<double>() / 1e9, info["output_clock"].get<std::string>(),
        info["instance"].get<std::string>(), info["part"].get<std::string>());
    if (const auto files = info["files"].get<std::uint64_t>(); files > 1)
        text += fmt::format("  {} files\n", files);
    for (const auto& one : info["missing"])
        text += fmt::format("  missing: {}\n", one.get<std::string>());
    for (const auto& one : info["damages"])
        text += fmt::format("  left out: {}\n", one.get<std::string>());
    if (!info["defect"].get<std::string>().empty())
        text += fmt::format(
            "  incomplete: {}; {} of {} bytes can be read; 'versavis repair' completes it\n",
            info["defect"].get<std::string>(), info["good_bytes"].get<std::uint64_t>(),
            info["bytes"].get<std::uint64_t>());
    for (const auto& stream : info["streams"]) text += stream_line(stream);
    for (const auto& gap : info["gaps"])
        text += fmt::format("  gap of {}: {}, {} items, after {} ns\n",
                            gap["stream"].get<std::string>(), gap["reason"].get<std::string>(),
                            gap["items"].get<std::uint64_t>(), gap["time_ns"].get<std::int64_t>());
    for (const auto& one : info["attachments"])
        text += fmt::format("  attachment {}: {} bytes\n", one["name"].get<std::string>(),
                            one["bytes"].get<std::uint64_t>());
    return text;
}

}  // namespace versavis::client
