// SPDX-License-Identifier: BSD-3-Clause
#include "engine/board/board_words.hpp"

namespace versavis::board {

namespace {

/// By bit of wire::Present.
constexpr const char* names[part_count]{
    "camera0",    "camera1",     "camera2", "camera3",    "light", "sync_output", "test_output",
    "pps",        "aux0",        "aux1",    "sync_input", "spi",   "i2c",         "imu0_ready",
    "imu1_ready", "accel_ready", "uart",    "imu_output", "memory"};

}  // namespace

std::vector<std::string> part_names(std::uint32_t present) {
    std::vector<std::string> there;
    for (unsigned bit = 0; bit < part_count; ++bit)
        if ((present >> bit & 1U) != 0) there.emplace_back(names[bit]);
    return there;
}

const char* to_string(wire::ResetCause cause) {
    switch (cause) {
        case wire::ResetCause::power_on: return "power_on";
        case wire::ResetCause::pin: return "pin";
        case wire::ResetCause::watchdog: return "watchdog";
        case wire::ResetCause::brown_out: return "brown_out";
        case wire::ResetCause::software: return "software";
        case wire::ResetCause::update: return "update";
    }
    return "unknown";
}

const char* to_string(wire::PpsState state) {
    switch (state) {
        case wire::PpsState::none: return "none";
        case wire::PpsState::acquiring: return "acquiring";
        case wire::PpsState::good: return "good";
    }
    return "unknown";
}

const char* to_string(wire::SyncState state) {
    switch (state) {
        case wire::SyncState::none: return "none";
        case wire::SyncState::lost: return "lost";
        case wire::SyncState::followed: return "followed";
    }
    return "unknown";
}

const char* to_string(wire::StampTest test) {
    switch (test) {
        case wire::StampTest::none: return "none";
        case wire::StampTest::failed: return "failed";
        case wire::StampTest::passed: return "passed";
    }
    return "unknown";
}

}  // namespace versavis::board
