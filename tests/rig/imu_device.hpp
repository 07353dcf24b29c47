// SPDX-License-Identifier: BSD-3-Clause
// An ADIS16448 as its SPI master sees it: answers a burst with the registers of that instant.
#pragma once

#include <cstdint>
#include <span>

#include "scene.hpp"

namespace versavis::rig {

class ImuDevice {
 public:
    explicit ImuDevice(const Motion& motion) : motion_(motion) {}

    /// One full-duplex burst that started at `at`; both spans have the same length.
    void burst(HostTime at, std::span<const std::uint8_t> transmitted,
               std::span<std::uint8_t> received) const;

 private:
    const Motion& motion_;
};

}  // namespace versavis::rig
