// SPDX-License-Identifier: BSD-3-Clause
// What the firmware's core is loaded with: lives of a board in virtual time, recorded.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "recorder.hpp"
#include "world.hpp"

namespace versavis::emulator {

using scenario::Nanoseconds;

/// A life that was recorded.
struct Lived {
    firmware::replay::Recorder recorder;
    Nanoseconds measured_for = 0;
    std::vector<wire::ImuSample> samples;  ///< of both ports
};

struct Load {
    const char* name;
    const char* what;
    bool steady;               ///< it has a rate of polls and a share of the processor
    Nanoseconds measured_for;  ///< of a steady one, and enough for a figure
    void (*live)(scenario::World& world, firmware::replay::Recorder& recorder,
                 Nanoseconds measured_for);
};

const std::vector<Load>& loads();

/// By its name; throws when there is none.
const Load& load(const std::string& name);

/// Measures a steady load for `measured_for`.
std::unique_ptr<Lived> live(const Load& load, Nanoseconds measured_for);

}  // namespace versavis::emulator
