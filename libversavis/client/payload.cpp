// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/ring/payload.hpp"

#include <atomic>
#include <cstring>

#include "client/segment.hpp"

namespace versavis::ring {

namespace {

/// Copies what the writer may be overwriting. Writer and driver fill slots with plain stores, so to
/// the language this is a data race even with the atomic loads here. They make it one without
/// consequences: whole words that the compiler neither repeats nor leaves out, of any value. The
/// copy may mix two items; only valid() afterwards (SYNC 4) decides whether it is good.
void copy_words(const std::byte* source, std::byte* destination, std::size_t size) {
    const auto* words =
        reinterpret_cast<const std::atomic<std::uint64_t>*>(source);  // slots are page-aligned
    std::size_t i = 0;
    for (; i + 8 <= size; i += 8) {
        const std::uint64_t word = words[i / 8].load(std::memory_order_relaxed);
        std::memcpy(destination + i, &word, 8);
    }
    if (i < size) {
        const std::uint64_t word = words[i / 8].load(std::memory_order_relaxed);
        std::memcpy(destination + i, &word, size - i);
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

bool Payload::valid() const {
    if (!mapping_) return true;
    // SYNC 4: acquire fence here, release fence in Writer::acquire(): if anything that was read of
    // the payload came from a newer item, the generation has changed. Without it a mixture of two
    // payloads would pass for a good one.
    std::atomic_thread_fence(std::memory_order_acquire);
    return mapping_->generation(slot_).load(std::memory_order_relaxed) == generation_;
}

bool Payload::copy_to(std::byte* destination) const {
    if (size_ != 0) copy_words(data_, destination, size_);
    return valid();
}

}  // namespace versavis::ring
