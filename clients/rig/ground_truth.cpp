// SPDX-License-Identifier: BSD-3-Clause
#include "ground_truth.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdio>

#include "posix/file.hpp"

namespace versavis::rig {

namespace {

std::string tones_json(const std::vector<Tone>& tones) {
    std::string list;
    for (const Tone& tone : tones)
        list += fmt::format("{}[{:.17g},{:.17g},{:.17g}]", list.empty() ? "" : ",", tone.hz,
                            tone.amplitude, tone.phase_rad);
    return "[" + list + "]";
}

}  // namespace

Expected<std::unique_ptr<GroundTruth>> GroundTruth::create(const std::string& path) {
    auto truth = std::make_unique<GroundTruth>();
    if (path.empty()) return truth;
    truth->path_ = path;
    truth->file_ =
        FileDescriptor(::open(path.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0644));
    if (!truth->file_) return not_written(path);
    return truth;
}

void GroundTruth::add(const TrueTrigger& t) {
    write(fmt::format(
        R"({{"type":"trigger","camera":"{}","board_life":{},"trigger":{},"at_ns":{},"taken":{}}})",
        t.camera, t.board_life, t.trigger, t.at.ns, t.taken));
}

void GroundTruth::add(const TrueExposure& e) {
    write(fmt::format(
        R"({{"type":"exposure","camera":"{}","board_life":{},"trigger":{},"serial":{},)"
        R"("block_id":{},"start_ns":{},"end_ns":{},"sent":{}}})",
        e.camera, e.board_life, e.trigger, e.serial, e.block_id, e.start.ns, e.end.ns, e.sent));
}

void GroundTruth::add(const TrueDeparture& d) {
    write(fmt::format(R"({{"type":"departure","camera":"{}","serial":{},"at_ns":{}}})", d.camera,
                      d.serial, d.at.ns));
}

void GroundTruth::add(const TrueImuSample& s) {
    write(fmt::format(R"({{"type":"imu","imu":"{}","board_life":{},"serial":{},"at_ns":{}}})",
                      s.imu, s.board_life, s.serial, s.at.ns));
}

void GroundTruth::add(const TruePulse& p) {
    write(fmt::format(R"({{"type":"pulse","output":"{}","start_ns":{},"end_ns":{}}})", p.output,
                      p.start.ns, p.end.ns));
}

void GroundTruth::add(const TrueSerial& s) {
    write(fmt::format(R"({{"type":"serial","at_ns":{},"baud":{},"hex":"{:02x}"}})", s.at.ns, s.baud,
                      fmt::join(s.bytes, "")));
}

void GroundTruth::add(const Motion& motion) {
    write(fmt::format(
        R"({{"type":"motion","zero_ns":{},"angles":[{},{},{}],"position":[{},{},{}]}})",
        motion.zero().ns, tones_json(motion.angles()[0]), tones_json(motion.angles()[1]),
        tones_json(motion.angles()[2]), tones_json(motion.position()[0]),
        tones_json(motion.position()[1]), tones_json(motion.position()[2])));
}

void GroundTruth::write(const std::string& line) {
    const std::lock_guard lock(mutex_);
    if (!file_) return;
    if (const auto written = write_all(file_, path_, line + '\n'); !written) {
        fmt::print(stderr, "{}\n", written.error().message());
        file_ = {};
    }
}

}  // namespace versavis::rig
