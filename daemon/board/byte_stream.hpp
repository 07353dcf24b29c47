// SPDX-License-Identifier: BSD-3-Clause
// Bytes to and from the board, whatever carries them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "settings/configuration.hpp"
#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::daemon {

/// How many bytes came together, and when.
struct Chunk {
    HostTime received;
    std::size_t size = 0;  ///< 0: nothing came in time
};

/// Most bytes that come together: some 40 packets of the board.
inline constexpr std::size_t largest_chunk = 4096;

/// read() belongs to one thread, write() to one other.
class ByteStream {
 public:
    virtual ~ByteStream() = default;

    /// Waits up to `timeout` for bytes; `into` has room for the largest chunk. Error: the board is
    /// gone.
    virtual Expected<Chunk> read(std::span<std::uint8_t> into, Duration timeout) = 0;

    /// Writes all or fails; waits for a slow board a bounded time. Somebody must be reading.
    virtual Expected<> write(std::span<const std::uint8_t> bytes) = 0;

    /// Names the place that the board is plugged in at, the same each time.
    virtual std::string port() const = 0;
};

/// Opens the link of the configuration. Error: there is no such board, or it may not be opened.
Expected<std::unique_ptr<ByteStream>> open_byte_stream(const BoardConfiguration& configuration);

}  // namespace versavis::daemon
