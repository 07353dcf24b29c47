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

/// A bool is 0 or 1, whatever byte somebody stored.
template <class Item, std::size_t size>
void make_bools(std::array<unsigned char, size>& bytes) {
    const auto make = [&](std::size_t at) { bytes[at] = bytes[at] != 0 ? 1 : 0; };
    if constexpr (std::is_same_v<Item, Exposure>) make(offsetof(Exposure, exposed));
    if constexpr (std::is_same_v<Item, Limits>) make(offsetof(Limits, camera_clock));
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
        if constexpr (!std::is_empty_v<Item>) {
            std::array<unsigned char, sizeof item> bytes{};
            std::memcpy(bytes.data(), metadata.words, sizeof item);
            make_bools<Item>(bytes);
            std::memcpy(&item, bytes.data(), sizeof item);
        }
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
            if constexpr (!std::is_empty_v<Item>) std::memcpy(metadata.words, &item, sizeof item);
        },
        evidence);
    return metadata;
}

Expected<Evidence> from_metadata(const EvidenceMetadata& metadata) { return read(metadata); }

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
            else if constexpr (!std::is_same_v<Item, Limits>)
                pairing.add(item);
        },
        evidence);
}

}  // namespace versavis::pairing
