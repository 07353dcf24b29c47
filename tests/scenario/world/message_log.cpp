// SPDX-License-Identifier: BSD-3-Clause
#include "message_log.hpp"

#include <fmt/format.h>

#include <map>

namespace versavis::scenario {

namespace {

std::string time_text(std::int64_t at_ns) {
    return at_ns == wire::no_time ? "-" : fmt::format("{}", at_ns);
}

std::string line(const wire::Exposure& record) {
    return fmt::format("camera{} trigger={} tick={} flags={:#x} @ {} {} {}\n", record.camera,
                       record.trigger, record.tick, record.flags, record.trigger_ns,
                       time_text(record.start_ns), time_text(record.end_ns));
}

std::string line(const wire::Event& event) {
    return fmt::format("event{}.{} value={} detail={} @ {}\n", static_cast<unsigned>(event.kind),
                       event.source, event.value, event.detail, event.time_ns);
}

std::string line(const wire::ImuSample& sample) {
    return fmt::format(
        "imu{} flags={:#x} gyro={},{},{} accel={},{},{} magnetic={},{},{} temperature={} "
        "pressure={} @ {}\n",
        sample.imu, sample.flags, sample.gyro[0], sample.gyro[1], sample.gyro[2], sample.accel[0],
        sample.accel[1], sample.accel[2], sample.magnetic[0], sample.magnetic[1],
        sample.magnetic[2], sample.temperature, sample.pressure, sample.time_ns);
}

}  // namespace

std::string message_log(const Inbox& inbox) {
    std::string out;
    for (const auto& [camera, records] : inbox.exposures)
        for (const wire::Exposure& record : records) out += line(record);
    std::map<std::pair<wire::BoardEventKind, unsigned>, std::string> events;
    for (const wire::Event& event : inbox.events) events[{event.kind, event.source}] += line(event);
    for (const auto& [stream, lines] : events) out += lines;
    for (const auto& [port, samples] : inbox.samples)
        for (const wire::ImuSample& sample : samples) out += line(sample);
    return out;
}

}  // namespace versavis::scenario
