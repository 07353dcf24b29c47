// SPDX-License-Identifier: BSD-3-Clause
#include "tail.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/shallow_json.hpp"
#include "clock/clock_json.hpp"
#include "engine/clock/recording.hpp"
#include "engine/pairing/recording.hpp"
#include "pairing/evidence_json.hpp"
#include "recording/item_fields.hpp"
#include "status/status_document.hpp"
#include "versavis/stream.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

json describe(const ring::Item& item) {
    json line{{"number", item.number}, {"time_ns", item.time.ns}};
    if (item.stale) line["stale"] = true;
    return line;
}

json describe(ring::StreamKind kind, const ring::Item& item) {
    json line = describe(item);
    add_fields(line, kind, item.metadata, item.payload.attributes());
    return line;
}

json describe(const Frame& item) {
    json line = describe(ring::StreamKind::frames, item);
    line["bytes"] = item.payload.size();
    return line;
}

json describe(const ImuSample& item) { return describe(ring::StreamKind::imu, item); }

json describe(const Event& item) { return describe(ring::StreamKind::events, item); }

std::string text_of(const ring::Payload& payload) {
    std::string text(payload.size(), '\0');
    if (!payload.copy_to(reinterpret_cast<std::byte*>(text.data()))) text.clear();
    return text;
}

json describe(const NmeaSentence& item) {
    json line = describe(ring::StreamKind::nmea, item);
    line["text"] = text_of(item.payload);
    return line;
}

json describe(const pairing::EvidenceItem& item) {
    json line = describe(static_cast<const ring::Item&>(item));
    const auto evidence = pairing::from_metadata(item.data);
    line.update(evidence ? to_json(*evidence) : json{{"evidence", "unknown"}});
    return line;
}

json describe(const clock::StampItem& item) {
    json line = describe(static_cast<const ring::Item&>(item));
    const auto recorded = clock::from_metadata(item.data);
    line.update(recorded ? to_json(*recorded) : json{{"clock", "unknown"}});
    return line;
}

/// The document itself, so that a script sees what the status command sees.
json describe(const StatusDocument& item) {
    json line = describe(static_cast<const ring::Item&>(item));
    if (const std::string text = text_of(item.payload); !text.empty())
        line["status"] = parse_shallow_json(text);
    return line;
}

std::string one_line(const json& line, bool as_json) {
    // Whatever bytes a name has.
    constexpr auto replace = json::error_handler_t::replace;
    if (as_json) return line.dump(-1, ' ', false, replace);
    std::string text;
    for (const auto& [key, value] : line.items())
        text += fmt::format("{}{}={}", text.empty() ? "" : " ", key,
                            value.dump(-1, ' ', false, replace));
    return text;
}

template <class S>
Expected<> print_stream(const TailSettings& settings) {
    StreamOptions options;
    options.instance = settings.instance;
    if (settings.oldest) options.start = Position::oldest;
    auto stream = S::open(settings.stream, options);
    if (!stream) return Unexpected(stream.error());
    bool gone = false;
    for (std::uint64_t printed = 0;
         (settings.count == 0 || printed < settings.count) && !settings.stop();) {
        const auto item = stream->next(settings.wait);
        if (item) {
            fmt::print("{}\n", one_line(describe(*item), settings.json));
            std::fflush(stdout);
            ++printed;
            gone = false;
        } else if (item.error().why != Pause::nothing &&
                   !(gone && item.error().why == Pause::gone)) {
            fmt::print(stderr, "versavis: {}\n", item.error().message());
            gone = item.error().why == Pause::gone;
        }
    }
    return {};
}

}  // namespace

Expected<> tail(const TailSettings& settings) {
    auto reader = ring::Reader::open(stream_path(settings.instance, settings.stream));
    if (!reader) return Unexpected(explain(reader.error(), settings.instance, settings.stream));
    switch (reader->kind()) {
        case ring::StreamKind::frames: return print_stream<FrameStream>(settings);
        case ring::StreamKind::imu: return print_stream<ImuStream>(settings);
        case ring::StreamKind::events: return print_stream<EventStream>(settings);
        case ring::StreamKind::nmea: return print_stream<NmeaStream>(settings);
        case ring::StreamKind::status: return print_stream<StatusStream>(settings);
        case ring::StreamKind::evidence: return print_stream<pairing::EvidenceStream>(settings);
        case ring::StreamKind::clock: return print_stream<clock::ClockStream>(settings);
    }
    return failure(settings.stream, "is a kind of stream that this program does not know",
                   "install service and clients of the same release");
}

}  // namespace versavis::client
