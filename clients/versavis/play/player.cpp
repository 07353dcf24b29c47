// SPDX-License-Identifier: BSD-3-Clause
#include "play/player.hpp"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <optional>
#include <random>
#include <utility>

#include "engine/ring/directory.hpp"
#include "engine/ring/writer.hpp"
#include "play/playback_clock.hpp"
#include "versavis/ring_path.hpp"

namespace versavis::client {

namespace {

/// Readers consider a writer dead after 3 s; a slow disk must not look like that.
constexpr Duration heartbeat_interval = milliseconds(250);

/// The service's default for cameras, and enough for documents. If lower, slow readers lose frames
/// sooner; if higher, it takes more memory.
constexpr std::uint32_t slots = 17;
constexpr std::uint32_t descriptors_with_slots = 64;

/// As the service's own: IMU at 1 kHz for 8 s; evidence and clock for minutes.
constexpr std::uint32_t descriptors_of_samples = 8192;
constexpr std::uint32_t descriptors_of_evidence = 65536;

struct Extent {
    ring::StreamKind kind{};
    std::uint32_t payload = 0;
};

bool has_stamp(ring::StreamKind kind) {
    return kind == ring::StreamKind::frames || kind == ring::StreamKind::imu;
}

/// What is played. Frames and samples set the pace: inputs of pairing and clock may be from minutes
/// before them. Without frames and samples, all items set it.
struct Span {
    std::map<std::string, Extent> streams;
    bool stamped = false;  ///< there are frames or samples
    std::optional<OutputTime> first;
    OutputTime last;

    bool paced_by(ring::StreamKind kind) const { return !stamped || has_stamp(kind); }
};

/// Looks once through the file: a ring cannot grow.
Expected<Span> measure(const Recording& recording, const std::vector<std::string>& streams) {
    Span span;
    auto read = recording.glance(streams, [&](const RecordedItem& item) {
        Extent& extent = span.streams[item.stream];
        extent.kind = item.kind;
        extent.payload = std::max(extent.payload, item.length);
        if (item.kind == ring::StreamKind::frames) {
            const auto frame = unpack<FrameMetadata>(item.metadata);
            const auto pixels = std::uint64_t{frame.stride} * frame.height;
            if (pixels <= 0xFFFFFFFFU)
                extent.payload = std::max(extent.payload, static_cast<std::uint32_t>(pixels));
        }
        if (has_stamp(item.kind) && !std::exchange(span.stamped, true)) span.first.reset();
        if (!span.paced_by(item.kind)) return true;
        if (!span.first) span.first = item.time;
        span.last = item.time;
        return true;
    });
    if (!read) return Unexpected(read.error());
    for (const auto& name : streams)
        if (span.streams.count(name) == 0)
            return failure(name, "has no items in the recording", "see 'versavis info'");
    if (!span.first) return failure("the recording", "has no items");
    return span;
}

ring::Shape shape_of(const std::string& name, const Extent& extent, std::uint64_t life) {
    ring::Shape shape;
    shape.name = name;
    shape.kind = extent.kind;
    shape.life = life;
    const bool lasting =
        extent.kind == ring::StreamKind::evidence || extent.kind == ring::StreamKind::clock;
    shape.descriptor_count = lasting ? descriptors_of_evidence : descriptors_of_samples;
    if (extent.payload == 0) return shape;
    shape.descriptor_count = descriptors_with_slots;
    shape.slot_count = slots;
    shape.slot_size = extent.payload;
    return shape;
}

std::uint64_t random_life() {
    std::random_device random;
    return std::max<std::uint64_t>(1, std::uint64_t{random()} << 32U | random());
}

class Player {
 public:
    Player(const Recording& recording, const PlaySettings& settings, Span span,
           ring::OwnedDirectory directory)
        : recording_(recording),
          settings_(settings),
          span_(std::move(span)),
          directory_(std::move(directory)) {}

