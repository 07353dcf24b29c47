// SPDX-License-Identifier: BSD-3-Clause
// What really happened in the rig, as JSON lines; all times are CLOCK_MONOTONIC_RAW in nanoseconds.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "motion.hpp"
#include "posix/file_descriptor.hpp"
#include "versavis/error.hpp"
#include "versavis/time.hpp"

namespace versavis::rig {

struct TrueTrigger {
    std::string camera;
    std::uint64_t board_life = 0;
    std::uint64_t trigger = 0;  ///< pulses on this camera's line since the board's boot
    HostTime at;
    bool taken = false;  ///< false: the camera did not expose
};

struct TrueExposure {
    std::string camera;
    std::uint64_t board_life = 0;
    std::uint64_t trigger = 0;  ///< 0: free run
    std::uint64_t serial = 0;   ///< written into the first pixels of the frame
    std::uint64_t block_id = 0;
    HostTime start;
    HostTime end;
    bool sent = false;
};

/// The last packet of a frame left the camera.
struct TrueDeparture {
    std::string camera;
    std::uint64_t serial = 0;
    HostTime at;
};

struct TrueImuSample {
    std::string imu;
    std::uint64_t board_life = 0;
    std::uint32_t serial = 0;  ///< shown by the magnetometer
    HostTime at;
};

/// A pulse of at least 1 ms at the test or the sync output.
struct TruePulse {
    const char* output = "";
    HostTime start;
    HostTime end;
};

/// What the board sends on its serial line begins, or waits for what it sent before.
struct TrueSerial {
    HostTime at;
    std::uint32_t baud = 0;
    std::vector<std::uint8_t> bytes;
};

/// Thread-safe. Each record is one line, written immediately, since judges read along. Where a line
/// cannot be written, the file ends and standard error says why.
class GroundTruth {
 public:
    /// Empty path: nothing is written.
    static Expected<std::unique_ptr<GroundTruth>> create(const std::string& path);

    void add(const TrueTrigger& trigger);
    void add(const TrueExposure& exposure);
    void add(const TrueDeparture& departure);
    void add(const TrueImuSample& sample);
    void add(const TruePulse& pulse);
    void add(const TrueSerial& serial);
    void add(const Motion& motion);

 private:
    void write(const std::string& line);

    std::mutex mutex_;
    std::string path_;
    FileDescriptor file_;  ///< none: nothing is written
};

}  // namespace versavis::rig
