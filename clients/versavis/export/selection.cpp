// SPDX-License-Identifier: BSD-3-Clause
#include "export/selection.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>

namespace versavis::client {

namespace {

/// Samples that repeat are left out, but between two that are exported there are never more than 20
/// ms: a sensor that stands still and shows it exactly would have no samples at all. If lower, one
/// more of them is kept in ten at 1 kHz; if higher, integration has longer steps to bridge.
constexpr Duration longest_without = milliseconds(20);

/// Items between two looks at the clock of the progress line.
constexpr std::uint64_t progress_step = 4096;

/// Sigma of a stamp that is too large for odometry, unless the user says otherwise: at one radian a
/// second, images are off by a pixel with a fifth of it.
constexpr Duration usual_max_sigma = milliseconds(5);

/// `cam2` before `cam10`.
bool by_name(const std::string& a, const std::string& b) {
    return a.size() != b.size() && a.find_first_of("0123456789") != std::string::npos &&
                   a.substr(0, a.find_first_of("0123456789")) ==
                       b.substr(0, b.find_first_of("0123456789"))
               ? a.size() < b.size()
               : a < b;
}

/// Items of one stream, whose rate is counted within sequences.
struct RateCount {
    std::uint64_t periods = 0;
    Duration span;

    void add(std::uint64_t items, Duration length) {
        if (items < 2) return;
        periods += items - 1;
        span = span + length;
    }
    double hz() const {
        return span.ns <= 0 ? 0 : static_cast<double>(periods) * 1e9 / static_cast<double>(span.ns);
    }
};

/// A sample that is worth to be exported, wherever it belongs.
struct Candidate {
    TimedSample at;
    std::uint64_t number;
    ItemPlace place;
};

/// One IMU on the way through the file.
struct ImuWay {
    std::vector<Candidate> candidates;

    /// What its place behind those before says.
    SkipReason judge(const TimedSample& at, bool repeated, bool join) const {
        if (candidates.empty()) return SkipReason::no;
        const TimedSample& last = candidates.back().at;
        if (!join && !(at.continuity == last.continuity)) return SkipReason::no;
        if (at.time <= last.time) return SkipReason::not_later;
        return repeated && at.time - last.time <= longest_without ? SkipReason::repeated
                                                                  : SkipReason::no;
    }
};

class Selector {
 public:
    Selector(const Recording& recording, const ExportChoice& choice, const ExportWatch& watch)
        : recording_(recording), choice_(choice), watch_(watch) {}

    Expected<Selection> run() {
        if (auto chosen = choose_streams(); !chosen) return Unexpected(chosen.error());
        FrameSetTable table(selection_.cameras.size());
        ways_.resize(selection_.imus.size());
        if (auto read = read_all(table); !read) return Unexpected(read.error());
        const auto bounds =
            find_sequences(times_of_samples(), times_of_frames(table), choice_.join);
        for (const SequenceBounds& one : bounds) {
            selection_.sequences.emplace_back();
            selection_.sequences.back().bounds = one;
        }
        take_sets(table, table.pair(bounds));
        take_samples();
        drop_empty();
        describe_streams();
        list_left_out(table);
        if (selection_.sequences.empty())
            return failure(recording_name_, "has nothing to export" + most_left_out(),
                           "see 'versavis info', --max-sigma and --include-suspect");
        return std::move(selection_);
    }

 private:
    Expected<> choose_streams() {
        std::vector<std::string> names = choice_.streams;
        if (names.empty()) {
            for (const auto& stream : recording_.streams()) names.push_back(stream.name);
            std::sort(names.begin(), names.end(), by_name);
        }
        for (const auto& name : names) {
            const auto& all = recording_.streams();
            const auto found = std::find_if(all.begin(), all.end(),
                                            [&](const auto& one) { return one.name == name; });
            if (found == all.end())
                return failure(name, "is not in the recording", "see 'versavis info'");
            const auto kind = found->kind;
            if (kind == ring::StreamKind::frames)
                add(cameras_, selection_.cameras, name);
            else if (kind == ring::StreamKind::imu)
                add(imus_, selection_.imus, name);
            else if (!choice_.streams.empty())
                return failure(name, "is neither camera nor IMU", "use --to csv for it");
        }
        wanted_.clear();
        for (const auto& one : selection_.cameras) wanted_.push_back(one.name);
        for (const auto& one : selection_.imus) wanted_.push_back(one.name);
        if (wanted_.empty())
            return failure(recording_name_, "has neither cameras nor IMUs", "use --to csv for it");
        return {};
    }

    template <class T>
    void add(std::map<std::string, std::uint32_t>& index, std::vector<T>& list,
             const std::string& name) {
        if (!index.emplace(name, static_cast<std::uint32_t>(list.size())).second) return;
        T one;
        one.name = name;
        list.push_back(std::move(one));
    }

