// SPDX-License-Identifier: BSD-3-Clause
// The payload of an item, read in place: it keeps its segment mapped, and knows whether the writer
// has touched it since.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>

#include "export.hpp"

namespace versavis::ring {

class Mapping;

/// Memory stays readable as long as this object lives, whatever becomes of reader, service and
/// file. Its content does not: the writer needs the slot again. What was read in place is good if
/// valid() is true *afterwards*. Thread-safe.
class VERSAVIS_API Payload {
 public:
    Payload() = default;  ///< of an item without payload
    Payload(std::shared_ptr<const Mapping> mapping, std::uint32_t slot, std::uint64_t generation,
            std::uint32_t size);

    const std::byte* data() const { return data_; }  ///< nullptr: there is none
    std::size_t size() const { return size_; }       ///< bytes

    /// What is said of it beside it, by kind of stream; no_attributes: nothing, or an older service
    /// wrote it.
    std::uint64_t attributes() const;

    /// True while the writer has not touched it: what was read before this call is good.
    bool valid() const;

    /// Copies size() bytes to `destination`; false when the writer overtook the copy.
    bool copy_to(std::byte* destination) const;

 private:
    std::shared_ptr<const Mapping> mapping_;
    const std::byte* data_ = nullptr;
    std::uint64_t generation_ = 0;
    std::uint32_t slot_ = 0;
    std::uint32_t size_ = 0;
};

}  // namespace versavis::ring
