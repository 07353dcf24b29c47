// SPDX-License-Identifier: BSD-3-Clause
// A mapped ring: typed views of its parts, for writer and reader.
#pragma once

#include <array>
#include <boost/interprocess/file_mapping.hpp>
#include <boost/interprocess/mapped_region.hpp>
#include <filesystem>
#include <optional>
#include <utility>

#include "posix/file_descriptor.hpp"
#include "versavis/error.hpp"
#include "versavis/ring_layout.hpp"

namespace versavis::ring {

/// What a header says once and for all. It is read once: what the writer, or somebody in its place,
/// changes there later leads nobody astray.
struct Constants {
    std::uint64_t total_size;
    std::uint64_t generation;
    std::uint32_t writer_pid;
    StreamKind kind;
    std::uint64_t writer_start_ticks;
    std::uint32_t descriptor_count;
    std::uint32_t slot_count;
    std::uint64_t slot_size;
    std::uint64_t descriptors_at;
    std::uint64_t generations_at;
    std::uint64_t slots_at;
    std::array<char, sizeof Header::name> name;
    std::uint64_t life;
    std::uint64_t pid_namespace;
    std::uint64_t time_namespace;
    bool has_attributes;  ///< its slots have
};

/// Device and inode: distinguishes a segment from its successor of the same name.
using FileId = std::pair<std::uint64_t, std::uint64_t>;

/// Of the file that has this name now; zeros: none has.
FileId file_id(const std::filesystem::path& path);

/// A segment that is open, and what has its name: of a sealed one, a socket.
struct NamedFile {
    FileDescriptor file;
    FileId name;
};

/// Owns a mapping of a complete segment. The views stay valid as long as it lives.
class Mapping {
 public:
    enum class Access { read_only, read_write };

    /// Maps and checks `path`; every offset is checked to lie inside the file. Ownership is not
    /// checked.
    static Expected<Mapping> open(const std::filesystem::path& path, Access access);

    /// The same of a file that is open; `path` is for messages.
    static Expected<Mapping> open(const NamedFile& file, const std::filesystem::path& path,
                                  Access access);

    /// Maps a file that is still being filled in: nothing is checked. Say read_constants() when its
    /// header is complete.
    static Expected<Mapping> open_unchecked(int file, const std::filesystem::path& path,
                                            Access access);

    /// Has all pages at hand, so that none is waited for when it is first touched; a writer's are
    /// huge ones where the kernel gives them. `path` is for messages. Errors: the memory for them
    /// is not there.
    Expected<> populate(const std::filesystem::path& path) const;

    /// What stays for a reader that lets go of a segment: its constants, the last words of its
    /// header and no item, in memory of its own, closed, and without a name. Errors: no memory.
    Expected<Mapping> remains() const;

    Header& header() const { return *static_cast<Header*>(region_.get_address()); }
    const Constants& constants() const { return constants_; }
    Descriptor& descriptor(std::uint64_t number) const {
        return reinterpret_cast<Descriptor*>(
            bytes() + constants_.descriptors_at)[number & (constants_.descriptor_count - 1)];
    }
    std::atomic<std::uint64_t>& generation(std::uint32_t slot) const {
        return words(slot).generation;
    }
    std::atomic<std::uint64_t>& attributes(std::uint32_t slot) const {
        return words(slot).attributes;
    }
    std::byte* slot(std::uint32_t slot) const {
        return bytes() + constants_.slots_at + slot * constants_.slot_size;
    }
    std::size_t size() const { return region_.get_size(); }
    FileId name() const { return name_; }

    void read_constants();

 private:
    SlotWords& words(std::uint32_t slot) const {
        return reinterpret_cast<SlotWords*>(bytes() + constants_.generations_at)[slot];
    }
    std::byte* bytes() const { return static_cast<std::byte*>(region_.get_address()); }

    boost::interprocess::mapped_region region_;
    Constants constants_{};
    FileId name_{};
};

}  // namespace versavis::ring
