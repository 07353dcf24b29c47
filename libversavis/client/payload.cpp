// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/ring_payload.hpp"

#include <atomic>
#include <cstring>

#include "client/segment.hpp"

namespace versavis::ring {

namespace {

/// What one load takes: with words of half the size, a copy takes 1.8 times as long as memcpy.
using Words = long long __attribute__((vector_size(16), may_alias));

/// Copies what the writer may be overwriting. Writer and driver fill slots with plain stores, so to
/// the language this is a data race whatever is done here. Volatile loads make it one without
/// consequences: the compiler neither repeats them nor leaves them out, and takes any value. The
/// copy may mix two items; only valid() afterwards (SYNC 4) decides whether it is good. Slots are
/// pages, so the last load may go beyond the payload.
__attribute__((no_sanitize("thread"))) void copy_words(const std::byte* source,
                                                       std::byte* destination, std::size_t size) {
    const auto* words = reinterpret_cast<const volatile Words*>(source);
    const std::size_t rest = size % sizeof(Words);
    std::size_t at = 0;
    for (; at < size - rest; at += sizeof(Words)) {
        const Words loaded = *words++;
        std::memcpy(destination + at, &loaded, sizeof loaded);
    }
    if (rest != 0) {
        const Words loaded = *words;
        std::memcpy(destination + at, &loaded, rest);
    }
}

}  // namespace

Payload::Payload(std::shared_ptr<const Mapping> mapping, std::uint32_t slot,
                 std::uint64_t generation, std::uint32_t size)
    : mapping_(std::move(mapping)),
      data_(mapping_->slot(slot)),
      generation_(generation),
      slot_(slot),
      size_(size) {}

std::uint64_t Payload::attributes() const {
    return mapping_ && mapping_->constants().has_attributes
               ? mapping_->attributes(slot_).load(std::memory_order_relaxed)
               : no_attributes;
}

bool Payload::valid() const {
    if (!mapping_) return true;
    // SYNC 4: acquire fence here, release fence in Writer::acquire(): if anything that was read of
    // the payload came from a newer item, the generation has changed. Without it a mixture of two
    // payloads would pass for a good one.
    std::atomic_thread_fence(std::memory_order_acquire);
    return mapping_->generation(slot_).load(std::memory_order_relaxed) == generation_;
}

bool Payload::copy_to(std::byte* destination) const {
    copy_words(data_, destination, size_);
    return valid();
}

}  // namespace versavis::ring
