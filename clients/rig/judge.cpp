// SPDX-License-Identifier: BSD-3-Clause
#include "judge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "engine/clock/output_clock.hpp"
#include "sample_mark.hpp"
#include "scene.hpp"
#include "versavis/stream.hpp"

namespace versavis::rig {

namespace {

using nlohmann::json;

constexpr double lost_tolerated = 0.01;
constexpr Duration start_pattern_time = milliseconds(1500);  // its gaps would make a rate look low
constexpr double honest_sigmas = 6;
constexpr double honest_floor_ns =
    300e3;  // what a loaded machine may add to a stamp; far below the period of any exposure
constexpr std::int64_t in_flight_ns = 1'000'000'000;

/// One published stamp, converted back to host time, and the exposure or sample it claims to be of.
struct Published {
    std::uint64_t serial;  ///< from the pixels, or from the magnetic field
    std::uint64_t number;  ///< of the trigger or of the sample
    std::int64_t host_ns;
    std::uint32_t sigma_ns;
};

struct Recording {
    std::vector<Published> items;
    std::uint64_t missed =
        0;  ///< items that this reader was too slow for; not the fault of the service
};

/// The streams of the scenario, read side by side.
class Recorder {
 public:
    Recorder(const Scenario& scenario, const std::string& instance, clock::OutputClock clock)
        : instance_(instance), clock_(std::move(clock)) {
        for (const CameraScenario& camera : scenario.cameras) frames_[camera.name];
        imu_name_ = scenario.imu;
    }

    void poll() {
        for (auto& [name, stream] : frames_) {
            if (!open(name, stream)) continue;
            const std::string& camera = name;
            read_all(*stream, recordings_[camera],
                     [&](const Frame& frame) { take(camera, frame); });
        }
        if (!open(imu_name_, imu_)) return;
        read_all(*imu_, recordings_[imu_name_], [&](const ImuSample& sample) { take(sample); });
    }

    bool complete() const {
        return imu_ && recordings_.size() == frames_.size() + 1 &&
               std::none_of(recordings_.begin(), recordings_.end(),
                            [](auto& r) { return r.second.items.empty(); });
    }

    std::map<std::string, Recording>& recordings() { return recordings_; }

    std::string missing() const {
        std::string names;
        for (const auto& [name, stream] : frames_)
            if (recordings_.count(name) == 0) names += " " + name;
        if (recordings_.count(imu_name_) == 0) names += " " + imu_name_;
        return names;
    }

 private:
    template <class S>
    bool open(const std::string& name, std::optional<S>& stream) {
        if (stream) return true;
        if (auto opened = S::open(name, {{}, instance_})) stream.emplace(std::move(*opened));
        return stream.has_value();
    }

    std::int64_t to_host_ns(OutputTime time) { return time.ns - clock_.offset().ns; }

    template <class S, class Take>
    static void read_all(S& stream, Recording& recording, Take take_item) {
        for (;;) {
            const auto item = stream.next();
            if (item)
                take_item(*item);
            else if (item.error().why == Pause::lost)
                recording.missed += item.error().lost;
            else if (item.error().why != Pause::restarted)
                return;
        }
    }

    void take(const std::string& name, const Frame& item) {
        Recording& recording = recordings_[name];
        const std::uint64_t serial = FrameMark::serial_in(item.payload.data(), item.payload.size());
        if ((item.data.flags & flag_suspect) != 0)
            return;  // the service says itself that it may be wrong
        // The camera does not know how its scheduled actions are numbered.
        const bool by_ptp = item.data.stamp_kind() == StampKind::camera_ptp;
        if (!item.valid())
            ++recording.missed;
        else
            recording.items.push_back({serial, by_ptp ? 0 : item.data.trigger,
                                       to_host_ns(item.time.output()), item.data.sigma_ns});
    }

    void take(const ImuSample& item) {
        recordings_[imu_name_].items.push_back({SampleMark::serial_in(item.data.magnetic),
                                                item.data.number, to_host_ns(item.time.output()),
                                                item.data.sigma_ns});
    }

