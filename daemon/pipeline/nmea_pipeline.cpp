// SPDX-License-Identifier: BSD-3-Clause
#include "nmea_pipeline.hpp"

#include <fmt/format.h>

#include <cstring>

#include "plausibility/arrival_check.hpp"
#include "publish/total_sigma.hpp"
#include "versavis/metadata.hpp"

namespace versavis::daemon {

namespace {

/// Of rings: with ten sentences five times a second, 10 s; 2 MiB, as a slot is a page.
constexpr std::uint32_t sentences_kept = 512;

/// A board's stamp of a byte is good to this many characters of ten bits.
constexpr std::int64_t uncertain_bits = 20;

}  // namespace

bool has_right_checksum(std::string_view sentence) {
    constexpr std::size_t checksum_size = 3;  // "*hh"
    if (sentence.size() <= checksum_size) return false;
    const std::string_view body = sentence.substr(1, sentence.size() - 1 - checksum_size);
    unsigned sum = 0;
    for (const char c : body) sum ^= static_cast<unsigned char>(c);
    const std::string_view end = sentence.substr(sentence.size() - checksum_size);
    return end == fmt::format("*{:02X}", sum) || end == fmt::format("*{:02x}", sum);
}

Expected<> NmeaPipeline::configure(const ring::Place& place, std::uint32_t baud) {
    std::optional<ring::Writer> made;  // without the lock: memory takes its time
    if (!report()) {
        auto ring =
            ring::Writer::create(place, {nmea_stream, ring::StreamKind::nmea, sentences_kept,
                                         sentences_kept, wire::max_sentence_text});
        if (!ring) return Unexpected(ring.error());
        made = std::move(*ring);
    }
    const std::lock_guard lock(mutex_);
    if (made) ring_ = std::move(made);
    sigma_ = seconds(uncertain_bits) / static_cast<std::int64_t>(baud);
    return {};
}

void NmeaPipeline::board_restarted() {
    const std::lock_guard lock(mutex_);
    last_sequence_.reset();
}

void NmeaPipeline::add(const wire::Sentence& sentence, HostTime received) {
    const std::lock_guard lock(mutex_);
    if (!ring_) return;
    const BoardTime began{sentence.time_ns};
    const bool doubted = contradicts_arrival(began, received, translator_).has_value();
    auto stamp = doubted ? std::nullopt : translator_.translate(began);
    auto guarded =
        stamp ? guard_.guard(*stamp, total_sigma_ns(stamp->sigma_ns, sigma_)) : std::nullopt;
    const bool suspect = !guarded;
    if (suspect) {
        stamp = translator_.translate(received, {});
        guarded = guard_.guard(*stamp, sigma_unknown, true);
    }
    const std::string_view text(sentence.text, sentence.size);
    const bool damaged = !has_right_checksum(text);

    NmeaMetadata metadata{};
    metadata.board_time = began;
    metadata.host_time = stamp->host;
    metadata.number = sentence.sequence;
    metadata.sigma_ns = guarded->sigma_ns;
    metadata.epoch = stamp->epoch;
    metadata.flags = guarded->flags;
    if (suspect) metadata.flags |= flag_suspect;
    if (damaged) metadata.flags |= flag_sensor_error;

    // Links duplicate and reorder nothing: what is missing was dropped.
    if (last_sequence_) report_.lost += sentence.sequence - *last_sequence_ - 1;
    last_sequence_ = sentence.sequence;
    ++report_.sentences;
    report_.damaged += damaged ? 1 : 0;
    report_.suspect += suspect ? 1 : 0;

    const auto slot = ring_->acquire();
    std::memcpy(ring_->slot_data(*slot), text.data(), text.size());
    ring_->publish(*slot, static_cast<std::uint32_t>(text.size()), guarded->time, pack(metadata));
}

void NmeaPipeline::heartbeat(HostTime now) {
    const std::lock_guard lock(mutex_);
    if (ring_) ring_->heartbeat(now);
}

std::optional<NmeaReport> NmeaPipeline::report() const {
    const std::lock_guard lock(mutex_);
    return ring_ ? std::optional(report_) : std::nullopt;
}

}  // namespace versavis::daemon
