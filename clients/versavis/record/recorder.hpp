// SPDX-License-Identifier: BSD-3-Clause
// Records the streams of an instance, as one reader among others.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "versavis/error.hpp"
#include "versavis/ring_layout.hpp"
#include "versavis/time.hpp"

namespace versavis::client {

struct StreamReport {
    ring::StreamKind kind = ring::StreamKind::events;
    std::uint64_t items = 0;
    std::uint64_t lost = 0;      ///< overtaken before, or while, they were written
    std::uint64_t restarts = 0;  ///< of the service
    std::uint64_t epochs = 0;    ///< that began within
    OutputTime first;
    OutputTime last;
};

struct RecordReport {
    std::vector<std::string> files;
    std::uint64_t bytes = 0;
    Duration duration;
    std::map<std::string, StreamReport> streams;
    std::uint64_t slips = 0;                      ///< of the pairing, by events
    std::vector<std::string> not_in_camera_info;  ///< calibrated cameras, and why
    std::vector<std::string> left_out;            ///< streams that could not be read, and why
    std::optional<OutputTime> from;               ///< where `before` wanted it to begin
    std::optional<Error> stopped_early;           ///< the disk's; what was written before is good

    std::uint64_t items() const;
    std::uint64_t lost() const;
};

struct RecordSettings {
    std::string instance;
    std::vector<std::string> streams;  ///< none: all, also those that come later
    /// File; empty: `versavis-DATE-TIME.mcap`. With '/' at its end a new folder: NAME/NAME.mcap,
    /// further files, and metadata.yaml.
    std::string output;
    std::optional<Duration> length;
    std::uint64_t split_bytes = 0;  ///< 0: one file
    std::optional<Duration> split_length;
    std::optional<Duration> before;  ///< of what the rings still hold
    bool png = false;
    std::vector<std::string> calibration;  ///< files: camchain.yaml, imu.yaml
    std::function<bool()> stop = [] { return false; };
    /// Once a second: what there is so far, and how many bytes the disk still takes.
    std::function<void(const RecordReport&, std::uint64_t)> progress = [](const RecordReport&,
                                                                          std::uint64_t) {};
};

/// Until `stop`, `length` or a full disk. Errors: there is nothing to record, a named stream cannot
/// be read, the file cannot be made.
Expected<RecordReport> record(const RecordSettings& settings);

}  // namespace versavis::client