    std::string instance_;
    clock::OutputClock clock_;
    std::map<std::string, std::optional<FrameStream>> frames_;
    std::string imu_name_;
    std::optional<ImuStream> imu_;
    std::map<std::string, Recording> recordings_;
};

struct TrueFrame {
    std::uint64_t trigger;
    std::int64_t middle_ns;
    bool sent;
};

struct Truth {
    std::map<std::string, std::map<std::uint64_t, TrueFrame>> frames;  ///< by camera and serial
    std::map<std::uint64_t, std::int64_t> imu;                         ///< by serial
};

Expected<Truth> load_truth(const std::string& path) {
    std::ifstream file(path);
    if (!file)
        return failure(path, "the ground truth cannot be read", "name the rig's file with --truth");
    Truth truth;
    for (std::string line; std::getline(file, line);) {
        const json record = json::parse(line, nullptr, false);
        if (record.is_discarded()) continue;  // the last line may still be being written
        if (record["type"] == "exposure") {
            const std::int64_t start = record["start_ns"];
            const std::int64_t end = record["end_ns"];
            truth.frames[record["camera"]][record["serial"]] = {
                record["trigger"], start + (end - start) / 2, record["sent"]};
        } else if (record["type"] == "imu") {
            truth.imu.emplace(record["serial"].get<std::uint64_t>(),
                              record["at_ns"].get<std::int64_t>());
        }
    }
    return truth;
}

void summarise(std::vector<double>& errors, StreamVerdict& verdict) {
    if (errors.empty()) return;
    std::sort(errors.begin(), errors.end());
    const auto quantile = [&](double q) {
        return errors[static_cast<std::size_t>(q * (errors.size() - 1))];
    };
    verdict.error_p50_ns = quantile(0.5);
    verdict.error_p99_ns = quantile(0.99);
    verdict.error_max_ns = errors.back();
}

/// When the streams were recorded, in host time. The start pattern comes before and does not count
/// towards the rates.
struct Interval {
    std::int64_t begin_ns = 0;
    std::int64_t end_ns = 0;
};

void count(const Recording& recording, const Interval& interval, StreamVerdict& verdict) {
    std::int64_t first = 0;
    std::int64_t last = 0;
    for (const Published& item : recording.items) {
        if (item.host_ns < interval.begin_ns) continue;
        if (verdict.items++ == 0) first = item.host_ns;
        last = item.host_ns;
    }
    if (verdict.items > 1)
        verdict.rate_hz =
            static_cast<double>(verdict.items - 1) / static_cast<double>(last - first) * 1e9;
}

/// A stamp that is further off than it claims is as wrong as that of another exposure.
bool honest(const Published& item, double error_ns) {
    return error_ns <= std::max(honest_sigmas * item.sigma_ns, honest_floor_ns);
}

StreamVerdict judge_frames(const Recording& recording,
                           const std::map<std::uint64_t, TrueFrame>& truth,
                           const Interval& interval) {
    StreamVerdict verdict;
    count(recording, interval, verdict);
    std::vector<double> errors;
    std::set<std::uint64_t> seen;
    for (const Published& item : recording.items) {
        const auto found = truth.find(item.serial);
        const bool paired = found != truth.end() && found->second.trigger == item.number &&
                            seen.insert(item.serial).second;
        const double error =
            paired ? std::abs(static_cast<double>(item.host_ns - found->second.middle_ns)) : 0;
        if (!paired || !honest(item, error))
            ++verdict.wrong_pairs;
        else
            errors.push_back(error);
    }
    summarise(errors, verdict);
    if (seen.empty()) return verdict;
    for (auto it = truth.find(*seen.begin()); it != truth.end(); ++it)
        if (it->second.sent && it->second.middle_ns < interval.end_ns - in_flight_ns &&
            seen.count(it->first) == 0)
            ++verdict.lost;
    verdict.lost -= std::min(verdict.lost, recording.missed);
    return verdict;
}

StreamVerdict judge_imu(const Recording& recording, const Truth& truth, const Interval& interval) {
    StreamVerdict verdict;
    count(recording, interval, verdict);
    std::vector<double> errors;
    for (const Published& item : recording.items) {
        const auto found = truth.imu.find(item.serial);
        const double error = found == truth.imu.end()
                                 ? 1e18
                                 : std::abs(static_cast<double>(item.host_ns - found->second));
        if (honest(item, error))
            errors.push_back(error);
        else
            ++verdict.wrong_pairs;
    }
    summarise(errors, verdict);
    for (std::size_t i = 1; i < recording.items.size(); ++i)
        if (recording.items[i].number > recording.items[i - 1].number)
            verdict.lost += recording.items[i].number - recording.items[i - 1].number - 1;
    verdict.lost -= std::min(verdict.lost, recording.missed);
    return verdict;
}

/// Counters of the status document that only the service knows.
json read_status(const std::string& instance) {
    auto stream = StatusStream::open("status", {{}, instance});
    if (!stream) return {};
    const auto item = stream->latest();
    if (!item) return {};
    std::string text(item->payload.size(), '\0');
    if (!item->payload.copy_to(reinterpret_cast<std::byte*>(text.data()))) return {};
    return json::parse(text, nullptr, false);
}

std::uint64_t withheld(const json& status, const std::string& camera) {
    if (!status.is_object()) return 0;
    for (const json& entry : status.value("cameras", json::array()))
        if (entry.value("name", "") == camera)
            return entry.value("frames_without_trigger", std::uint64_t{0});
    return 0;
}

/// The clock of the service's stamps, from its status document.
Expected<clock::OutputClock> output_clock(const JudgeSettings& settings) {
    const HostTime deadline =
        host_now() + Duration{static_cast<std::int64_t>(settings.start_timeout_s * 1e9)};
    for (;;) {
        const json status = read_status(settings.instance);
        if (status.is_object() && status.contains("clock")) {
            using clock::OutputClockKind;
            for (const auto kind :
                 {OutputClockKind::realtime, OutputClockKind::tai, OutputClockKind::monotonic_raw})
                if (status["clock"]["output"] == clock::to_string(kind))
                    return clock::OutputClock::create(kind, true);
        }
        const bool stopped = settings.stop_requested && settings.stop_requested();
        if (stopped || host_now() > deadline)
            return failure(settings.instance, "publishes no status", "is versavisd running?");
        const timespec pause{0, 20'000'000};
        nanosleep(&pause, nullptr);
    }
}

/// Error: a stream did not start in time.
Expected<Interval> record(Recorder& recorder, const JudgeSettings& settings) {
    const HostTime begin = host_now();
    std::optional<HostTime> flowing;
    std::optional<HostTime> recording;
    HostTime next_report = begin + seconds(1);
    for (;;) {
        recorder.poll();
        const HostTime now = host_now();
        if (!flowing && recorder.complete()) flowing = now;
        if (!flowing && static_cast<double>((now - begin).ns) > settings.start_timeout_s * 1e9)
            return failure(settings.instance,
                           "these streams did not start in time:" + recorder.missing(),
                           "see 'versavis status' and the service's log");
        if (flowing && !recording && now - *flowing > start_pattern_time) recording = now;
        const bool over =
            recording && static_cast<double>((now - *recording).ns) * 1e-9 >= settings.seconds;
        const bool stopped = settings.stop_requested && settings.stop_requested();
        if (over || stopped) return Interval{recording.value_or(now).ns, now.ns};
        if (now >= next_report) {
            next_report = next_report + seconds(1);
            if (settings.on_second) settings.on_second();
        }
        const timespec pause{0, 5'000'000};
        nanosleep(&pause, nullptr);
    }
}

void complain(Verdict& verdict) {
    for (const auto& [name, stream] : verdict.streams) {
        if (stream.items == 0) verdict.complaints.push_back(name + ": nothing was published");
        if (stream.wrong_pairs != 0)
            verdict.complaints.push_back(
                fmt::format("{}: {} items carry a wrong stamp", name, stream.wrong_pairs));
        if (static_cast<double>(stream.lost) > lost_tolerated * static_cast<double>(stream.items))
            verdict.complaints.push_back(
                fmt::format("{}: {} of {} were lost", name, stream.lost, stream.items));
    }
    verdict.ok = verdict.complaints.empty();
}

}  // namespace

Expected<Verdict> judge(const Scenario& scenario, const JudgeSettings& settings) {
    auto clock = output_clock(settings);
    if (!clock) return Unexpected(clock.error());
    Recorder recorder(scenario, settings.instance, std::move(*clock));
    const auto interval = record(recorder, settings);
    if (!interval) return Unexpected(interval.error());
    auto truth = load_truth(settings.truth_path);
    if (!truth) return Unexpected(truth.error());
    Verdict verdict;
    verdict.seconds = static_cast<double>(interval->end_ns - interval->begin_ns) * 1e-9;
    const json status = read_status(settings.instance);
    for (const CameraScenario& camera : scenario.cameras) {
        StreamVerdict stream =
            judge_frames(recorder.recordings()[camera.name], truth->frames[camera.name], *interval);
        stream.unpaired = withheld(status, camera.name);
        verdict.streams[camera.name] = stream;
    }
    verdict.streams[scenario.imu] =
        judge_imu(recorder.recordings()[scenario.imu], *truth, *interval);
    complain(verdict);
    return verdict;
}

std::string to_json(const Verdict& verdict) {
    json streams = json::object();
    for (const auto& [name, s] : verdict.streams)
        streams[name] = {
            {"items", s.items},
            {"rate_hz", std::round(s.rate_hz * 1000) / 1000},
            {"lost", s.lost},
            {"unpaired", s.unpaired},
            {"wrong_pairs", s.wrong_pairs},
            {"stamp_error_ns",
             {{"p50", s.error_p50_ns}, {"p99", s.error_p99_ns}, {"max", s.error_max_ns}}}};
    const json document{{"ok", verdict.ok},
                        {"seconds", std::round(verdict.seconds * 100) / 100},
                        {"streams", streams}};
    return document.dump();
}

std::string to_table(const Verdict& verdict) {
    std::string out =
        fmt::format("{:<8} {:>8} {:>9} {:>6} {:>9} {:>12} {:>30}\n", "stream", "items", "rate/Hz",
                    "lost", "unpaired", "wrong pairs", "clock error p50/p99/max, us");
    for (const auto& [name, s] : verdict.streams)
        out += fmt::format("{:<8} {:>8} {:>9.3f} {:>6} {:>9} {:>12} {:>30}\n", name, s.items,
                           s.rate_hz, s.lost, s.unpaired, s.wrong_pairs,
                           fmt::format("{:.1f} / {:.1f} / {:.1f}", s.error_p50_ns / 1e3,
                                       s.error_p99_ns / 1e3, s.error_max_ns / 1e3));
    for (const std::string& complaint : verdict.complaints) out += complaint + "\n";
    return out + (verdict.ok ? fmt::format("ok: {:.1f} s, every stamp belongs to its item\n",
                                           verdict.seconds)
                             : std::string("FAILED\n"));
}

}  // namespace versavis::rig
