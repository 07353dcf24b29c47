// SPDX-License-Identifier: BSD-3-Clause
#include "process/recording_process.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>

#include "base/byte_cursor.hpp"
#include "base/median.hpp"
#include "base/shallow_json.hpp"
#include "base/stamp_source.hpp"
#include "engine/rounding.hpp"
#include "process/frame_proof.hpp"
#include "process/mcap_copy.hpp"
#include "process/restamping.hpp"
#include "process/stamp_choice.hpp"
#include "recording/item_messages.hpp"
#include "recording/recording.hpp"
#include "ros_client/names.hpp"

namespace versavis::client {

namespace {

using nlohmann::json;

// A frame that is proved where stamps are not by the recomputed clock takes over what those around
// it, so far away at most, are off from it. Half: gaps leave it suspect. Twice: it is off by what
// the clocks wander within ten seconds.
constexpr Duration next_to_it = seconds(5);

// Stamps of another clock that show by how much the recomputed ones are wrong. Half: those next to
// a step may pass for them. Twice: short stretches say nothing.
constexpr std::size_t least_of_other_clock = 20;

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

/// A stamp as it was recorded, and what becomes of it.
struct Candidate {
    Change change;
    std::optional<Restamping::Stamp> stamp;  ///< recomputed
    Duration least_sigma;                    ///< live, of the clock alone, at least ...
    Duration most_sigma;                     ///< ... and at most
    std::uint64_t life = 0;
    std::uint32_t epoch = 0;
    bool suspect = false;
    Choice choice = Choice::no_clock;
};

struct Stream {
    ring::StreamKind kind = ring::StreamKind::frames;
    std::vector<Candidate> candidates;
    std::vector<Change> changes;  ///< by `before`
    std::vector<ProvedFrame> proofs;
    ProcessedStream counts;
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
std::optional<clock::Asymmetry> asymmetry_of(const Recording& recording) {
    const Attachment* status = recording.attachment("status.json");
    if (status == nullptr) return std::nullopt;
    const json document = parse_shallow_json(status->content);
    if (!document.is_object() || !document.contains("clock")) return std::nullopt;
    const json& clock = document["clock"];
    if (!clock.is_object() || clock.value("asymmetry_source", json("none")) == json("none"))
        return std::nullopt;
    const json offset = clock.value("asymmetry_ns", json());
    const json sigma = clock.value("asymmetry_sigma_ns", json());
    if (!offset.is_number_integer() || !sigma.is_number_integer()) return std::nullopt;
    return clock::Asymmetry{{offset.get<std::int64_t>()}, {sigma.get<std::int64_t>()}};
}

Duration without(std::uint32_t total, Duration part) {
    const auto whole = static_cast<double>(total);
    const auto other = static_cast<double>(part.ns);
    return rounded(std::sqrt(std::max(whole * whole - other * other, 0.0)));
}

class Processing {
 public:
    Processing(const Recording& recording, const RecordedClocks& clocks, ProcessReport& report,
               const std::function<bool(double)>& go_on)
        : recording_(recording),
          report_(report),
          go_on_(go_on),
          restamping_(clocks, asymmetry_of(recording)) {
        for (const PpsPulse& pulse : clocks.pulses)
            if (pulse.sigma.ns >= 0) live_sigmas_.add(pulse.host, pulse.sigma);
    }

    Expected<> plan() {
        auto done = pair_again();
        if (done) done = read_stamps();
        if (!done) return done;
        live_sigmas_.sort();
        recomputed_off_ = off_from_other_clock();
        for (auto& [name, stream] : streams_) {
            choose_all(stream);
            restamp(stream);
            finish(name, stream);
        }
        return {};
    }

    void look(const McapChannel& channel, const McapMessage& message);
    std::optional<ChangedMessage> change(const McapChannel& channel, const McapMessage& message);

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

    Expected<> read_stamps() {
        return each(names({ring::StreamKind::imu, ring::StreamKind::frames}),
                    [this](const RecordedItem& item) {
                        Stream& stream = streams_[item.stream];
                        stream.kind = item.kind;
                        ++stream.counts.items;
                        if (item.kind == ring::StreamKind::imu)
                            read_sample(item, stream);
                        else
                            read_frame(item, stream);
                    });
    }

