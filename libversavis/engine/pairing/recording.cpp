// SPDX-License-Identifier: BSD-3-Clause
#include "engine/pairing/recording.hpp"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstring>
#include <type_traits>

namespace versavis::pairing {

namespace {

// The document gives these offsets; a compiler that lays them out otherwise must not build this.
static_assert(offsetof(Limits, earliest_arrival) == 8 && offsetof(Limits, pattern_duration) == 32 &&
              offsetof(Limits, frames_held) == 40 && offsetof(Limits, camera_clock) == 44 &&
              offsetof(Limits, stamped) == 48);
static_assert(offsetof(Exposure, start) == 16 && offsetof(Exposure, end_on_host) == 32 &&
              offsetof(Exposure, kind) == 48 && offsetof(Exposure, exposed) == 52 &&
              offsetof(Exposure, recorded) == 56 && offsetof(Exposure, delay) == 64);
static_assert(offsetof(Arrival, block_id) == 8 && offsetof(Arrival, arrived) == 24 &&
              offsetof(Arrival, exposure) == 32 && offsetof(Arrival, width) == 40 &&
              offsetof(Arrival, size) == 56);
static_assert(offsetof(Shortfall, reason) == 8 && offsetof(StartRequest, now) == 8);
static_assert(offsetof(RecordLimits, latency) == 8 && offsetof(RecordLimits, exposure) == 16 &&
              offsetof(RecordLimits, max_exposure) == 24 &&
              offsetof(RecordLimits, grid_slew_ppm) == 32 && offsetof(RecordLimits, wired) == 40 &&
              offsetof(RecordLimits, slave) == 41 && offsetof(RecordLimits, fixed_grid) == 42);
static_assert(offsetof(wire::Exposure, flags) == 2 && offsetof(wire::Exposure, trigger) == 8 &&
              offsetof(wire::Exposure, tick) == 16 && offsetof(wire::Exposure, trigger_ns) == 24 &&
              offsetof(wire::Exposure, start_ns) == 32 && offsetof(wire::Exposure, end_ns) == 40);
static_assert(offsetof(ReceivedRecord, commanded) == 48 &&
              offsetof(ReceivedRecord, exchanges) == 56 &&
              offsetof(ReceivedRecord, expected_ns) == 64 &&
              offsetof(ReceivedRecord, arrival) == 72 &&
              offsetof(ReceivedRecord, clock_contradicted) == 76 &&
              offsetof(ReceivedRecord, promptness) == 77 &&
              offsetof(ReceivedRecord, grid_ns) == 80);

/// A bool is 0 or 1, whatever byte somebody stored.
template <class Item, std::size_t size>
void make_bools(std::array<unsigned char, size>& bytes) {
    const auto make = [&](std::size_t at) { bytes[at] = bytes[at] != 0 ? 1 : 0; };
    if constexpr (std::is_same_v<Item, Exposure>) make(offsetof(Exposure, exposed));
    if constexpr (std::is_same_v<Item, Limits>) make(offsetof(Limits, camera_clock));
    if constexpr (std::is_same_v<Item, Reset>) make(offsetof(Reset, records_too));
    if constexpr (std::is_same_v<Item, RecordLimits>) {
        make(offsetof(RecordLimits, wired));
        make(offsetof(RecordLimits, slave));
        make(offsetof(RecordLimits, fixed_grid));
    }
    if constexpr (std::is_same_v<Item, ReceivedRecord>)
        make(offsetof(ReceivedRecord, clock_contradicted));
}

/// No honest time is further from 0: 73 years. Differences of two such times fit in 64 bits.
constexpr std::int64_t furthest_ns = std::int64_t{1} << 61U;

/// No period, delay or wait of a camera is longer.
constexpr Duration longest = seconds(86'400);

/// A minute of frames at 1 kHz; a service holds as many as its ring has slots.
constexpr std::uint32_t most_frames_held = 60'000;

template <class Time>
bool possible(Time time) {
    return time.ns > -furthest_ns && time.ns < furthest_ns;
}

bool possible_or_unknown(std::int64_t board_ns) {
    return board_ns == wire::no_time || possible(BoardTime{board_ns});
}

bool is_length(Duration duration) { return duration >= Duration{} && duration <= longest; }
bool is_period(Duration duration) { return is_length(duration) && duration.ns > 0; }

/// Name of a field that no service can have recorded; null: there is none.
const char* impossible(const Limits& limits) {
    if (!is_period(limits.period)) return "period_ns";
    if (limits.earliest_arrival < -longest || limits.earliest_arrival > longest)
        return "earliest_arrival_ns";
    if (!is_length(limits.latest_arrival)) return "latest_arrival_ns";
    if (!is_length(limits.exposure_wait)) return "exposure_wait_ns";
    if (!is_length(limits.pattern_duration)) return "pattern_duration_ns";
    if (limits.stamped > Instant::end) return "stamp_instant";  // the camera's clock shows no other
    return limits.frames_held > most_frames_held ? "frames_held" : nullptr;
}

const char* impossible(const Exposure& exposure) {
    if (!possible(exposure.start)) return "start_ns";
    if (!possible(exposure.end)) return "end_ns";
    if (!possible(exposure.end_on_host)) return "end_on_host_ns";
    if (!possible(exposure.earliest_on_host)) return "earliest_on_host_ns";
    return possible(exposure.recorded) ? nullptr : "recorded_ns";
}

const char* impossible(const Arrival& arrival) {
    if (!possible(arrival.camera_time)) return "camera_time_ns";
    if (!possible(arrival.arrived)) return "arrived_ns";
    return possible(arrival.exposure) ? nullptr : "exposure_ns";
}

const char* impossible(const Advance& advance) {
    return possible(advance.now) ? nullptr : "now_ns";
}

const char* impossible(const StartRequest& request) {
    return possible(request.now) ? nullptr : "now_ns";
}

const char* impossible(const RecordLimits& limits) {
    if (!is_period(limits.period)) return "period_ns";
    if (!is_length(limits.latency)) return "latency_ns";
    if (!is_length(limits.exposure)) return "exposure_ns";
    if (!is_length(limits.max_exposure)) return "max_exposure_ns";
    const bool slews = limits.grid_slew_ppm >= 0 && limits.grid_slew_ppm <= 1e6;
    return slews ? nullptr : "grid_slew_ppm";
}

const char* impossible(const ReceivedRecord& received) {
    if (!possible(BoardTime{received.record.trigger_ns})) return "trigger_ns";
    if (!possible_or_unknown(received.record.start_ns)) return "start_ns";
    if (!possible_or_unknown(received.record.end_ns)) return "end_ns";
    if (received.promptness > Promptness::late) return "promptness";
    if (!possible(BoardTime{received.grid_ns})) return "grid_ns";
    return is_length(received.commanded) ? nullptr : "commanded_ns";
}

template <class Item>
const char* impossible(const Item& /*any*/) {
    return nullptr;
}

template <std::size_t index = 0>
Expected<Evidence> read(const EvidenceMetadata& metadata) {
    if constexpr (index == std::variant_size_v<Evidence>) {
        return failure("evidence", fmt::format("kind {} is unknown", metadata.kind),
                       "it was recorded by a newer version");
    } else {
        if (metadata.kind != index + 1) return read<index + 1>(metadata);
        using Item = std::variant_alternative_t<index, Evidence>;
        Item item;
        std::array<unsigned char, sizeof item> bytes{};
        std::memcpy(bytes.data(), metadata.words, sizeof item);
        make_bools<Item>(bytes);
        std::memcpy(&item, bytes.data(), sizeof item);
        return Evidence(item);
    }
}

}  // namespace

EvidenceMetadata to_metadata(const Evidence& evidence) {
    EvidenceMetadata metadata{};
    metadata.kind = static_cast<std::uint32_t>(evidence.index() + 1);
    std::visit(
        [&](const auto& item) {
            using Item = std::decay_t<decltype(item)>;
            static_assert(std::is_trivially_copyable_v<Item> &&
                          sizeof item <= sizeof metadata.words);
            std::memcpy(metadata.words, &item, sizeof item);
        },
        evidence);
    return metadata;
}

Expected<Evidence> from_metadata(const EvidenceMetadata& metadata) {
    const auto evidence = read(metadata);
    return evidence ? checked(*evidence) : evidence;
}

Expected<Evidence> checked(const Evidence& evidence) {
    const char* field = std::visit([](const auto& item) { return impossible(item); }, evidence);
    if (field == nullptr) return evidence;
    return failure("evidence", fmt::format("no service recorded this '{}'", field),
                   "the recording is damaged: record again");
}

void apply(Pairing& pairing, const Evidence& evidence) {
    std::visit(
        [&](const auto& item) {
            using Item = std::decay_t<decltype(item)>;
            if constexpr (std::is_same_v<Item, Advance>)
                pairing.advance(item.now);
            else if constexpr (std::is_same_v<Item, Reset>)
                pairing.reset();
            else if constexpr (std::is_same_v<Item, StartRequest>)
                pairing.start_requested(item.start, item.now);
            else if constexpr (std::is_same_v<Item, ReceivedRecord>)
                pairing.compared(item.exchanges, !item.clock_contradicted);
            else if constexpr (std::is_same_v<Item, Exposure> || std::is_same_v<Item, Arrival> ||
                               std::is_same_v<Item, Shortfall>)
                pairing.add(item);
        },
        evidence);
}

void apply(RecordFilter& filter, const Evidence& evidence) {
    if (const auto* received = std::get_if<ReceivedRecord>(&evidence))
        filter.judge(*received);
    else if (const auto* limits = std::get_if<RecordLimits>(&evidence))
        filter.set_limits(*limits);
    else if (const auto* skipped = std::get_if<TriggersSkipped>(&evidence))
        filter.triggers_skipped(skipped->count);
    else if (const auto* reset = std::get_if<Reset>(&evidence); reset && reset->records_too)
        filter.forget();
    else if (std::holds_alternative<StartRequest>(evidence))
        filter.forget_grid();
}

void Replay::apply(const Evidence& evidence) {
    if (const auto* limits = std::get_if<RecordLimits>(&evidence); limits && !filter_)
        filter_.emplace(*limits);
    if (filter_) pairing::apply(*filter_, evidence);
    if (const auto* received = std::get_if<ReceivedRecord>(&evidence); received && filter_)
        refused_ =
            filter_->verdict().doubt ? std::optional(received->record.trigger) : std::nullopt;
    if (const auto* limits = std::get_if<Limits>(&evidence)) {
        if (pairing_)
            pairing_->set_limits(*limits);
        else
            pairing_.emplace(*limits, outcome_);
    }
    const auto* exposure = std::get_if<Exposure>(&evidence);
    if (pairing_ && !(exposure && exposure->trigger == refused_))
        pairing::apply(*pairing_, evidence);
}

const RecordVerdict* Replay::record_verdict() const {
    return filter_ ? &filter_->verdict() : nullptr;
}

void Replay::finish() {
    if (pairing_) pairing_->reset();
}

}  // namespace versavis::pairing
