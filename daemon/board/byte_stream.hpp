// SPDX-License-Identifier: BSD-3-Clause
// Bytes to and from the board, whatever carries them.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "configuration/configuration.hpp"
#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

/// Bytes that came together, and when.
struct Chunk {
    HostTime received;
    std::vector<std::uint8_t> bytes;  ///< empty: nothing came in time
};

/// read() belongs to one thread, write() may be called by any other.
class ByteStream {
 public:
    virtual ~ByteStream() = default;

    /// Waits up to `timeout` for bytes. Error: the board is gone.
    virtual Expected<Chunk> read(Duration timeout) = 0;

    /// Writes all or fails; waits for a slow board a bounded time.
    virtual Expected<> write(std::span<const std::uint8_t> bytes) = 0;

    /// Names the place that the board is plugged in at, the same each time.
    virtual std::string port() const = 0;
};

/// Opens the link of the configuration. Error: there is no such board, or it may not be opened.
Expected<std::unique_ptr<ByteStream>> open_byte_stream(const BoardConfiguration& configuration);

}  // namespace versavis::daemon
