// SPDX-License-Identifier: BSD-3-Clause
#include "time_output_model.hpp"

#include "wire/limits.hpp"

namespace versavis::daemon {

const std::vector<TimeOutputModel>& time_output_models() {
    namespace limits = wire::limits;
    constexpr double shortest = limits::shortest_time_pulse_ns * 1e-6;
    constexpr double longest = limits::longest_time_pulse_ns * 1e-6;
    constexpr double last = limits::last_sentence_ms;
    static const std::vector<TimeOutputModel> all{
        {"generic", false, shortest, longest, {}, {}, {}, last, last},
        {"velodyne", true, 20, 200, {"RMC", "GGA"}, {9600}, 50, 500, last},
        {"ouster", false, shortest, longest, {"RMC"}, {9600, 115200}, {}, last, last},
        {"livox", false, 5, longest, {"RMC"}, {9600}, {}, 430, last},
        {"hesai", true, shortest, longest, {"RMC", "GGA"}, {}, 0, last, last},
        {"robosense", true, 20, 200, {"RMC"}, {9600}, {}, 500, 500}};
    return all;
}

}  // namespace versavis::daemon
