// SPDX-License-Identifier: BSD-3-Clause
// Writes ROS 1 bags, format 2.0.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "posix/file.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

enum class BagCompression { none, lz4 };

/// A message type of ROS 1.
struct BagType {
    std::string name;
    std::string md5;
    std::string definition;
};

/// Nothing is a bag before finish(). Messages come in the order of their times, as readers that go
/// by the bag's time expect them; index records are exact in any order.
class BagWriter {
 public:
    /// Error: cannot be created, or is there already.
    static Expected<BagWriter> create(const std::string& path, BagCompression compression);

    std::uint32_t add_connection(const std::string& topic, const BagType& type);

    /// `time_ns` from 0 to 2^32 s. The message is `head` and then `body`.
    Expected<> write(std::uint32_t connection, std::int64_t time_ns,
                     std::span<const std::byte> head, std::span<const std::byte> body = {});

    Expected<> finish();

    std::uint64_t bytes() const { return at_; }

 private:
    struct Connection {
        std::string record;
        bool listed = false;  ///< in a chunk
    };
    struct Entry {
        std::uint64_t time;  ///< seconds in the lower half, nanoseconds in the upper
        std::uint32_t offset;
    };
    struct ChunkInfo {
        std::uint64_t position;
        std::uint64_t first;
        std::uint64_t last;
        std::map<std::uint32_t, std::uint32_t> messages;
    };

    BagWriter(std::string path, FileDescriptor file, BagCompression compression);
    Expected<> append(std::string_view bytes);
    Expected<> end_chunk();
    Expected<std::vector<std::byte>> compressed() const;

    std::string path_;
    FileDescriptor file_;
    BagCompression compression_;
    std::uint64_t at_ = 0;
    std::vector<Connection> connections_;
    std::vector<std::byte> chunk_;
    std::map<std::uint32_t, std::vector<Entry>> index_;
    std::vector<ChunkInfo> chunks_;
};

}  // namespace versavis::client
