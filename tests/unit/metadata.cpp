// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/metadata.hpp"

#include <catch2/catch.hpp>
#include <string>
#include <vector>

using namespace versavis;

namespace {

/// The names of the values from `first` to the last that has one.
template <typename Kind>
std::vector<std::string> names(std::uint32_t first) {
    std::vector<std::string> found;
    for (std::uint32_t value = first; value < 300; ++value)
        found.emplace_back(to_string(static_cast<Kind>(value)));
    while (!found.empty() && found.back() == "unknown") found.pop_back();
    return found;
}

}  // namespace

TEST_CASE("metadata: each kind of stamp has its name") {
    CHECK(names<StampKind>(0) ==
          std::vector<std::string>{"measured", "predicted", "trigger", "arrival"});
}

TEST_CASE(
    "metadata: each kind of event has its name, by which configurations and scripts know it") {
    CHECK(names<EventKind>(0) == std::vector<std::string>{"unknown",
                                                          "trigger_without_frame",
                                                          "frame_without_trigger",
                                                          "trigger_skipped",
                                                          "stray_edge",
                                                          "output_late",
                                                          "board_connected",
                                                          "board_lost",
                                                          "camera_connected",
                                                          "camera_lost",
                                                          "pairing_locked",
                                                          "pairing_slipped",
                                                          "edge_overflow",
                                                          "pps",
                                                          "aux_pulse",
                                                          "sync_pulse",
                                                          "input_noisy",
                                                          "illumination_limited",
                                                          "imu_ready",
                                                          "imu_failed",
                                                          "imu_silent",
                                                          "utc_label",
                                                          "message_doubted",
                                                          "stream_stepped",
                                                          "output_clock_stepped",
                                                          "triggers_skipped",
                                                          "sync_lost",
                                                          "sync_taken",
                                                          "configuration_stored",
                                                          "seconds_differ",
                                                          "host_undisciplined",
                                                          "time_pulse"});
}

TEST_CASE("metadata: each reason has its name, and none that is no longer used") {
    CHECK(names<EventReason>(0) == std::vector<std::string>{"none",
                                                            "frame_incomplete",
                                                            "frame_missing",
                                                            "exposure_missing",
                                                            "unproved",
                                                            "mismatch",
                                                            "unknown",
                                                            "no_clock",
                                                            "wrong_size",
                                                            "reset",
                                                            "trigger_ignored",
                                                            "camera_busy",
                                                            "too_late",
                                                            "queue_full",
                                                            "out_of_order",
                                                            "no_buffer",
                                                            "camera_silent",
                                                            "wrong_exposure",
                                                            "implausible_number",
                                                            "implausible_time",
                                                            "implausible_length",
                                                            "implausible_flags",
                                                            "not_yet",
                                                            "too_old",
                                                            "went_back"});
}
