// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/recording.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace versavis::clock {

namespace {

std::uint64_t word(std::int64_t ns) { return static_cast<std::uint64_t>(ns); }
std::int64_t ns(std::uint64_t word) { return static_cast<std::int64_t>(word); }
std::uint64_t two_words(std::uint32_t low, std::uint32_t high) {
    return low | std::uint64_t{high} << 32U;
}
std::uint32_t low(std::uint64_t word) { return static_cast<std::uint32_t>(word); }
std::uint32_t high(std::uint64_t word) { return static_cast<std::uint32_t>(word >> 32U); }

ClockMetadata write(const RecordedExchange& item) {
    return {1,
            item.nonce,
            {two_words(item.request, item.flags), word(item.sent.ns), word(item.received.ns),
             word(item.answered.ns), word(item.arrived.ns)}};
}

ClockMetadata write(const RecordedMessage& item) {
    return {2, item.nonce, {word(item.departed.ns), word(item.arrived.ns)}};
}

ClockMetadata write(const RecordedRestart& item) { return {3, item.nonce, {}}; }

ClockMetadata write(const RecordedOutput& item) {
    const auto uncertainty_ns =
        static_cast<std::uint32_t>(std::clamp<std::int64_t>(item.uncertainty.ns, 0, UINT32_MAX));
    return {4, item.epoch, {word(item.host.ns), word(item.minus_host.ns), uncertainty_ns}};
}

}  // namespace

ClockMetadata to_metadata(const ClockItem& item) {
    return std::visit([](const auto& input) { return write(input); }, item);
}

Expected<ClockItem> from_metadata(const ClockMetadata& metadata) {
    const auto& words = metadata.words;
    switch (metadata.kind) {
        case 1:
            return RecordedExchange{metadata.whose, low(words[0]),  high(words[0]), {ns(words[1])},
                                    {ns(words[2])}, {ns(words[3])}, {ns(words[4])}};
        case 2: return RecordedMessage{metadata.whose, {ns(words[0])}, {ns(words[1])}};
        case 3: return RecordedRestart{metadata.whose};
        case 4:
            return RecordedOutput{
                metadata.whose, {ns(words[0])}, {ns(words[1])}, {std::int64_t{low(words[2])}}};
        default:
            return failure("clock", fmt::format("kind {} is unknown", metadata.kind),
                           "it was recorded by a newer version");
    }
}

}  // namespace versavis::clock