    Expected<> read_all(FrameSetTable& table) {
        std::uint64_t all = 0;
        for (const auto& stream : recording_.streams())
            if (cameras_.count(stream.name) + imus_.count(stream.name) > 0) all += stream.items;
        std::uint64_t done = 0;
        auto read = recording_.glance(wanted_, [&](const RecordedItem& item) {
            if (item.kind == ring::StreamKind::frames)
                take_frame(table, item);
            else
                take_sample(item);
            if (++done % progress_step == 0) watch_.show("stamps", done, all);
            return !watch_.stopped();
        });
        if (read && watch_.stopped()) return stopped_error();
        return read;
    }

    /// What the stamp itself says, best reason first.
    SkipReason judge(StampKind kind, std::uint32_t flags, std::uint32_t sigma_ns) const {
        if (!choice_.include_suspect) {
            if (kind == StampKind::arrival) return SkipReason::arrival;
            if ((flags & (flag_suspect | flag_sensor_error)) != 0) return SkipReason::suspect;
            if (kind == StampKind::trigger_edge) return SkipReason::edge;
            if ((flags & flag_holdover) != 0) return SkipReason::holdover;
        }
        if (choice_.include_suspect && !choice_.max_sigma) return SkipReason::no;
        return Duration{sigma_ns} > choice_.max_sigma.value_or(usual_max_sigma) ? SkipReason::sigma
                                                                                : SkipReason::no;
    }

    void take_frame(FrameSetTable& table, const RecordedItem& item) {
        const auto data = unpack<FrameMetadata>(item.metadata);
        const std::uint32_t index = cameras_.at(item.stream);
        SelectedCamera& camera = selection_.cameras[index];
        TableFrame frame{item.time, item.number, {item.life, data.epoch}, {}, item.place};
        if (data.trigger != 0) frame.tick = data.tick();
        if (camera.width == 0) {
            camera.width = data.width;
            camera.height = data.height;
            camera.pixel_format = data.pixel_format;
        }
        if (item.place.image == ItemPlace::no_image)
            frame.left_out = SkipReason::no_pixels;
        else if (data.width != camera.width || data.height != camera.height ||
                 data.pixel_format != camera.pixel_format)
            frame.left_out = SkipReason::another_size;
        else
            frame.left_out = judge(data.stamp_kind(), data.flags, data.sigma_ns);
        if (frame.left_out == SkipReason::no) note_stamp(camera, data.sigma_ns, data.flags);
        table.add(index, frame);
    }

    template <class Selected>
    void note_stamp(Selected& stream, std::uint32_t sigma_ns, std::uint32_t flags) {
        stream.largest_sigma_ns = std::max(stream.largest_sigma_ns, sigma_ns);
        if ((flags & flag_second_doubted) != 0) ++selection_.seconds_doubted;
    }

    void take_sample(const RecordedItem& item) {
        const auto data = unpack<ImuMetadata>(item.metadata);
        const std::uint32_t index = imus_.at(item.stream);
        const TimedSample at{item.time, {item.life, data.epoch}};
        const bool repeated = (data.flags & flag_repeated) != 0 && !choice_.keep_repeated;
        SkipReason reason = judge(StampKind::measured_middle, data.flags, data.sigma_ns);
        if (reason == SkipReason::no) reason = ways_[index].judge(at, repeated, choice_.join);
        if (reason != SkipReason::no) return leave_out(index, item.number, item.time, reason);
        SelectedImu& imu = selection_.imus[index];
        imu.filter_delay = data.filter_delay;
        if (std::abs(data.accel_age_ns) > std::abs(imu.accel_age_ns))
            imu.accel_age_ns = data.accel_age_ns;
        note_stamp(imu, data.sigma_ns, data.flags);
        ways_[index].candidates.push_back({at, item.number, item.place});
    }

    void leave_out(std::uint32_t imu, std::uint64_t number, OutputTime time, SkipReason reason) {
        selection_.left_out.push_back(
            {static_cast<std::uint32_t>(selection_.cameras.size() + imu), time, number, 0, reason});
    }

    std::vector<std::vector<TimedSample>> times_of_samples() const {
        std::vector<std::vector<TimedSample>> times;
        for (const ImuWay& way : ways_) {
            times.emplace_back();
            for (const Candidate& one : way.candidates) times.back().push_back(one.at);
        }
        return times;
    }

    std::vector<TimedSample> times_of_frames(const FrameSetTable& table) const {
        std::vector<TimedSample> times;
        for (std::size_t camera = 0; camera < selection_.cameras.size(); ++camera)
            for (const TableFrame& frame : table.frames(camera))
                times.push_back({frame.time, frame.continuity});
        return times;
    }

