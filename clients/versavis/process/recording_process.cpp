// SPDX-License-Identifier: BSD-3-Clause
#include "process/recording_process.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>

#include "base/shallow_json.hpp"
#include "process/frame_proof.hpp"
#include "process/mcap_copy.hpp"
#include "process/restamping.hpp"
#include "recording/item_fields.hpp"
#include "recording/recording.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

// Stamps that are off the link's by more were made by PPS, which is better than messages are.
constexpr double pps_differs_ns = 2000;

constexpr std::uint32_t no_proof = UINT32_MAX;

/// One item that gets another stamp.
struct Change {
    OutputTime before;
    OutputTime after;
    HostTime host;
    std::uint32_t sigma_ns = 0;
    std::uint32_t flags = 0;
    std::uint32_t proof = no_proof;  ///< of a frame that was suspect
    bool restamped = true;           ///< false: it stays, unless it must be held
};

struct Stream {
    ring::StreamKind kind = ring::StreamKind::frames;
    std::vector<Change> changes;  ///< by `before`
    std::vector<ProvedFrame> proofs;
    ProcessedStream counts;
    std::uint64_t life = 0;
    std::uint32_t epoch = 0;
    std::optional<OutputTime> newest;  ///< of this epoch, suspects aside
};

std::uint32_t sigma_of(Duration clock, Duration other) {
    const double sigma = std::hypot(static_cast<double>(clock.ns), static_cast<double>(other.ns));
    return static_cast<std::uint32_t>(std::min<double>(sigma, sigma_unknown - 1));
}

/// What is uncertain about the middle besides the clock; an edge that was not seen lies anywhere.
Duration uncertain(const ProvedFrame& proof, HostTime middle) {
    const pairing::Exposure& exposure = proof.exposure;
    if (exposure.kind == StampKind::measured_middle) return exposure.delay_sigma;
    const Duration half = (exposure.end - exposure.start) / 2 + exposure.delay_sigma;
    return std::max(half, proof.arrival.arrived - middle);
}

/// How the link's asymmetry was subtracted live.
Duration asymmetry_of(const Recording& recording) {
    const Attachment* status = recording.attachment("status.json");
    if (status == nullptr) return {};
    const json document = parse_shallow_json(status->content);
    if (!document.is_object() || !document.contains("clock")) return {};
    const json& clock = document["clock"];
    if (!clock.is_object() || clock.value("asymmetry_source", json()) == json("none")) return {};
    const json value = clock.value("asymmetry_ns", json());
    return {value.is_number() ? value.get<std::int64_t>() : std::int64_t{0}};
}

class Processing {
 public:
    Processing(const Recording& recording, const RecordedClocks& clocks, ProcessReport& report,
               const std::function<bool(double)>& go_on)
        : recording_(recording),
          report_(report),
          go_on_(go_on),
          restamping_(clocks, asymmetry_of(recording)) {}

    Expected<> plan() {
        auto done = pair_again();
        if (done) done = ask_whether_pps();
        if (done) done = restamp();
        if (!done) return done;
        for (auto& [name, stream] : streams_) finish(name, stream);
        return {};
    }

    std::optional<ChangedMessage> change(const McapChannel& channel,
                                         const McapMessage& message) const;

 private:
    Expected<> each(const std::vector<std::string>& names,
                    const std::function<void(const RecordedItem&)>& take) const {
        if (names.empty()) return {};
        bool stopped = false;
        auto read = recording_.glance(names, [&](const RecordedItem& item) {
            take(item);
            stopped = !go_on_(0);
            return !stopped;
        });
        if (read && stopped) return failure("recording", "stopped before the end of the recording");
        return read;
    }

    std::vector<std::string> names(std::initializer_list<ring::StreamKind> kinds) const {
        std::vector<std::string> found;
        for (const RecordedStream& stream : recording_.streams())
            if (std::find(kinds.begin(), kinds.end(), stream.kind) != kinds.end())
                found.push_back(stream.name);
        return found;
    }

