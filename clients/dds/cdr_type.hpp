// SPDX-License-Identifier: BSD-3-Clause
// Types of Cyclone DDS whose samples are CDR bytes as they stand, so that one code makes the
// messages of recordings and those of the network. Only for writers: nothing is taken apart again.
#pragma once

#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>

#include <cstddef>
#include <memory>
#include <span>
#include <string>

namespace versavis::dds {

/// A type without keys, in the representation of XCDR1. Of the caller, until a topic takes it.
ddsi_sertype* make_cdr_type(const std::string& name);

/// A sample that is being made: `bytes` begin with the four that say how it is encoded.
class CdrSample {
 public:
    explicit CdrSample(std::size_t size);

    std::span<std::byte> bytes() { return {bytes_.get(), size_}; }

    /// For dds_writecdr, which takes the reference.
    static ddsi_serdata* release(CdrSample sample, const ddsi_sertype& type);

 private:
    std::size_t size_;
    std::unique_ptr<std::byte[]> bytes_;  ///< up to a multiple of four, as the protocol sends them
};

}  // namespace versavis::dds
