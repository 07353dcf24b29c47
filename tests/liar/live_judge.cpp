// SPDX-License-Identifier: BSD-3-Clause
#include "live_judge.hpp"
#include "../support/look.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "scene.hpp"

namespace versavis::liar {

namespace {

/// Beyond it, an error is no longer noise: one stamp in 5e8 of an honest normal distribution. At
/// half, honest stamps fail each minute; at twice, some lies pass for noise.
constexpr std::int64_t honest_sigmas = 6;

/// Items that may be missing from a stream that is whole: a loaded machine loses packets of its
/// own. At half a single lost frame in the time that is looked at fails it; at twice it hides an
/// outage of 40 ms.
constexpr double lost_tolerated = 0.01;

/// A camera that is not triggered for so long is not back. At half, the gaps of a start pattern at
/// 20 Hz look like that; at twice, one that starts slowly at 1 Hz may pass for one that runs.
constexpr Duration longest_gap = milliseconds(300);

/// The number after `"key":` of a JSON line; the rig writes 2000 of these each second.
std::int64_t number(const std::string& line, const char* key) {
    const std::size_t at = line.find(std::string("\"") + key + "\":");
    return at == std::string::npos
               ? 0
               : std::strtoll(line.c_str() + at + std::strlen(key) + 3, nullptr, 10);
}

bool has(const std::string& line, const std::string& text) {
    return line.find(text) != std::string::npos;
}

bool honest(Duration error, std::uint32_t sigma_ns, Duration floor) {
    return absolute(error) <= std::max(Duration{honest_sigmas * sigma_ns}, floor);
}

}  // namespace

Tally& Tally::operator+=(const Tally& more) {
    items += more.items;
    good += more.good;
    flagged += more.flagged;
    return *this;
}

LiveJudge::LiveJudge(JudgedSystem system, const Liar& liar)
    : system_(std::move(system)),
      liar_(liar),
      utc_(*clock::OutputClock::create(clock::OutputClockKind::realtime)),
      truth_file_(system_.truth_path),
      frames_(system_.scenario.cameras.size()),
      cameras_(system_.scenario.cameras.size()) {}

std::vector<Wrong> LiveJudge::poll() {
    const auto open = [&](const std::string& name, auto& stream) {
        using S = typename std::remove_reference_t<decltype(stream)>::value_type;
        if (!stream)
            if (auto opened = S::open(name, {{}, system_.instance}))
                stream.emplace(std::move(*opened));
        return stream.has_value();
    };
    const auto read_all = [](auto& stream, auto take_item) {
        for (auto item = test::look(stream.next());
             item.found != test::Found::nothing && item.found != test::Found::gone;
             item = test::look(stream.next()))
            if (item.found == test::Found::item) take_item(item);
    };
    for (unsigned i = 0; i < frames_.size(); ++i)
        if (open(system_.scenario.cameras[i].name, frames_[i]))
            read_all(*frames_[i], [&](const auto& item) { take(i, item); });
    const auto take_any = [&](const auto& item) { take(item); };
    if (open(system_.scenario.imu, imu_)) read_all(*imu_, take_any);
    if (open("events", events_)) read_all(*events_, take_any);
    return std::exchange(wrongs_, {});
}

void LiveJudge::read_truth() {
    truth_file_.clear();
    for (std::string part; std::getline(truth_file_, part);) {
        line_ += part;
        if (truth_file_.eof()) return;  // the rest of this line is still being written
        if (has(line_, R"("type":"imu")")) {
            const auto key = static_cast<std::uint64_t>(number(line_, "number"));
            samples_.truth[key] = {{number(line_, "at_ns")}, key};
        } else if (has(line_, R"("type":"exposure")") && has(line_, R"("sent":true)")) {
            for (unsigned i = 0; i < cameras_.size(); ++i)
                if (has(line_, "\"camera\":\"" + system_.scenario.cameras[i].name + "\""))
                    cameras_[i].truth[static_cast<std::uint64_t>(number(line_, "serial"))] = {
                        middle(HostTime{number(line_, "start_ns")},
                               HostTime{number(line_, "end_ns")}),
                        static_cast<std::uint64_t>(number(line_, "trigger"))};
        }
        line_.clear();
    }
}

/// True: stamp and order are right.
bool LiveJudge::compare(const std::string& name, Judged& judged, TrueItem& truth, OutputTime stamp,
                        std::uint32_t sigma_ns, std::uint32_t epoch, Wrong wrong) {
    const Duration error = OutputTime{truth.at.ns} - stamp;
    wrong.number = truth.number;
    const std::string of = fmt::format("{} {}", name, truth.number);
    const bool twice = truth.fate == Fate::good;
    const bool back = stamp < judged.last && epoch == judged.last_epoch;
    epoch_ = std::max(epoch_, epoch);
    if (!honest(error, sigma_ns, system_.floor)) {
        wrong.what = fmt::format("{}: stamp {:+.3f} ms off, sigma {} ns, epoch {}", of,
                                 static_cast<double>(-error.ns) * 1e-6, sigma_ns, epoch);
        wrongs_.push_back(wrong);
        return false;
    }
    judged.last = stamp;
    judged.last_epoch = epoch;
    if (twice || back) {
        wrong.is_stamp = false;
        wrong.what = of + (twice ? ": published twice" : ": earlier than the one before it");
        wrongs_.push_back(wrong);
        return false;
    }
    worst_ = std::max(worst_, absolute(error));
    return true;
}

bool LiveJudge::edges_are_honest(unsigned camera, Duration error, std::uint32_t sigma_ns) {
    if (camera != 0) clock_error_ = error;
    return camera != 0 || !edge_floor_ || honest(error - clock_error_, sigma_ns, *edge_floor_);
}

void LiveJudge::take(unsigned camera, const Frame& item) {
    const std::string& name = system_.scenario.cameras[camera].name;
    const std::uint64_t serial =
        rig::FrameMark::serial_in(item.payload.data(), item.payload.size());
    if (!item.valid()) return;  // this reader was too slow
    read_truth();               // it was written before this frame left
    const auto found = cameras_[camera].truth.find(serial);
    if (found == cameras_[camera].truth.end()) {
        wrongs_.push_back({camera, 0, false, name + ": not a frame of the rig"});
        return;
    }
    TrueItem& truth = found->second;
    Wrong wrong{camera, truth.number, true, ""};
    if ((item.data.flags & flag_suspect) != 0 || item.data.sigma_ns == sigma_unknown) {
        if (truth.fate == Fate::missing) truth.fate = Fate::flagged;
        return;
    }
    if (item.data.trigger != truth.number) {
        wrong.what =
            fmt::format("{} {}: trigger {}, stamp {:+.3f} ms off", name, truth.number,
                        item.data.trigger, static_cast<double>(item.time.ns - truth.at.ns) * 1e-6);
        wrongs_.push_back(wrong);
        return;
    }
    if (!compare(name, cameras_[camera], truth, item.time, item.data.sigma_ns, item.data.epoch,
                 wrong))
        return;
    if (!edges_are_honest(camera, OutputTime{truth.at.ns} - item.time, item.data.sigma_ns)) {
        wrong.what = fmt::format("{} {}: stamp more than {} us from those of the other cameras",
                                 name, truth.number, edge_floor_->ns / 1000);
        wrongs_.push_back(wrong);
        return;
    }
    const auto tick = liar_.true_tick(camera, truth.number);
    if (tick && item.data.tick() != *tick) {
        wrong.is_stamp = false;
        wrong.what = fmt::format("{} {}: tick {} instead of {}", name, truth.number,
                                 item.data.tick(), *tick);
        wrongs_.push_back(wrong);
        return;
    }
    truth.fate = Fate::good;
}

void LiveJudge::take(const ImuSample& item) {
    const std::uint32_t key =
        true_number(item.data.magnetic[0], item.data.magnetic[1], system_.magnetic_lsb);
    read_truth();  // it was written before this sample left
    const auto found = samples_.truth.find(key);
    if (found == samples_.truth.end()) return;  // of another kind, or the check of it failed
    TrueItem& truth = found->second;
    Wrong wrong{0, truth.number, true, ""};
    if ((item.data.flags & flag_suspect) != 0 || item.data.sigma_ns == sigma_unknown) {
        if (truth.fate == Fate::missing) truth.fate = Fate::flagged;
        return;
    }
    if (!compare(system_.scenario.imu, samples_, truth, item.time, item.data.sigma_ns,
                 item.data.epoch, wrong))
        return;
    if (item.data.number != truth.number) {
        wrong.is_stamp = false;
        wrong.what =
            fmt::format("{} {}: number {}", system_.scenario.imu, truth.number, item.data.number);
        wrongs_.push_back(wrong);
        return;
    }
    truth.fate = Fate::good;
}

/// The rig's receiver marks whole seconds of UTC.
void LiveJudge::take(const Event& item) {
    if (item.data.kind != EventKind::pps || (item.data.flags & flag_suspect) != 0 ||
        item.data.sigma_ns == sigma_unknown)
        return;
    constexpr std::int64_t second_ns = 1'000'000'000;
    const std::int64_t past =
        ((item.time.ns + utc_.offset().ns) % second_ns + second_ns) % second_ns;
    const std::int64_t off = past > second_ns / 2 ? past - second_ns : past;
    if (!honest({off}, item.data.sigma_ns, system_.floor))
        wrongs_.push_back(
            {0, 0, true,
             fmt::format("PPS {}: {:+.3f} ms from a whole second, sigma {} ns", item.data.value,
                         static_cast<double>(off) * 1e-6, item.data.sigma_ns)});
}

std::vector<const LiveJudge::Judged*> LiveJudge::all() const {
    std::vector<const Judged*> streams{&samples_};
    for (const Judged& camera : cameras_) streams.push_back(&camera);
    return streams;
}

Tally LiveJudge::tally(HostTime begin, HostTime end) const {
    Tally tally;
    for (const Judged* stream : all())
        for (auto it = stream->truth.rbegin(); it != stream->truth.rend(); ++it) {
            const TrueItem& item = it->second;
            if (item.at < begin) break;
            if (item.at >= end) continue;
            ++tally.items;
            tally.good += item.fate == Fate::good ? 1 : 0;
            tally.flagged += item.fate == Fate::flagged ? 1 : 0;
        }
    return tally;
}

std::optional<Duration> LiveJudge::recovery(HostTime begin, HostTime end) const {
    Duration longest;
    for (const Judged* stream : all()) {
        const auto last = std::find_if(stream->truth.rbegin(), stream->truth.rend(),
                                       [&](const auto& item) { return item.second.at < end; });
        if (last == stream->truth.rend() || end - last->second.at > longest_gap) return {};
        std::vector<const TrueItem*> items;  // newest first
        for (auto it = stream->truth.rbegin(); it != stream->truth.rend(); ++it) {
            if (it->second.at < begin) break;
            if (it->second.at < end) items.push_back(&it->second);
        }
        const auto tolerated =
            static_cast<std::size_t>(1 + lost_tolerated * static_cast<double>(items.size()));
        std::size_t missing = 0;
        const auto outage = std::find_if(items.begin(), items.end(), [&](const TrueItem* item) {
            return item->fate != Fate::good && ++missing > tolerated;
        });
        if (outage == items.begin() + static_cast<long>(tolerated)) return {};
        if (outage != items.end()) longest = std::max(longest, (*outage)->at - begin);
    }
    return longest;
}

}  // namespace versavis::liar
