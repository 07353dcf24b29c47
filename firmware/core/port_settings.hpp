// SPDX-License-Identifier: BSD-3-Clause
// What settings of the ports mean.
#pragma once

#include "base/hal.hpp"

namespace versavis::firmware {

/// The output that a wire::TestOutput names.
constexpr unsigned output_of(std::uint8_t test_output) {
    if (test_output == wire::test_at_test) return output_test;
    return test_output == wire::test_at_sync ? unsigned{output_sync}
                                             : unsigned{test_output} - wire::test_at_camera0;
}

constexpr std::uint32_t nmea_baud(const wire::PortConfiguration& ports) {
    constexpr std::uint32_t usual = 9'600;
    return ports.nmea_baud == 0 ? usual : ports.nmea_baud;
}

}  // namespace versavis::firmware
