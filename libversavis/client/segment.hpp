// SPDX-License-Identifier: BSD-3-Clause
// A mapped ring: typed views of its parts, for writer and reader.
#pragma once

#include <array>
#include <boost/interprocess/file_mapping.hpp>
#include <boost/interprocess/mapped_region.hpp>
#include <filesystem>

#include "versavis/error.hpp"
#include "versavis/ring/layout.hpp"

namespace versavis::ring {

/// What a header says once and for all. It is read once: what the writer, or somebody in its place,
/// changes there later leads nobody astray.
struct Constants {
    std::uint64_t total_size = 0;
    std::uint64_t generation = 0;
    std::uint32_t writer_pid = 0;
    StreamKind kind{};
    std::uint64_t writer_start_ticks = 0;
    std::uint32_t descriptor_count = 0;
    std::uint32_t slot_count = 0;
    std::uint64_t slot_size = 0;
    std::uint64_t descriptors_at = 0;
    std::uint64_t generations_at = 0;
    std::uint64_t slots_at = 0;
    std::array<char, sizeof Header::name> name{};
};

/// Owns a mapping of a complete segment. The views stay valid as long as it lives.
class Mapping {
 public:
    enum class Access { read_only, read_write };

    /// Maps and checks `path`; every offset is checked to lie inside the file.
    static Expected<Mapping> open(const std::filesystem::path& path, Access access);

    /// Maps a file that is still being filled in: nothing is checked. Say read_constants() when its
    /// header is complete.
    static Expected<Mapping> open_unchecked(const std::filesystem::path& path, Access access);

    Header& header() const { return *static_cast<Header*>(region_.get_address()); }
    const Constants& constants() const { return constants_; }
    Descriptor& descriptor(std::uint64_t number) const {
        return reinterpret_cast<Descriptor*>(
            bytes() + constants_.descriptors_at)[number & (constants_.descriptor_count - 1)];
    }
    std::atomic<std::uint64_t>& generation(std::uint32_t slot) const {
        return *reinterpret_cast<std::atomic<std::uint64_t>*>(bytes() + constants_.generations_at +
                                                              slot * generation_stride);
    }
    std::byte* slot(std::uint32_t slot) const {
        return bytes() + constants_.slots_at + slot * constants_.slot_size;
    }
    std::size_t size() const { return region_.get_size(); }

    void read_constants();

 private:
    std::byte* bytes() const { return static_cast<std::byte*>(region_.get_address()); }

    boost::interprocess::mapped_region region_;
    Constants constants_;
};

/// Field 22 of /proc/<pid>/stat; 0: there is no such process, or only its remains. With the process
/// id it identifies a process until reboot.
std::uint64_t start_ticks_of(std::uint32_t pid);
std::uint64_t start_ticks_of_this_process();

/// True when this process made the segment.
bool is_own(const Header& header);

/// Ends a segment: marks it as `state` and wakes its readers.
void retire(Header& header, WriterState state);

/// Wakes every process that waits on the futex `word`. std::atomic::notify would reach this process
/// only.
void futex_wake(const std::atomic<std::uint32_t>& word);

/// Waits until `word` is no longer `value`, or `timeout_ns` has passed; may also return early.
void futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t value,
                std::int64_t timeout_ns);

}  // namespace versavis::ring