    Expected<PlayReport> run() {
        do {
            if (auto begun = begin_round(); !begun) return Unexpected(begun.error());
            if (auto played = play_round(); !played) return Unexpected(played.error());
            ++report_.rounds;
        } while (settings_.loop && !stopped());
        return report_;
    }

 private:
    bool stopped() const { return settings_.stop && settings_.stop(); }

    /// New rings take the names of the old ones, whose readers see a restart.
    Expected<> begin_round() {
        const std::uint64_t life = random_life();
        for (const auto& [name, extent] : span_.streams) {
            auto writer = ring::Writer::create(directory_.path(), shape_of(name, extent, life));
            if (!writer) return Unexpected(writer.error());
            writers_.insert_or_assign(name, std::move(*writer));
        }
        directory_.remove_stale({});
        newest_ = *span_.first;
        return {};
    }

    Expected<> play_round() {
        PlaybackClock clock(settings_.rate);
        return recording_.for_each(settings_.streams, [&](const RecordedItem& item) {
            const HostTime now = host_now();
            const bool paces = span_.paced_by(item.kind);
            const HostTime due =
                paces ? clock.due(item.time, now) : clock.due_beside(item.time, now);
            if (paces) newest_ = std::max(newest_, item.time);
            if (!wait_until(due)) return false;
            if (due < now) report_.latest = std::max(report_.latest, now - due);
            publish(item);
            return true;
        });
    }

    /// False: stopped.
    bool wait_until(HostTime due) {
        for (;;) {
            if (stopped()) return false;
            const HostTime now = host_now();
            if (now - beaten_ >= heartbeat_interval) beat(now);
            if (now >= due) return true;
            const Duration rest = std::min(due - now, heartbeat_interval);
            const timespec interval{rest.ns / 1'000'000'000, rest.ns % 1'000'000'000};
            nanosleep(&interval, nullptr);  // a signal ends it early
        }
    }

    void beat(HostTime now) {
        beaten_ = now;
        for (auto& [name, writer] : writers_) writer.heartbeat(now);
        if (settings_.progress)
            settings_.progress(static_cast<double>((newest_ - *span_.first).ns) / 1e9,
                               static_cast<double>((span_.last - *span_.first).ns) / 1e9);
    }

    void publish(const RecordedItem& item) {
        ring::Writer& writer = writers_.at(item.stream);
        if (item.payload.empty()) {
            const bool missing = item.kind == ring::StreamKind::frames;
            if (missing) ++report_.without_pixels;
            if (missing) return;
            writer.publish(item.time, item.metadata);
            ++report_.items;
            return;
        }
        const auto slot =
            item.payload.size() <= writer.slot_size() ? writer.acquire() : std::nullopt;
        if (!slot) {
            ++report_.without_pixels;
            return;
        }
        std::memcpy(writer.slot_data(*slot), item.payload.data(), item.payload.size());
        writer.publish(*slot, static_cast<std::uint32_t>(item.payload.size()), item.time,
                       item.metadata, item.attributes);
        ++report_.items;
    }

    const Recording& recording_;
    const PlaySettings& settings_;
    const Span span_;
    ring::OwnedDirectory directory_;
    std::map<std::string, ring::Writer> writers_;
    HostTime beaten_;
    OutputTime newest_;  ///< of those that set the pace
    PlayReport report_;
};

}  // namespace

Expected<PlayReport> play(const Recording& recording, const PlaySettings& settings) {
    for (const auto& name : settings.streams) {
        const auto& all = recording.streams();
        if (std::none_of(all.begin(), all.end(), [&](const auto& one) { return one.name == name; }))
            return failure(name, "is not in the recording", "see 'versavis info'");
    }
    auto span = measure(recording, settings.streams);
    if (!span) return Unexpected(span.error());
    auto directory = ring::OwnedDirectory::claim(instance_directory(settings.instance));
    if (!directory) return Unexpected(directory.error());
    return Player(recording, settings, std::move(*span), std::move(*directory)).run();
}

}  // namespace versavis::client
