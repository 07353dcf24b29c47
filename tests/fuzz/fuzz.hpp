// SPDX-License-Identifier: BSD-3-Clause
// What targets of the fuzzer share.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>

#include "posix/file_descriptor.hpp"

namespace versavis::fuzz {

using Bytes = std::span<const std::uint8_t>;

/// A file of these bytes, which is nowhere but in memory.
class MemoryFile {
 public:
    explicit MemoryFile(Bytes bytes) : file_(::memfd_create("fuzz", MFD_CLOEXEC)) {
        const auto size = static_cast<ssize_t>(bytes.size());
        if (::write(file_.get(), bytes.data(), bytes.size()) != size)
            throw std::runtime_error("a file in memory cannot be written");
    }

    std::string path() const { return "/proc/self/fd/" + std::to_string(file_.get()); }

 private:
    FileDescriptor file_;
};

/// Takes inputs apart: messages, each with a byte before it that says how long it is.
class Messages {
 public:
    explicit Messages(Bytes bytes) : rest_(bytes) {}

    bool empty() const { return rest_.empty(); }
    std::uint8_t byte() { return empty() ? std::uint8_t{0} : take(1)[0]; }

    /// Longer ones than 127 bytes have a length of two bytes.
    Bytes next() {
        std::size_t size = byte();
        if (size > 127) size = (size & 127U) << 8U | byte();
        return take(size);
    }

    Bytes take(std::size_t size) {
        const Bytes taken = rest_.first(std::min(size, rest_.size()));
        rest_ = rest_.subspan(taken.size());
        return taken;
    }

 private:
    Bytes rest_;
};

}  // namespace versavis::fuzz

// NOLINTNEXTLINE(readability-identifier-naming): libFuzzer looks for this name
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