    Expected<> pair_again() {
        for (const std::string& name : names({ring::StreamKind::evidence})) {
            const std::string camera = name.substr(0, name.rfind("-evidence"));
            FrameProof proof;
            auto done = each({name}, [&](const RecordedItem& item) {
                const auto evidence =
                    pairing::from_metadata(unpack<pairing::EvidenceMetadata>(item.metadata));
                if (evidence) proof.add(*evidence);
            });
            if (!done) return done;
            if (!proof.begun())
                report_.notes.push_back(camera +
                                        ": the beginning of its evidence is missing, so its frames "
                                        "were not paired again");
            auto& proofs = streams_[camera].proofs;
            proofs = proof.finish();
            std::stable_sort(proofs.begin(), proofs.end(), [](const auto& a, const auto& b) {
                return a.arrival.arrived < b.arrival.arrived;
            });
        }
        return {};
    }

    /// Live, PPS may have made the stamps; messages would make them worse.
    Expected<> ask_whether_pps() {
        std::vector<double> off;
        auto done =
            each(names({ring::StreamKind::imu, ring::StreamKind::frames}),
                 [&](const RecordedItem& item) {
                     const HostTime host = host_of(item);
                     const auto shown = restamping_.output(host);
                     if (shown && off.size() < 100'000)
                         off.push_back(std::abs(static_cast<double>((item.time - *shown).ns)));
                 });
        if (!done || off.empty()) return done;
        const auto middle = off.begin() + static_cast<std::ptrdiff_t>(off.size() / 2);
        std::nth_element(off.begin(), middle, off.end());
        by_pps_ = *middle > pps_differs_ns;
        if (by_pps_)
            report_.notes.emplace_back(
                "PPS made the stamps: the clock was not smoothed, since messages are less "
                "accurate");
        return {};
    }

    static HostTime host_of(const RecordedItem& item) {
        return item.kind == ring::StreamKind::imu ? unpack<ImuMetadata>(item.metadata).host_time
                                                  : unpack<FrameMetadata>(item.metadata).host_time;
    }

    Expected<> restamp() {
        return each(names({ring::StreamKind::imu, ring::StreamKind::frames}),
                    [this](const RecordedItem& item) {
                        Stream& stream = streams_[item.stream];
                        stream.kind = item.kind;
                        ++stream.counts.items;
                        if (item.kind == ring::StreamKind::imu)
                            restamp_sample(item, stream);
                        else
                            restamp_frame(item, stream);
                    });
    }

    /// Within an epoch each stamp is later than the previous one, as live: one that would not be is
    /// held just after it, and flagged.
    static void hold(Change change, std::uint64_t life, std::uint32_t epoch, Stream& stream) {
        if (life != stream.life || epoch != stream.epoch) stream.newest.reset();
        stream.life = life;
        stream.epoch = epoch;
        if (stream.newest && change.after <= *stream.newest) {
            const OutputTime held = *stream.newest + nanoseconds(1);
            change.flags |= flag_clamped;
            if (change.sigma_ns != sigma_unknown)
                change.sigma_ns = sigma_of({change.sigma_ns}, held - change.after);
            change.after = held;
        }
        stream.newest = change.after;
        const bool new_stamp = change.after != change.before || change.restamped;
        if (new_stamp) stream.changes.push_back(change);
    }

    void restamp_sample(const RecordedItem& item, Stream& stream) const {
        const auto sample = unpack<ImuMetadata>(item.metadata);
        if ((sample.flags & flag_suspect) != 0) return;
        Change change{item.time, item.time, sample.host_time, sample.sigma_ns, sample.flags,
                      no_proof,  false};
        const auto stamp = clock_of(sample.board_time - sample.filter_delay, sample.host_time);
        // Other uncertainties, such as the filter's delay, are not stored separately, so sigma
        // stays.
        if (stamp) set(change, *stamp);
        hold(change, item.life, sample.epoch, stream);
    }

    void restamp_frame(const RecordedItem& item, Stream& stream) const {
        const auto frame = unpack<FrameMetadata>(item.metadata);
        const bool suspect = (frame.flags & flag_suspect) != 0;
        stream.counts.suspect += suspect ? 1U : 0U;
        const std::uint32_t index = proof_of(frame, stream.proofs);
        const ProvedFrame* proof = index == no_proof ? nullptr : &stream.proofs[index];
        if (suspect) {
            if (proof != nullptr) prove(item, frame, index, stream);
            return;
        }
        Change change{item.time, item.time, frame.host_time, frame.sigma_ns, frame.flags,
                      no_proof,  false};
        const bool contradicted = proof != nullptr && proof->exposure.trigger != frame.trigger;
        stream.counts.contradicted += contradicted ? 1U : 0U;
        const bool by_board = frame.stamp_kind() != StampKind::arrival && !contradicted;
        const auto stamp = by_board ? clock_of(frame.board_time, frame.host_time) : std::nullopt;
        if (stamp) {
            set(change, *stamp);
            if (proof != nullptr)
                change.sigma_ns = std::min(change.sigma_ns,
                                           sigma_of(stamp->sigma, uncertain(*proof, stamp->host)));
        }
        hold(change, item.life, frame.epoch, stream);
    }

    std::optional<Restamping::Stamp> clock_of(BoardTime board, HostTime about) const {
        return by_pps_ ? std::nullopt : restamping_.stamp(board, about);
    }

    static void set(Change& change, const Restamping::Stamp& stamp) {
        change.after = stamp.output;
        change.host = stamp.host;
        change.flags &= ~static_cast<std::uint32_t>(flag_clamped | flag_holdover);
        change.restamped = true;
    }

    void prove(const RecordedItem& item, const FrameMetadata& frame, std::uint32_t index,
               Stream& stream) const {
        const ProvedFrame& proof = stream.proofs[index];
        const BoardTime board = middle(proof.exposure.start, proof.exposure.end);
        const auto stamp = restamping_.stamp(board, frame.arrival);
        if (!stamp) return;
        Change change{item.time, item.time, {}, 0, 0, index, true};
        set(change, *stamp);
        change.flags = (frame.flags & ~static_cast<std::uint32_t>(stamp_kind_mask | flag_suspect |
                                                                  flag_clamped | flag_holdover)) |
                       static_cast<std::uint32_t>(proof.exposure.kind);
        change.sigma_ns = sigma_of(stamp->sigma, uncertain(proof, stamp->host));
        hold(change, item.life, frame.epoch, stream);
        ++stream.counts.proved;
    }

    static std::uint32_t proof_of(const FrameMetadata& frame,
                                  const std::vector<ProvedFrame>& proofs) {
        auto found = std::lower_bound(
            proofs.begin(), proofs.end(), frame.arrival,
            [](const ProvedFrame& one, HostTime at) { return one.arrival.arrived < at; });
        for (; found != proofs.end() && found->arrival.arrived == frame.arrival; ++found)
            if (found->arrival.block_id == frame.block_id)
                return static_cast<std::uint32_t>(found - proofs.begin());
        return no_proof;
    }

    void finish(const std::string& name, Stream& stream) {
        ProcessedStream& counts = stream.counts;
        counts.restamped = stream.changes.size();
        std::uint64_t steady = 0;
        for (const Change& change : stream.changes) {
            counts.sigma_after_ns += change.sigma_ns;
            if (change.proof != no_proof) continue;
            const auto moved = static_cast<double>((change.after - change.before).ns);
            counts.change_rms_ns += moved * moved;
            counts.change_max_ns = std::max(counts.change_max_ns, std::abs(moved));
            ++steady;
        }
        if (steady > 0) counts.change_rms_ns = std::sqrt(counts.change_rms_ns / steady);
        if (counts.restamped > 0) counts.sigma_after_ns /= static_cast<double>(counts.restamped);
        std::stable_sort(stream.changes.begin(), stream.changes.end(),
                         [](const auto& a, const auto& b) { return a.before < b.before; });
        if (counts.items > 0) report_.streams[name] = counts;
    }

    const Change* change_of(const std::string& name, OutputTime before) const {
        const auto stream = streams_.find(name);
        if (stream == streams_.end()) return nullptr;
        const auto& changes = stream->second.changes;
        const auto found = std::lower_bound(
            changes.begin(), changes.end(), before,
            [](const Change& change, OutputTime at) { return change.before < at; });
        return found != changes.end() && found->before == before ? &*found : nullptr;
    }

    std::string changed_item(const std::string& name, const Change& change, std::string data) const;
    std::string changed_text(const std::string& name, const Change& change,
                             const std::string& data) const;
    void apply(const std::string& name, const Change& change, FrameMetadata& frame) const;

    const Recording& recording_;
    ProcessReport& report_;
    const std::function<bool(double)>& go_on_;
    Restamping restamping_;
    std::map<std::string, Stream> streams_;
    bool by_pps_ = false;
};

/// Where an item's parts lie (docs/contracts/recording-format.md).
constexpr std::size_t item_time_at = 16;
constexpr std::size_t item_metadata_at = 32;

/// Where the stamp of a message with a header lies in its CDR.
constexpr std::size_t header_stamp_at = 4;

void Processing::apply(const std::string& name, const Change& change, FrameMetadata& frame) const {
    frame.host_time = change.host;
    frame.sigma_ns = change.sigma_ns;
    frame.flags = change.flags;
    if (change.proof == no_proof) return;
    const pairing::Exposure& exposure = streams_.at(name).proofs[change.proof].exposure;
    frame.trigger = exposure.trigger;
    frame.set_tick(exposure.tick);
    frame.board_time = middle(exposure.start, exposure.end);
    frame.exposure =
        exposure.kind == StampKind::measured_middle ? exposure.end - exposure.start : Duration{};
    frame.delay_ns = static_cast<std::int32_t>(exposure.delay.ns);
}

std::string Processing::changed_item(const std::string& name, const Change& change,
                                     std::string data) const {
    std::memcpy(data.data() + item_time_at, &change.after.ns, sizeof change.after.ns);
    ring::Metadata words;
    std::memcpy(words.data(), data.data() + item_metadata_at, sizeof words);
    if (streams_.at(name).kind == ring::StreamKind::frames) {
        auto frame = unpack<FrameMetadata>(words);
        apply(name, change, frame);
        words = pack(frame);
    } else {
        auto sample = unpack<ImuMetadata>(words);
        sample.host_time = change.host;
        sample.sigma_ns = change.sigma_ns;
        sample.flags = change.flags;
        words = pack(sample);
    }
    std::memcpy(data.data() + item_metadata_at, words.data(), sizeof words);
    return data;
}

/// What each change sets of a stamp as JSON, and what a proved pair sets besides.
constexpr const char* stamp_fields[] = {"host_time_ns", "sigma_ns",      "kind",
                                        "suspect",      "holdover",      "clamped",
                                        "sensor_error", "camera_length", "flags"};
constexpr const char* pair_fields[] = {"trigger", "tick", "board_time_ns", "exposure_ns",
                                       "delay_ns"};

/// Of the stamps as JSON. What else a stamp says, in files of any version, stays.
std::string Processing::changed_text(const std::string& name, const Change& change,
                                     const std::string& data) const {
    json stamp = parse_shallow_json(data);
    if (!stamp.is_object()) return data;
    FrameMetadata frame{};
    apply(name, change, frame);
    json changed;
    add_fields(changed, ring::StreamKind::frames, pack(frame), ring::no_attributes);
    stamp["time_ns"] = change.after.ns;
    for (const char* field : stamp_fields) stamp[field] = changed.at(field);
    if (change.proof != no_proof)
        for (const char* field : pair_fields) stamp[field] = changed.at(field);
    return stamp.dump();
}

void put_header_stamp(std::string& data, OutputTime time) {
    constexpr std::int64_t second = 1'000'000'000;
    const auto s = static_cast<std::int32_t>(time.ns / second);
    const auto ns = static_cast<std::uint32_t>(time.ns % second);
    std::memcpy(data.data() + header_stamp_at, &s, sizeof s);
    std::memcpy(data.data() + header_stamp_at + sizeof s, &ns, sizeof ns);
}

/// "/NAME/rest" or "/versavis/NAME/rest".
std::pair<std::string, std::string> parts_of(const std::string& topic) {
    const std::string own = "/versavis/";
    const std::size_t begin = topic.rfind(own, 0) == 0 ? own.size() : 1;
    const std::size_t end = topic.find('/', begin);
    if (end == std::string::npos) return {};
    return {topic.substr(begin, end - begin), topic.substr(end + 1)};
}

std::optional<ChangedMessage> Processing::change(const McapChannel& channel,
                                                 const McapMessage& message) const {
    const auto [name, rest] = parts_of(channel.topic);
    const Change* change = change_of(name, {static_cast<std::int64_t>(message.log_time)});
    if (change == nullptr || rest == "gap") return std::nullopt;
    std::string data(reinterpret_cast<const char*>(message.data.data()), message.data.size());
    if (rest == "item") {
        if (data.size() < item_metadata_at + ring::metadata_size) return std::nullopt;
        data = changed_item(name, *change, std::move(data));
    } else if (rest == "stamp") {
        data = changed_text(name, *change, data);
    } else {
        if (channel.encoding != "cdr" || data.size() < header_stamp_at + 8) return std::nullopt;
        put_header_stamp(data, change->after);
    }
    const auto time = static_cast<std::uint64_t>(change->after.ns);
    return ChangedMessage{time, time, std::move(data)};
}

}  // namespace

