// SPDX-License-Identifier: BSD-3-Clause
#include "gnss/gnss_match.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "evaluate/recorded_imu.hpp"
#include "versavis/metadata.hpp"

namespace versavis::client {

namespace {

constexpr std::int64_t second_ns = 1'000'000'000;
constexpr std::int64_t gps_begin_s = 315'964'800;  ///< 1980-01-06 in seconds since 1970

using Run = std::pair<std::uint64_t, std::uint32_t>;  ///< life and epoch

struct Frames {
    std::vector<MarkedFrame> frames;
    std::vector<MarkableFrame> markable;
};

struct Recorded {
    std::map<Run, Frames> frames;
    std::map<Run, std::vector<ClockRelation>> labels;
    std::uint64_t suspect = 0;
};

Expected<Recorded> read_recording(const Recording& recording, const std::string& camera) {
    Recorded recorded;
    const auto take = [&](const RecordedItem& item) {
        if (item.kind == ring::StreamKind::events) {
            const auto event = unpack<EventMetadata>(item.metadata);
            if (event.kind == EventKind::utc_label && (event.flags & flag_suspect) == 0)
                recorded.labels[{item.life, event.epoch}].push_back(
                    {item.time, Duration{event.value * second_ns - item.time.ns}});
        } else if (item.stream == camera) {
            const auto frame = unpack<FrameMetadata>(item.metadata);
            if ((frame.flags & flag_suspect) != 0 || frame.trigger == 0) {
                ++recorded.suspect;
                return true;
            }
            recorded.frames[{item.life, frame.epoch}].frames.push_back(
                {item.time, item.number, item.life, frame.trigger, {}});
        }
        return true;
    };
    std::vector<std::string> streams{camera};
    for (const RecordedStream& stream : recording.streams())
        if (stream.kind == ring::StreamKind::events) streams.push_back(stream.name);
    if (auto read = recording.glance(streams, take); !read) return Unexpected(read.error());
    for (auto& [run, its] : recorded.frames) {
        std::sort(its.frames.begin(), its.frames.end(),
                  [](const auto& a, const auto& b) { return a.time < b.time; });
        for (const MarkedFrame& frame : its.frames)
            its.markable.push_back({frame.time, frame.trigger});
    }
    for (auto& [run, labels] : recorded.labels)
        std::sort(labels.begin(), labels.end(),
                  [](const auto& a, const auto& b) { return a.at < b.at; });
    return recorded;
}

/// Since 1970 in UTC; in the receiver's own time without a known beginning.
Duration as_utc(const TimeMark& mark, int leap_seconds) {
    switch (mark.base) {
        case TimeBase::receiver: return {mark.time_ns};
        case TimeBase::gnss: return {mark.time_ns + (gps_begin_s - leap_seconds) * second_ns};
        case TimeBase::utc: return {mark.time_ns + gps_begin_s * second_ns};
    }
    return {};
}

/// Those that can be compared, in order.
std::vector<TimeMark> usable(const UbxMarks& found, const GnssMatchSettings& settings,
                             GnssMatchReport& report) {
    std::vector<TimeMark> marks;
    std::map<TimeBase, std::size_t> bases;
    std::optional<std::uint16_t> last_count;
    for (const TimeMark& mark : found.marks) {
        if (mark.channel != settings.channel) continue;
        if (last_count && settings.edge == MarkEdge::rising)
            report.missed += static_cast<std::uint16_t>(mark.count - *last_count - 1);
        last_count = mark.count;
        if (!mark.valid) {
            ++report.invalid;
            continue;
        }
        ++bases[mark.base];
        marks.push_back(mark);
    }
    const auto more = [](const auto& a, const auto& b) { return a.second < b.second; };
    if (bases.empty()) return marks;
    report.base = std::max_element(bases.begin(), bases.end(), more)->first;
    const auto other = [&](const TimeMark& mark) { return mark.base != report.base; };
    const auto kept = std::remove_if(marks.begin(), marks.end(), other);
    report.invalid += static_cast<std::uint64_t>(marks.end() - kept);
    marks.erase(kept, marks.end());
    std::sort(marks.begin(), marks.end(),
              [](const auto& a, const auto& b) { return a.time_ns < b.time_ns; });
    return marks;
}

void measure(const std::vector<Duration>& offsets, GnssSequence& sequence) {
    // From the first on: doubles hold no ns since 1970.
    double sum = 0;
    double squares = 0;
    for (const Duration offset : offsets) {
        const auto from_first = static_cast<double>((offset - offsets.front()).ns);
        sum += from_first;
        squares += from_first * from_first;
    }
    const auto count = static_cast<double>(offsets.size());
    const double mean = sum / count;
    sequence.offset = offsets.front() + Duration{std::llround(mean)};
    sequence.spread = {std::llround(std::sqrt(std::max(squares / count - mean * mean, 0.0)))};
}

std::string_view name_of(TimeBase base) {
    switch (base) {
        case TimeBase::receiver: return "receiver";
        case TimeBase::gnss: return "gnss";
        case TimeBase::utc: return "utc";
    }
    return "unknown";
}

}  // namespace

Expected<GnssMatchReport> match_gnss(const Recording& recording, const UbxMarks& marks,
                                     const GnssMatchSettings& settings) {
    GnssMatchReport report;
    const auto camera = find_stream(recording, ring::StreamKind::frames, settings.camera);
    if (!camera) return Unexpected(camera.error());
    report.camera = *camera;
    auto recorded = read_recording(recording, *camera);
    if (!recorded) return Unexpected(recorded.error());
    report.suspect = recorded->suspect;
    report.damaged = marks.damaged;
    const auto usable_marks = usable(marks, settings, report);
    report.marks = usable_marks.size();
    std::vector<Duration> times;
    times.reserve(usable_marks.size());
    for (const TimeMark& mark : usable_marks)
        times.push_back(as_utc(mark, settings.leap_seconds.value_or(0)));
    const bool is_utc = report.base == TimeBase::utc ||
                        (report.base == TimeBase::gnss && settings.leap_seconds.has_value());
    for (auto& [run, its] : recorded->frames) {
        GnssSequence sequence{run.first, run.second, its.frames.size()};
        const auto& labels = recorded->labels[run];
        const auto match = match_marks(
            its.markable, times,
            is_utc ? std::span<const ClockRelation>(labels) : std::span<const ClockRelation>());
        if (match) {
            sequence.match = *match;
            std::vector<Duration> offsets;
            for (const MatchedMark& pair : match->pairs) {
                MarkedFrame frame = its.frames[pair.frame];
                frame.mark = usable_marks[pair.mark];
                offsets.push_back(times[pair.mark] - Duration{frame.time.ns});
                report.frames.push_back(frame);
            }
            measure(offsets, sequence);
        } else {
            sequence.failure = match.error().message();
            // Another system's time fits at a wrong second just as well.
            if (!labels.empty() && !is_utc)
                sequence.failure +=
                    "; or set the receiver's time base to UTC, or say its seconds ahead of UTC "
                    "with "
                    "--leap-seconds (GPS, Galileo: 18)";
        }
        report.sequences.push_back(std::move(sequence));
    }
    return report;
}

std::string to_text(const GnssMatchReport& report) {
    std::string text = fmt::format("{}: {} marks", report.camera, report.marks);
    const auto add = [&](std::uint64_t count, const char* what) {
        if (count > 0) text += fmt::format(", {} {}", count, what);
    };
    add(report.invalid, "without a valid time");
    add(report.missed, "edges counted without a mark");
    add(report.damaged, "messages damaged");
    add(report.suspect, "frames without a proved trigger left out");
    text += '\n';
    for (const GnssSequence& sequence : report.sequences) {
        if (sequence.match.proof == MatchProof::none) {
            text += fmt::format("  epoch {}: {} frames, none matched: {}\n", sequence.epoch,
                                sequence.frames, sequence.failure);
            continue;
        }
        text += fmt::format(
            "  epoch {}: {} of {} frames have a mark, by {}; mark less stamp {:.6f} s, varies by "
            "{:.3f} us\n",
            sequence.epoch, sequence.match.pairs.size(), sequence.frames,
            sequence.match.proof == MatchProof::labels ? "the seconds that the receiver named"
                                                       : "the pattern of their gaps",
            static_cast<double>(sequence.offset.ns) / 1e9,
            static_cast<double>(sequence.spread.ns) / 1e3);
    }
    return text;
}

nlohmann::ordered_json to_json(const GnssMatchReport& report) {
    nlohmann::ordered_json sequences = nlohmann::ordered_json::array();
    for (const GnssSequence& sequence : report.sequences) {
        const bool matched = sequence.match.proof != MatchProof::none;
        nlohmann::ordered_json line{{"life", fmt::format("{:016x}", sequence.life)},
                                    {"epoch", sequence.epoch},
                                    {"frames", sequence.frames},
                                    {"matched", sequence.match.pairs.size()},
                                    {"proof", to_string(sequence.match.proof)}};
        line["offset_ns"] = matched ? nlohmann::ordered_json(sequence.offset.ns) : nullptr;
        line["spread_ns"] = matched ? nlohmann::ordered_json(sequence.spread.ns) : nullptr;
        line["failure"] = matched ? nullptr : nlohmann::ordered_json(sequence.failure);
        sequences.push_back(std::move(line));
    }
    return {{"camera", report.camera},
            {"marks", report.marks},
            {"time_base", name_of(report.base)},
            {"marks_invalid", report.invalid},
            {"edges_missed", report.missed},
            {"messages_damaged", report.damaged},
            {"frames_suspect", report.suspect},
            {"matched", report.frames.size()},
            {"sequences", sequences}};
}

std::string to_csv(const GnssMatchReport& report) {
    std::string text = "time_ns,number,life,trigger,week,time_of_week_ns,accuracy_ns\n";
    for (const MarkedFrame& frame : report.frames)
        text += fmt::format("{},{},{:016x},{},{},{},{}\n", frame.time.ns, frame.number, frame.life,
                            frame.trigger, frame.mark.time_ns / gps_week_ns,
                            frame.mark.time_ns % gps_week_ns, frame.mark.accuracy_ns);
    return text;
}

}  // namespace versavis::client