    void take_sets(const FrameSetTable& table, const std::vector<FrameSet>& sets) {
        for (const FrameSet& set : sets) {
            SelectedSequence& sequence = selection_.sequences[set.sequence];
            ++sequence.sets;
            for (std::uint32_t camera = 0; camera < set.frames.size(); ++camera) {
                const TableFrame& frame = table.frames(camera)[set.frames[camera]];
                sequence.frames.push_back({camera, frame.time, set.name, frame.place});
                widen(sequence, frame.time);
            }
        }
    }

    void take_samples() {
        for (std::uint32_t imu = 0; imu < ways_.size(); ++imu)
            for (const Candidate& one : ways_[imu].candidates) {
                const auto sequence = std::find_if(
                    selection_.sequences.begin(), selection_.sequences.end(), [&](const auto& s) {
                        return s.bounds.fits(one.at.continuity) && s.bounds.first <= one.at.time &&
                               one.at.time <= s.bounds.last;
                    });
                if (sequence == selection_.sequences.end()) {
                    leave_out(imu, one.number, one.at.time, SkipReason::brief);
                    continue;
                }
                sequence->samples.push_back({imu, one.at.time, one.place, one.number});
                widen(*sequence, one.at.time);
            }
    }

    static void widen(SelectedSequence& sequence, OutputTime time) {
        sequence.first = std::min(sequence.first, time);
        sequence.last = std::max(sequence.last, time);
    }

    /// Those without images are of use only where there are no images at all.
    void drop_empty() {
        auto& all = selection_.sequences;
        const bool images = std::any_of(all.begin(), all.end(),
                                        [](const SelectedSequence& one) { return one.sets > 0; });
        const auto kept =
            std::stable_partition(all.begin(), all.end(), [&](const SelectedSequence& one) {
                return images ? one.sets > 0 : !one.samples.empty();
            });
        for (auto one = kept; one != all.end(); ++one)
            for (const SelectedSample& sample : one->samples)
                leave_out(sample.imu, sample.number, sample.time, SkipReason::brief);
        all.erase(kept, all.end());
    }

    void describe_streams() {
        std::vector<RateCount> rates(ways_.size());
        RateCount sets;
        for (const SelectedSequence& sequence : selection_.sequences) {
            selection_.sets += sequence.sets;
            if (sequence.sets > 0)
                sets.add(sequence.sets, sequence.frames.back().name - sequence.frames[0].name);
            std::vector<std::vector<OutputTime>> times(ways_.size());
            for (const SelectedSample& sample : sequence.samples)
                times[sample.imu].push_back(sample.time);
            for (std::size_t imu = 0; imu < times.size(); ++imu)
                describe(selection_.imus[imu], times[imu], rates[imu]);
        }
        for (std::size_t imu = 0; imu < rates.size(); ++imu)
            selection_.imus[imu].rate_hz = rates[imu].hz();
        for (auto& camera : selection_.cameras) {
            camera.frames = selection_.sets;
            camera.rate_hz = sets.hz();
        }
    }

    static void describe(SelectedImu& imu, const std::vector<OutputTime>& times, RateCount& rate) {
        if (times.empty()) return;
        imu.samples += times.size();
        rate.add(times.size(), times.back() - times.front());
        for (std::size_t i = 1; i < times.size(); ++i)
            imu.longest_gap = std::max(imu.longest_gap, times[i] - times[i - 1]);
    }

    /// The reason of most.
    std::string most_left_out() const {
        std::map<SkipReason, std::uint64_t> counts;
        for (const LeftOutItem& one : selection_.left_out) ++counts[one.reason];
        const auto most =
            std::max_element(counts.begin(), counts.end(),
                             [](const auto& a, const auto& b) { return a.second < b.second; });
        return most == counts.end() ? ""
                                    : fmt::format(": {} items are left out as '{}'", most->second,
                                                  to_string(most->first));
    }

    void list_left_out(const FrameSetTable& table) {
        for (std::uint32_t camera = 0; camera < selection_.cameras.size(); ++camera)
            for (const TableFrame& frame : table.frames(camera))
                if (frame.left_out != SkipReason::no)
                    selection_.left_out.push_back(
                        {camera, frame.time, frame.number, frame.tick.value_or(0), frame.left_out});
        std::stable_sort(selection_.left_out.begin(), selection_.left_out.end(),
                         [](const auto& a, const auto& b) { return a.time < b.time; });
    }

    const Recording& recording_;
    const ExportChoice& choice_;
    const ExportWatch& watch_;
    const std::string recording_name_ = "the recording";
    Selection selection_;
    std::map<std::string, std::uint32_t> cameras_;
    std::map<std::string, std::uint32_t> imus_;
    std::vector<std::string> wanted_;
    std::vector<ImuWay> ways_;
};

}  // namespace

Unexpected<Error> stopped_error() { return failure({}, "stopped", "run it again"); }

Expected<Selection> select_items(const Recording& recording, const ExportChoice& choice,
                                 const ExportWatch& watch) {
    return Selector(recording, choice, watch).run();
}

}  // namespace versavis::client