Expected<ProcessReport> process_recording(const std::string& path, const std::string& output,
                                          const std::function<bool(double share)>& go_on) {
    const auto recording = Recording::open_file(path);  // only this one is rewritten
    if (!recording) return Unexpected(recording.error());
    ProcessReport report;
    report.file = output;
    if (!recording->facts().defect.empty())
        report.notes.push_back("the old file was cut off: " + recording->facts().defect);
    const auto clocks = read_clocks(*recording, [&] { return go_on(0); });
    if (!clocks) return Unexpected(clocks.error());
    Processing processing(*recording, *clocks, report, go_on);
    if (const auto planned = processing.plan(); !planned) return Unexpected(planned.error());
    const auto reader = McapReader::open(path);
    if (!reader) return Unexpected(reader.error());
    McapCopySettings settings;
    settings.change = [&](const McapChannel& channel, const McapMessage& message) {
        return processing.change(channel, message);
    };
    settings.added = {"process.json", "application/json", to_json(report).dump(2) + "\n"};
    settings.go_on = go_on;
    if (const auto copied = copy_mcap(*reader, output, settings); !copied)
        return Unexpected(copied.error());
    return report;
}

json to_json(const ProcessReport& report) {
    json streams = json::object();
    for (const auto& [name, stream] : report.streams)
        streams[name] = {{"items", stream.items},
                         {"restamped", stream.restamped},
                         {"suspect", stream.suspect},
                         {"proved", stream.proved},
                         {"contradicted", stream.contradicted},
                         {"change_rms_ns", stream.change_rms_ns},
                         {"change_max_ns", stream.change_max_ns},
                         {"sigma_ns", stream.sigma_after_ns}};
    return {{"file", report.file}, {"streams", streams}, {"notes", report.notes}};
}

std::string to_text(const ProcessReport& report) {
    std::string text;
    for (const auto& [name, stream] : report.streams) {
        text +=
            fmt::format("{}: {} of {} stamps recomputed, moved by {:.2f} us rms, {:.2f} at most",
                        name, stream.restamped, stream.items, stream.change_rms_ns * 1e-3,
                        stream.change_max_ns * 1e-3);
        if (stream.suspect > 0)
            text += fmt::format("; {} of {} suspect frames proved", stream.proved, stream.suspect);
        if (stream.contradicted > 0)
            text += fmt::format("; {} would now be paired differently, and were left as they are",
                                stream.contradicted);
        text += "\n";
    }
    for (const std::string& note : report.notes) text += "note: " + note + "\n";
    return text + report.file + "\n";
}

}  // namespace versavis::client
