// SPDX-License-Identifier: BSD-3-Clause
// The byte layout of a shared-memory ring, as docs/contracts/shm-layout.md fixes it for every
// language.
//
// How writer and reader synchronise. The code names the pair at each half.
//
// | pair   | word        | writer                      | reader                                  |
// |--------|-------------|-----------------------------|-----------------------------------------|
// | SYNC 1 | head        | release, write_descriptor() | acquire, Reader::head()                 |
// | SYNC 2 | sequence    | release, 2n + 2 stored last | acquire, first load, Reader::read()     |
// | SYNC 3 | sequence    | release fence after 2n + 1  | acquire fence before the second load    |
// | SYNC 4 | generation  | release fence after odd     | acquire fence in Payload::valid()       |
// | SYNC 5 | wake        | release, add                | acquire, Reader::next(timeout)          |
// | SYNC 6 | state       | release, supersede()/end()  | acquire, writer_lives()                 |
// | SYNC 7 | magic       | release, stored last        | acquire, Mapping::open()                |
//
// 1 and 2 publish: a reader that sees the number sees all that was written before it. 3 and 4
// withdraw: a reader that saw anything of the next item sees, in a second look, that the word has
// changed. 5 orders waiting, 6 the end of a segment, 7 its beginning. `heartbeat_ns` is relaxed on
// both sides: it is compared with the time, and nothing else is read because of it.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace versavis::ring {

inline constexpr std::uint64_t magic = 0x5349564153524556U;  ///< "VERSAVIS" as little-endian bytes
inline constexpr std::uint32_t abi_major = 1;
inline constexpr std::uint32_t abi_minor = 10;
inline constexpr std::size_t page_size = 4096;
inline constexpr std::size_t generation_stride = 64;  ///< one cache line for each slot's words
inline constexpr std::size_t metadata_words = 12;
inline constexpr std::size_t metadata_size = metadata_words * 8;
inline constexpr std::uint32_t no_slot = 0xFFFFFFFFU;  ///< the item lies in the descriptor alone

using Metadata = std::array<std::uint64_t, metadata_words>;

enum class StreamKind : std::uint32_t {
    frames = 1,
    imu = 2,
    events = 3,
    status = 4,
    evidence = 5,
    clock = 6,
    nmea = 7
};

enum class WriterState : std::uint32_t { live = 1, closed = 2, superseded = 3 };

/// Header page. Words that change lie on cache lines of their own.
struct Header {
    std::atomic<std::uint64_t> magic;  ///< stored last: what is read after it is complete (SYNC 7)
    std::uint32_t abi_major;
    std::uint32_t abi_minor;
    std::uint64_t total_size;
    std::uint64_t generation;  ///< random: distinguishes this segment from its predecessor
    std::uint8_t boot_id[16];
    std::uint32_t writer_pid;
    StreamKind kind;
    std::uint64_t writer_start_ticks;  ///< field 22 of /proc/<pid>/stat
    std::uint32_t descriptor_count;    ///< a power of two
    std::uint32_t slot_count;
    std::uint64_t slot_size;  ///< bytes of payload, a multiple of the page size
    std::uint64_t descriptors_at;
    std::uint64_t generations_at;
    std::uint64_t slots_at;
    char name[64];                 ///< zero-terminated
    std::uint64_t life;            ///< equal in all segments that one run of a service made
    std::uint64_t pid_namespace;   ///< inode of the writer's /proc/self/ns/pid; 0: unknown
    std::uint64_t time_namespace;  ///< of its /proc/self/ns/time; 0: unknown, or there are none

    alignas(128) std::atomic<std::uint64_t> head;   ///< items published since creation (SYNC 1)
    alignas(128) std::atomic<std::uint32_t> wake;   ///< futex word: bumped by each publication and
                                                    ///< change of state (SYNC 5)
    alignas(128) std::atomic<std::uint32_t> state;  ///< WriterState (SYNC 6)
    alignas(128)
        std::atomic<std::int64_t> heartbeat_ns;  ///< host time of the writer's last sign of life
};

/// One published item. Item n lies in descriptor n % descriptor_count.
struct alignas(128) Descriptor {
    std::atomic<std::uint64_t>
        sequence;  ///< 2n + 2 once item n is complete, 2n + 1 while it is written (SYNC 2, 3)
    std::atomic<std::uint64_t> slot_generation;  ///< the slot's generation word when published
    std::atomic<std::uint64_t> length_and_slot;  ///< length << 32 | slot
    std::atomic<std::int64_t> output_time_ns;
    std::array<std::atomic<std::uint64_t>, metadata_words> metadata;
};

/// What changes with the payload of a slot.
struct alignas(generation_stride) SlotWords {
    std::atomic<std::uint64_t> generation;  ///< odd while the writer may touch the slot (SYNC 4)
    std::atomic<std::uint64_t> attributes;  ///< of the payload, by kind of stream; since ABI 1.6
};

/// Of a payload that has none: a pair of NaN.
inline constexpr std::uint64_t no_attributes = 0x7FC000007FC00000U;

static_assert(offsetof(Header, total_size) == 16 && offsetof(Header, boot_id) == 32);
static_assert(offsetof(Header, writer_pid) == 48 && offsetof(Header, kind) == 52);
static_assert(offsetof(Header, writer_start_ticks) == 56 &&
              offsetof(Header, descriptor_count) == 64);
static_assert(offsetof(Header, slot_size) == 72 && offsetof(Header, descriptors_at) == 80);
static_assert(offsetof(Header, slots_at) == 96 && offsetof(Header, name) == 104);
static_assert(offsetof(Header, life) == 168 && offsetof(Header, pid_namespace) == 176);
static_assert(offsetof(Header, time_namespace) == 184);
static_assert(offsetof(Header, head) == 256 && offsetof(Header, wake) == 384);
static_assert(offsetof(Header, state) == 512 && offsetof(Header, heartbeat_ns) == 640);
static_assert(sizeof(Header) <= page_size && sizeof(Descriptor) == 128);
static_assert(sizeof(SlotWords) == 64 && offsetof(SlotWords, attributes) == 8);
static_assert(alignof(Descriptor) == 128 && offsetof(Descriptor, metadata) == 32);
static_assert(std::atomic<std::uint64_t>::is_always_lock_free &&
              std::atomic<std::uint32_t>::is_always_lock_free);

}  // namespace versavis::ring
