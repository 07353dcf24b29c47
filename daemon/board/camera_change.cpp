// SPDX-License-Identifier: BSD-3-Clause
#include "board/camera_change.hpp"

namespace versavis::daemon {

CameraChange camera_change(const wire::Configuration& before, const wire::Configuration& after) {
    if (((before.flags | after.flags) & wire::configuration_store) != 0) return {};
    CameraChange change{wire::changed_cameras(before, after), 0};
    const auto in = [](std::uint8_t mask, unsigned camera) { return (mask >> camera & 1U) != 0; };
    for (unsigned i = 0; i < wire::camera_count; ++i)
        if (in(change.outputs, i) && before.cameras[i].rate_uhz != after.cameras[i].rate_uhz)
            change.other_rate = static_cast<std::uint8_t>(change.other_rate | 1U << i);
    for (unsigned i = 0; i < wire::camera_count; ++i)
        for (unsigned other = 0; other < wire::camera_count; ++other)
            if (in(change.other_rate, i) && !in(change.other_rate, other) &&
                (after.cameras[other].flags & wire::camera_enabled) != 0 &&
                after.cameras[other].rate_uhz == after.cameras[i].rate_uhz)
                return {};
    return change;
}

}  // namespace versavis::daemon
