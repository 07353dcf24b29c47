// SPDX-License-Identifier: BSD-3-Clause
// What a hostile or broken camera says of itself.
#pragma once

#include <cstdint>
#include <string>

namespace versavis::rig {

enum class Hostility {
    none,
    value_loop,      ///< a feature's value is its own
    formula_loop,    ///< two formulas need each other
    offset_loop,     ///< an index is offset by what it is the index of
    many_paths,      ///< each of 40 features needs the next one twice
    size_64_bit,     ///< the description has 2^63 bytes
    size_2_gib,      ///< ... 2^31
    zip_bomb,        ///< 2 MB of zip are 2 GB of text
    truncated,       ///< the description ends in its middle
    long_register,   ///< a name of 2^40 bytes
    local_file,      ///< the description is a file of the host
    huge_frames,     ///< frames of 2^40 bytes
    no_numbers,      ///< numbers that lead nowhere
    pending,         ///< asked for the size of its frames, it says "pending" for ever
    pending_at_all,  ///< ... whatever it is asked
};

struct GigeDescription {
    std::string url;
    std::string bytes;
};

/// `honest`: the description in XML, which will lie at this address.
GigeDescription describe_camera(Hostility hostility, const std::string& honest,
                                std::uint32_t address);

}  // namespace versavis::rig