    template <class Metadata>
    static Candidate candidate(const RecordedItem& item, const Metadata& metadata) {
        Candidate read;
        read.change = {item.time, item.time, metadata.host_time, metadata.sigma_ns, metadata.flags,
                       no_proof,  false};
        read.life = item.life;
        read.epoch = metadata.epoch;
        read.suspect = (metadata.flags & flag_suspect) != 0;
        return read;
    }

    void read_sample(const RecordedItem& item, Stream& stream) {
        const auto sample = unpack<ImuMetadata>(item.metadata);
        Candidate read = candidate(item, sample);
        if (!read.suspect) {
            read.stamp =
                restamping_.stamp(sample.board_time - sample.filter_delay, sample.host_time);
            read.choice = Choice::no_estimate;
        }
        stream.candidates.push_back(read);
    }

    void read_frame(const RecordedItem& item, Stream& stream) {
        const auto frame = unpack<FrameMetadata>(item.metadata);
        Candidate read = candidate(item, frame);
        const std::uint32_t index = proof_of(frame, stream.proofs);
        const ProvedFrame* proof = index == no_proof ? nullptr : &stream.proofs[index];
        if (read.suspect) {
            ++stream.counts.suspect;
            if (proof != nullptr) {
                const pairing::Exposure& exposure = proof->exposure;
                read.change.proof = index;
                read.stamp = restamping_.stamp(middle(exposure.start, exposure.end), frame.arrival);
            }
            stream.candidates.push_back(read);
            return;
        }
        const bool contradicted = proof != nullptr && proof->exposure.trigger != frame.trigger;
        stream.counts.contradicted += contradicted ? 1U : 0U;
        if (stamped_by_board(frame) && !contradicted) {
            read.stamp = restamping_.stamp(frame.board_time, frame.host_time);
            read.choice = Choice::no_estimate;
            const bool measured = frame.stamp_kind() == StampKind::measured_middle;
            const bool clamped = (frame.flags & flag_clamped) != 0;
            if (proof != nullptr && measured && !clamped && frame.sigma_ns != sigma_unknown)
                live_sigmas_.add(frame.host_time,
                                 without(frame.sigma_ns, proof->exposure.delay_sigma));
        }
        stream.candidates.push_back(read);
    }

    /// Sigma of the clock alone, live: known from others that have it at this time, or between that
    /// of a service that knew the messages of the recording alone, and the least of it.
    void bound_sigma(Candidate& one) const {
        const Duration total{std::int64_t{one.change.sigma_ns}};
        if (const auto known = live_sigmas_.at(one.change.host)) {
            one.least_sigma = one.most_sigma = std::min(*known, total);
            return;
        }
        Duration least;
        if (const auto replayed = restamping_.live_sigma(one.change.host)) {
            one.most_sigma = std::min(replayed->then, total);
            least = replayed->least;
        }
        if (const auto of_all = live_sigmas_.least()) least = std::min(least, *of_all);
        one.least_sigma = std::min(least, total);
    }

    /// What else is uncertain of a sample, its filter's delay, is the same for all of a stream.
    static void share_other(Stream& stream) {
        std::map<std::uint64_t, double> others;  // by life of the service
        const auto usable = [](const Candidate& one) {
            return one.choice != Choice::no_clock && one.change.sigma_ns != sigma_unknown;
        };
        for (const Candidate& one : stream.candidates) {
            if (!usable(one)) continue;
            const auto other =
                static_cast<double>(without(one.change.sigma_ns, one.least_sigma).ns);
            const auto known = others.emplace(one.life, other).first;
            known->second = std::min(known->second, other);
        }
        for (Candidate& one : stream.candidates) {
            if (!usable(one)) continue;
            const Duration other{static_cast<std::int64_t>(others.at(one.life))};
            one.least_sigma = std::max(one.least_sigma, without(one.change.sigma_ns, other));
            one.most_sigma = std::max(one.most_sigma, one.least_sigma);
        }
    }

