// SPDX-License-Identifier: BSD-3-Clause
// One measured figure and its goal, if it has one.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace versavis::bench {

struct Metric {
    std::string name;
    double value;
    std::string unit;
    std::optional<double> goal;  ///< met when the value is not above it

    bool met() const { return !goal || value <= *goal; }
};

/// Publication and reading of rings, against bare shared memory and other transports; each in
/// processes of its own.
std::vector<Metric> bench_ring();

/// Translation of host time to the output clock.
std::vector<Metric> bench_output_clock();

/// The service against Aravis's own test program on the same stream, and its stamps against the
/// rig's truth.
std::vector<Metric> bench_end_to_end();

/// Estimators of the board's clock in simulated worlds: errors, honesty of sigma, cost.
std::vector<Metric> bench_clock();

/// Three cameras and a fast IMU for `seconds`, and how soon a frame can be read, against a bare
/// callback.
std::vector<Metric> bench_cameras(double seconds);

/// How late a board's bytes are stamped under load, against one thread that reads and works.
std::vector<Metric> bench_link();

/// Three cameras and a fast IMU recorded for `seconds`: losses, processor time against bare
/// writing, PNG, the highest rate that a disk takes, a recorder that is stopped or killed.
/// `directory`: where to; empty: the current one, or memory where its disk is too slow.
std::vector<Metric> bench_record(double seconds, const std::string& directory);

/// How soon a camera delivers verified frames again after it, or the board, rebooted.
std::vector<Metric> bench_recovery();

/// Cycles, stack and memory of the firmware's core on the chip; prints which functions take the
/// cycles, if asked.
std::vector<Metric> bench_firmware(bool with_profile);

}  // namespace versavis::bench
