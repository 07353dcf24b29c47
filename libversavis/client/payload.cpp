// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/ring_payload.hpp"

#include <atomic>
#include <cstring>

#include "client/segment.hpp"

namespace versavis::ring {

namespace {

/// Copies what the writer may be overwriting. Writer and driver fill slots with plain stores, so to
/// the language this is a data race whatever is done here; the copy may mix two items, and only
/// valid() afterwards (SYNC 4) decides whether it is good. After the barrier the compiler takes
/// whatever the copy holds, instead of reading the source once more.
#if defined(__SANITIZE_THREAD__)
#define VERSAVIS_THREAD_SANITIZER
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define VERSAVIS_THREAD_SANITIZER
#endif
#endif

#ifdef VERSAVIS_THREAD_SANITIZER
/// Its memcpy would be reported.
__attribute__((no_sanitize("thread"))) void copy_bytes(std::byte* to, const std::byte* from,
                                                       std::size_t size) {
    for (std::size_t i = 0; i < size; ++i)
        to[i] = *static_cast<const volatile std::byte*>(from + i);
}
#else
void copy_bytes(std::byte* to, const std::byte* from, std::size_t size) {
    if (size > 0) std::memcpy(to, from, size);
    asm volatile("" ::: "memory");
}
#endif

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
    copy_bytes(destination, data_, size_);
    return valid();
}

}  // namespace versavis::ring
