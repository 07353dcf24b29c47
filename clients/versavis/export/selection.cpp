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

constexpr OutputTime earliest{std::numeric_limits<std::int64_t>::min()};
constexpr OutputTime latest{std::numeric_limits<std::int64_t>::max()};

/// `cam2` before `cam10`.
bool by_name(const std::string& a, const std::string& b) {
    return a.size() != b.size() && a.find_first_of("0123456789") != std::string::npos &&
                   a.substr(0, a.find_first_of("0123456789")) ==
                       b.substr(0, b.find_first_of("0123456789"))
               ? a.size() < b.size()
               : a < b;
}

double rate(std::uint64_t items, Duration span) {
    return items < 2 || span.ns <= 0
               ? 0
               : static_cast<double>(items - 1) * 1e9 / static_cast<double>(span.ns);
}

/// One IMU on the way through the file.
struct ImuWay {
    std::optional<OutputTime> first;
    OutputTime last;

    SkipReason judge(OutputTime time, std::uint32_t flags, const ExportChoice& choice) const {
        if ((flags & (flag_suspect | flag_sensor_error)) != 0 && !choice.include_suspect)
            return SkipReason::suspect;
        if (first && time <= last) return SkipReason::not_later;
        const bool repeated = (flags & flag_repeated) != 0 && !choice.keep_repeated;
        if (repeated && first && time - last <= longest_without) return SkipReason::repeated;
        return SkipReason::no;
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
        OutputTime after = earliest;
        OutputTime before = latest;
        for (const ImuWay& way : ways_) {
            if (!way.first) continue;  // it had failed: its images are as good as without it
            after = std::max(after, *way.first);
            before = std::min(before, way.last);
        }
        take_sets(table, table.pair(after, before));
        list_left_out(table);
        if (selection_.frames.empty() && selection_.samples.empty())
            return failure(recording_name_, "has nothing to export",
                           "see 'versavis info', and --include-suspect");
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

    void take_frame(FrameSetTable& table, const RecordedItem& item) {
        const auto data = unpack<FrameMetadata>(item.metadata);
        const std::uint32_t index = cameras_.at(item.stream);
        SelectedCamera& camera = selection_.cameras[index];
        TableFrame frame{item.time, item.number, item.life, data.epoch, {}, item.place};
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
        else if (!choice_.include_suspect && data.stamp_kind() == StampKind::arrival)
            frame.left_out = SkipReason::arrival;
        else if (!choice_.include_suspect && (data.flags & (flag_suspect | flag_sensor_error)) != 0)
            frame.left_out = SkipReason::suspect;
        table.add(index, frame);
    }

    void take_sample(const RecordedItem& item) {
        const auto data = unpack<ImuMetadata>(item.metadata);
        const std::uint32_t index = imus_.at(item.stream);
        SelectedImu& imu = selection_.imus[index];
        ImuWay& way = ways_[index];
        const SkipReason reason = way.judge(item.time, data.flags, choice_);
        if (reason != SkipReason::no) {
            selection_.left_out.push_back(
                {static_cast<std::uint32_t>(selection_.cameras.size() + index), item.time,
                 item.number, 0, reason});
            return;
        }
        if (way.first) imu.longest_gap = std::max(imu.longest_gap, item.time - way.last);
        if (!way.first) way.first = item.time;
        way.last = item.time;
        ++imu.samples;
        imu.rate_hz = rate(imu.samples, way.last - *way.first);
        imu.filter_delay = data.filter_delay;
        if (std::abs(data.accel_age_ns) > std::abs(imu.accel_age_ns))
            imu.accel_age_ns = data.accel_age_ns;
        selection_.samples.push_back({index, item.time, item.place});
    }

    void take_sets(const FrameSetTable& table, const std::vector<FrameSet>& sets) {
        selection_.sets = sets.size();
        for (const FrameSet& set : sets)
            for (std::uint32_t camera = 0; camera < set.frames.size(); ++camera) {
                const TableFrame& frame = table.frames(camera)[set.frames[camera]];
                selection_.frames.push_back({camera, frame.time, set.name, frame.place});
            }
        for (auto& camera : selection_.cameras) {
            camera.frames = sets.size();
            if (!sets.empty()) camera.rate_hz = rate(sets.size(), sets.back().name - sets[0].name);
        }
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
