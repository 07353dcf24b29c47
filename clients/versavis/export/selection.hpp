// SPDX-License-Identifier: BSD-3-Clause
// What of a recording is exported to others' tools, what is left out, and why.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "export/frame_set_table.hpp"
#include "recording/recording.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

struct ExportChoice {
    std::vector<std::string> streams;   ///< cameras and IMUs, in this order; empty: all, by name
    bool include_suspect = false;       ///< whatever its stamp is worth
    bool keep_repeated = false;         ///< IMU samples that repeat the one before
    bool join = false;                  ///< one sequence, whatever lies between its parts
    std::optional<Duration> max_sigma;  ///< none: 5 ms, or any with include_suspect
};

/// Called on the way, seldom enough to print.
struct ExportWatch {
    std::function<void(const char* what, std::uint64_t done, std::uint64_t all)> progress;
    std::function<bool()> stop;

    bool stopped() const { return stop && stop(); }
    void show(const char* what, std::uint64_t done, std::uint64_t all) const {
        if (progress) progress(what, done, all);
    }
};

struct SelectedFrame {
    std::uint32_t camera;
    OutputTime time;
    OutputTime name;  ///< of its set: the first camera's stamp
    ItemPlace place;
};

struct SelectedSample {
    std::uint32_t imu;
    OutputTime time;
    ItemPlace place;
    std::uint64_t number;
};

struct LeftOutItem {
    std::uint32_t stream;  ///< cameras first, then IMUs
    OutputTime time;
    std::uint64_t number;
    std::uint64_t tick;
    SkipReason reason;
};

struct SelectedCamera {
    std::string name;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::uint32_t pixel_format = 0;
    double rate_hz = 0;
    std::uint64_t frames = 0;
    std::uint32_t largest_sigma_ns = 0;
};

struct SelectedImu {
    std::string name;
    double rate_hz = 0;
    std::uint64_t samples = 0;
    Duration filter_delay;          ///< of the last sample: already subtracted from its stamp
    Duration longest_gap;           ///< between samples of one sequence
    std::int32_t accel_age_ns = 0;  ///< the largest
    std::uint32_t largest_sigma_ns = 0;
};

struct SelectedSequence {
    SequenceBounds bounds;
    std::vector<SelectedFrame> frames;    ///< set by set
    std::vector<SelectedSample> samples;  ///< in the order of the file
    std::uint64_t sets = 0;
    /// Of what is exported. None of either: earliest after latest.
    OutputTime first = SequenceBounds::latest;
    OutputTime last = SequenceBounds::earliest;
};

struct Selection {
    std::vector<SelectedCamera> cameras;
    std::vector<SelectedImu> imus;
    std::vector<SelectedSequence> sequences;  ///< at least one
    std::vector<LeftOutItem> left_out;
    std::uint64_t sets = 0;
    std::uint64_t seconds_doubted = 0;  ///< stamps that may be off by whole seconds

    const std::string& stream(std::uint32_t index) const {
        return index < cameras.size() ? cameras[index].name : imus[index - cameras.size()].name;
    }
};

/// Errors: no such stream, nothing to export, the file is damaged, stopped.
Expected<Selection> select_items(const Recording& recording, const ExportChoice& choice,
                                 const ExportWatch& watch);

/// The error of a command that was stopped.
Unexpected<Error> stopped_error();

}  // namespace versavis::client
