// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/recorded_imu.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

namespace versavis::client {

namespace {

const char* name_of(ring::StreamKind kind) {
    return kind == ring::StreamKind::imu ? "IMU" : "camera";
}

struct Span {
    std::uint64_t samples = 0;
    OutputTime first;
};

using Spans = std::map<std::pair<std::uint64_t, std::uint32_t>, Span>;

Expected<Spans> spans_of(const Recording& recording, const std::string& name, const GoOn& go_on) {
    Spans spans;
    const auto read = recording.glance({name}, [&](const RecordedItem& item) {
        const auto sample = unpack<ImuMetadata>(item.metadata);
        Span& span = spans[{item.life, sample.epoch}];
        if (span.samples++ == 0) span.first = item.time;
        return go_on();
    });
    if (!read) return Unexpected(read.error());
    if (spans.empty()) return failure(name, "has no samples", "record it with the others");
    return spans;
}

}  // namespace

Expected<std::string> find_stream(const Recording& recording, ring::StreamKind kind,
                                  const std::string& name) {
    std::vector<std::string> names;
    for (const RecordedStream& stream : recording.streams())
        if (stream.kind == kind) names.push_back(stream.name);
    std::string all;
    for (const std::string& one : names) all += (all.empty() ? "" : ", ") + one;
    const std::string what = name_of(kind);
    if (names.empty()) return failure("recording", "has no " + what, "record one");
    if (!name.empty()) {
        if (std::find(names.begin(), names.end(), name) != names.end()) return name;
        return failure(name, "is no " + what + " of this recording", "it has " + all);
    }
    if (names.size() == 1) return names.front();
    return failure(
        "recording", fmt::format("has several: {}", all),
        fmt::format("choose one with --{}", kind == ring::StreamKind::imu ? "imu" : "camera"));
}

Expected<RecordedImu> read_imu(const Recording& recording, const std::string& name, double from_s,
                               double to_s, Repeated repeated, const GoOn& go_on) {
    const auto spans = spans_of(recording, name, go_on);
    if (!spans) return Unexpected(spans.error());
    const auto most = std::max_element(
        spans->begin(), spans->end(),
        [](const auto& a, const auto& b) { return a.second.samples < b.second.samples; });
    RecordedImu imu;
    imu.samples.name = name;
    imu.life = most->first.first;
    imu.epoch = most->first.second;
    const OutputTime from = most->second.first + Duration{static_cast<std::int64_t>(from_s * 1e9)};
    const OutputTime to = most->second.first + Duration{static_cast<std::int64_t>(to_s * 1e9)};
    bool stopped = false;
    const auto read = recording.glance({name}, [&](const RecordedItem& item) {
        const auto sample = unpack<ImuMetadata>(item.metadata);
        stopped = !go_on();
        if (item.life != imu.life || sample.epoch != imu.epoch) {
            ++imu.elsewhere;
            return !stopped;
        }
        if (item.time < from || (to_s > 0 && item.time > to)) return !stopped;
        const bool faulty = (sample.flags & flag_sensor_error) != 0;
        const bool repeats = (sample.flags & flag_repeated) != 0;
        imu.faulty += faulty ? 1U : 0U;
        imu.repeated += repeats ? 1U : 0U;
        const auto& times = imu.samples.times;
        if (faulty || (repeats && repeated == Repeated::left_out) ||
            (!times.empty() && item.time <= times.back()))
            return !stopped;
        imu.samples.times.push_back(item.time);
        for (std::size_t i = 0; i < 3; ++i) {
            imu.samples.gyro[i].push_back(sample.gyro[i]);
            imu.samples.accel[i].push_back(sample.accel[i]);
        }
        imu.filter_delay = sample.filter_delay;
        return !stopped;
    });
    if (!read) return Unexpected(read.error());
    if (stopped) return failure(name, "stopped before the end of the recording");
    if (imu.samples.times.empty())
        return failure(name, "has no samples in this part of the recording",
                       "check --from and --to");
    return imu;
}

}  // namespace versavis::client