    /// Where PPS, say, made the stamps, it shows by how much the recomputed ones are wrong: about
    /// as much elsewhere, as most of it is the link's asymmetry.
    Duration off_from_other_clock() const {
        std::vector<Duration> off;
        for (const auto& [name, stream] : streams_)
            for (const Candidate& one : stream.candidates)
                if (one.choice == Choice::no_estimate && one.stamp &&
                    by_other_clock(live_stamp(one), restamping_))
                    off.push_back(absolute(one.change.before - one.stamp->output));
        if (off.size() < least_of_other_clock) return {};
        return median(std::move(off));
    }

    static LiveStamp live_stamp(const Candidate& one) {
        return {one.change.before, one.change.host, one.least_sigma, one.most_sigma,
                (one.change.flags & flag_clamped) != 0};
    }

    void choose_all(Stream& stream) const {
        for (Candidate& one : stream.candidates) {
            if (one.choice != Choice::no_clock) bound_sigma(one);
            if (one.stamp) one.stamp->sigma = Duration{sigma_of(one.stamp->sigma, recomputed_off_)};
        }
        if (stream.kind == ring::StreamKind::imu) share_other(stream);
        std::vector<DatedChoice> choices;
        for (Candidate& one : stream.candidates) {
            if (one.choice != Choice::no_clock)
                one.choice = choose(live_stamp(one), one.stamp, restamping_);
            choices.push_back({one.change.host, one.choice});
        }
        spread(choices);
        for (std::size_t i = 0; i < choices.size(); ++i)
            stream.candidates[i].choice = choices[i].choice;
    }

    void restamp(Stream& stream) const {
        for (std::size_t i = 0; i < stream.candidates.size(); ++i) {
            const Candidate& one = stream.candidates[i];
            ProcessedEpoch& epoch = epoch_of(one, stream);
            ++epoch.items;
            if (one.suspect) {
                prove(i, stream);
                continue;
            }
            Change change = one.change;
            if (one.choice == Choice::improved) {
                // Other uncertainties, such as of a filter's delay, are not stored separately.
                const Duration other = without(change.sigma_ns, one.least_sigma);
                epoch.sigma_before_ns += change.sigma_ns;
                set(change, *one.stamp);
                if (change.sigma_ns != sigma_unknown)
                    change.sigma_ns = std::min(change.sigma_ns, sigma_of(one.stamp->sigma, other));
                epoch.sigma_after_ns += change.sigma_ns;
            }
            ++epoch.stamps[static_cast<std::size_t>(one.choice)];
            hold(change, stream);
        }
    }

    /// The newest one. Stamps of another epoch, or of another life of the service, do not compare.
    static ProcessedEpoch& epoch_of(const Candidate& one, Stream& stream) {
        std::vector<ProcessedEpoch>& epochs = stream.counts.epochs;
        if (epochs.empty() || epochs.back().life != one.life || epochs.back().epoch != one.epoch) {
            stream.newest.reset();
            epochs.push_back({one.life, one.epoch});
        }
        return epochs.back();
    }

    /// Within an epoch each stamp is later than the previous one, as live: one that would not be is
    /// held just after it, and flagged.
    static void hold(Change change, Stream& stream) {
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

    static void set(Change& change, const Restamping::Stamp& stamp) {
        change.after = stamp.output;
        change.host = stamp.host;
        change.flags &= ~static_cast<std::uint32_t>(flag_clamped | flag_holdover);
        change.restamped = true;
    }

    /// What the recomputed stamp lacks to fit those around it that stay: none where they do not.
    static std::optional<Restamping::Stamp> fitting(std::size_t index, const Stream& stream) {
        const Candidate& one = stream.candidates[index];
        Restamping::Stamp stamp = *one.stamp;
        const Candidate* nearest = nullptr;
        const auto look = [&](const Candidate& other) {
            const bool near = absolute(other.change.host - stamp.host) < next_to_it;
            const bool usable = !other.suspect && other.choice != Choice::no_clock;
            if (near && usable &&
                (nearest == nullptr || absolute(other.change.host - stamp.host) <
                                           absolute(nearest->change.host - stamp.host)))
                nearest = &other;
            return near && !usable;
        };
        for (std::size_t i = index; i-- > 0 && look(stream.candidates[i]);) {
        }
        for (std::size_t i = index + 1; i < stream.candidates.size() && look(stream.candidates[i]);
             ++i) {
        }
        if (nearest == nullptr) return stamp;
        if (nearest->choice == Choice::improved || nearest->choice == Choice::no_better)
            return stamp;
        if (!nearest->stamp || nearest->epoch != one.epoch) return std::nullopt;
        stamp.output = stamp.output + (nearest->change.before - nearest->stamp->output);
        stamp.host = stamp.host + (nearest->change.host - nearest->stamp->host);
        stamp.sigma = std::max(stamp.sigma, nearest->most_sigma);
        return stamp;
    }

    void prove(std::size_t index, Stream& stream) const {
        const Candidate& one = stream.candidates[index];
        ProcessedEpoch& epoch = stream.counts.epochs.back();
        const auto stamp = one.stamp ? fitting(index, stream) : std::nullopt;
        if (!stamp || restamping_.epoch(stamp->host) != one.epoch) {
            ++epoch.stamps[static_cast<std::size_t>(Choice::no_clock)];
            return;
        }
        const ProvedFrame& proof = stream.proofs[one.change.proof];
        Change change = one.change;
        set(change, *stamp);
        change.flags =
            (change.flags & ~static_cast<std::uint32_t>(stamp_kind_mask | flag_suspect)) |
            static_cast<std::uint32_t>(proof.exposure.kind);
        change.sigma_ns = sigma_of(stamp->sigma, uncertain(proof, stamp->host));
        hold(change, stream);
        ++stream.counts.proved;
        ++epoch.proved;
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
        stream.candidates = {};
        for (ProcessedEpoch& epoch : counts.epochs) {
            const auto improved = static_cast<double>(std::max<std::uint64_t>(epoch.improved(), 1));
            epoch.sigma_before_ns /= improved;
            epoch.sigma_after_ns /= improved;
        }
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

    ItemMessage changed(const std::string& name, const Change& change, ItemMessage item) const;
    const ChannelRole& role(const McapChannel& channel);
    std::optional<ItemMessage> noted_item(const std::string& stream, std::uint32_t sequence);
    void apply(const std::string& name, const Change& change, FrameMetadata& frame) const;

    const Recording& recording_;
    ProcessReport& report_;
    const std::function<bool(double)>& go_on_;
    Restamping restamping_;
    LiveSigmas live_sigmas_;
    Duration recomputed_off_;  ///< from another clock, where that made the stamps
    std::map<std::string, Stream> streams_;

    struct Noted {
        ItemMessage item;
        std::string payload;
    };
    std::map<std::uint16_t, ChannelRole> roles_;
    std::map<std::pair<std::string, std::uint32_t>, Noted> noted_;
    std::string payload_;  ///< of the item noted_item() gave
};

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

ItemMessage Processing::changed(const std::string& name, const Change& change,
                                ItemMessage item) const {
    item.time = change.after;
    if (streams_.at(name).kind == ring::StreamKind::frames) {
        auto frame = unpack<FrameMetadata>(item.metadata);
        apply(name, change, frame);
        item.metadata = pack(frame);
    } else {
        auto sample = unpack<ImuMetadata>(item.metadata);
        sample.host_time = change.host;
        sample.sigma_ns = change.sigma_ns;
        sample.flags = change.flags;
        item.metadata = pack(sample);
    }
    return item;
}

void put_header_stamp(std::string& data, OutputTime time) {
    constexpr std::int64_t second = 1'000'000'000;
    const auto s = static_cast<std::int32_t>(time.ns / second);
    const auto ns = static_cast<std::uint32_t>(time.ns % second);
    std::memcpy(data.data() + header_stamp_at, &s, sizeof s);
    std::memcpy(data.data() + header_stamp_at + sizeof s, &ns, sizeof ns);
}

std::optional<ItemMessage> item_of(const ChannelRole& role, const McapMessage& message) {
    std::uint64_t payload = 0;
    auto item = role.old ? parse_old_item(message.data, message.data.size(), payload)
                         : parse_item_message(message.data, payload);
    if (item) item->kind = role.kind;
    return item;
}

std::string_view type_of(Role role) {
    switch (role) {
        case Role::item: return item_type;
        case Role::stamp: return stamp_type;
        case Role::event: return event_type;
        case Role::gap: return gap_type;
        case Role::status: return text_type;
        default: return {};
    }
}

/// Of files before version 2.
std::optional<McapTopic> converted_topic(const McapChannel& channel) {
    const ChannelRole role = role_of(channel);
    if (!role.old || type_of(role.role).empty()) return std::nullopt;
    const bool item = role.role == Role::item;
    const std::size_t rest = channel.topic.rfind('/');
    const bool of_stream = item || role.role == Role::stamp || role.role == Role::gap;
    return recorded_topic(
        of_stream ? "/versavis/" + ros_client::topic_part(role.stream) + channel.topic.substr(rest)
                  : channel.topic,
        type_of(role.role), role.stream, item ? std::optional(role.kind) : std::nullopt);
}

const ChannelRole& Processing::role(const McapChannel& channel) {
    const auto [known, is_new] = roles_.try_emplace(channel.id);
    if (is_new) known->second = role_of(channel);
    return known->second;
}

void Processing::look(const McapChannel& channel, const McapMessage& message) {
    const ChannelRole& its = role(channel);
    const bool noted = its.kind == ring::StreamKind::frames || its.kind == ring::StreamKind::events;
    const auto item =
        its.role == Role::item && noted ? item_of(its, message) : std::optional<ItemMessage>();
    if (!item) return;
    noted_[{its.stream, message.sequence}] = {*item, std::string(as_text(item->payload))};
}

/// The item of this chunk that a Stamp or an Event repeats.
std::optional<ItemMessage> Processing::noted_item(const std::string& stream,
                                                  std::uint32_t sequence) {
    auto found = noted_.extract({stream, sequence});
    if (found.empty()) return std::nullopt;
    payload_ = std::move(found.mapped().payload);
    found.mapped().item.payload = std::as_bytes(std::span(payload_));
    return found.mapped().item;
}

std::optional<ChangedMessage> Processing::change(const McapChannel& channel,
                                                 const McapMessage& message) {
    const ChannelRole& its = role(channel);
    const Change* change = change_of(its.stream, {static_cast<std::int64_t>(message.log_time)});
    if (its.role == Role::gap) change = nullptr;
    if (change == nullptr && !its.old) return std::nullopt;
    ChangedMessage result{message.log_time, message.publish_time};
    if (change != nullptr)
        result.log_time = result.publish_time = static_cast<std::uint64_t>(change->after.ns);
    switch (its.role) {
        case Role::item:
        case Role::stamp:
        case Role::event: {
            const auto item = its.role == Role::item ? item_of(its, message)
                                                     : noted_item(its.stream, message.sequence);
            if (!item) {
                result.dropped = true;
                return result;
            }
            const ItemMessage made =
                change == nullptr ? *item : changed(its.stream, *change, *item);
            result.data =
                its.role == Role::item ? item_message(made) : note_message(its.stream, made);
            return result;
        }
        case Role::gap: {
            const auto gap = parse_old_gap(message.data);
            result.dropped = !gap;
            if (gap)
                result.data =
                    gap_message(its.stream, {static_cast<std::int64_t>(message.log_time)}, *gap);
            return result;
        }
        case Role::status: result.data = text_message(as_text(message.data)); return result;
        default: break;
    }
    if (its.old || message.data.size() < header_stamp_at + 8) return std::nullopt;
    result.data = as_text(message.data);
    put_header_stamp(result.data, change->after);
    return result;
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
    const auto& streams = recording->streams();
    const bool has_clock = std::any_of(streams.begin(), streams.end(), [](const auto& stream) {
        return stream.kind == ring::StreamKind::clock || stream.kind == ring::StreamKind::events;
    });
    if (!has_clock)
        report.notes.push_back("it has no stamps of the clock: all stamps stay as they are");
    const auto clocks = has_clock ? read_clocks(*recording, [&] { return go_on(0); })
                                  : Expected<RecordedClocks>(RecordedClocks{});
    if (!clocks) return Unexpected(clocks.error());
    Processing processing(*recording, *clocks, report, go_on);
    if (const auto planned = processing.plan(); !planned) return Unexpected(planned.error());
    const auto reader = McapReader::open(path);
    if (!reader) return Unexpected(reader.error());
    McapCopySettings settings;
    settings.convert = converted_topic;
    settings.look = [&](const McapChannel& channel, const McapMessage& message) {
        processing.look(channel, message);
    };
    settings.change = [&](const McapChannel& channel, const McapMessage& message) {
        return processing.change(channel, message);
    };
    recording->check();
    for (const std::string& damage : recording->damages())
        report.notes.push_back("left out: " + damage);
    settings.damaged = [](const Error&) {};  // check() found the same
    settings.added = {"process.json", "application/json", to_json(report).dump(2) + "\n"};
    settings.go_on = go_on;
    if (const auto copied = copy_mcap(*reader, output, settings); !copied)
        return Unexpected(copied.error());
    return report;
}

namespace {

/// Of each Choice: its name, and as the end of a sentence.
constexpr struct {
    const char* name;
    const char* text;
} choices[] = {
    {"improved", ""},
    {"other_clock", "by PPS, or another clock that is not the messages'"},
    {"disagrees", "differing from the recomputed ones by more than sigma explains"},
    {"no_better", "as good as recomputed ones"},
    {"no_estimate", "without messages around them, or next to a step of a clock"},
    {"no_clock", "not by the clock: of the arrival, suspect, or paired otherwise now"},
};

json epochs_json(const std::vector<ProcessedEpoch>& epochs) {
    json list = json::array();
    for (const ProcessedEpoch& epoch : epochs) {
        json left = json::object();
        for (std::size_t i = 1; i < std::size(choices); ++i)
            left[choices[i].name] = epoch.stamps[i];
        const bool improved = epoch.improved() > 0;
        list.push_back({{"life", epoch.life},
                        {"epoch", epoch.epoch},
                        {"items", epoch.items},
                        {"improved", epoch.improved()},
                        {"proved", epoch.proved},
                        {"left", left},
                        {"sigma_before_ns", improved ? json(epoch.sigma_before_ns) : json()},
                        {"sigma_after_ns", improved ? json(epoch.sigma_after_ns) : json()}});
    }
    return list;
}

std::string epoch_text(const ProcessedEpoch& epoch) {
    std::string text = fmt::format("  epoch {}: ", epoch.epoch);
    if (epoch.improved() == 0)
        text += fmt::format("none of {} stamps improved", epoch.items);
    else
        text += fmt::format("{} of {} stamps improved, sigma {:.2f} -> {:.2f} us", epoch.improved(),
                            epoch.items, epoch.sigma_before_ns * 1e-3, epoch.sigma_after_ns * 1e-3);
    if (epoch.proved > 0) text += fmt::format(", {} proved", epoch.proved);
    text += "\n";
    for (std::size_t i = 1; i < std::size(choices); ++i)
        if (epoch.stamps[i] > 0)
            text += fmt::format("    {} left as they were: {}\n", epoch.stamps[i], choices[i].text);
    return text;
}

}  // namespace

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
                         {"sigma_ns", stream.sigma_after_ns},
                         {"epochs", epochs_json(stream.epochs)}};
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
        for (const ProcessedEpoch& epoch : stream.epochs) text += epoch_text(epoch);
    }
    for (const std::string& note : report.notes) text += "note: " + note + "\n";
    return text + report.file + "\n";
}

}  // namespace versavis::client
