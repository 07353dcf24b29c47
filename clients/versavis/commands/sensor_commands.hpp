// SPDX-License-Identifier: BSD-3-Clause
// The commands `versavis evaluate imu`, `allan` and `clock`.
#pragma once

#include <CLI/App.hpp>
#include <functional>
#include <string>

#include "evaluate/imu_evaluation.hpp"

namespace versavis::client {

class SensorCommands {
 public:
    /// Adds the commands to `evaluate`; `stop` returns true when the program is to end.
    SensorCommands(CLI::App& evaluate, std::function<bool()> stop);
    SensorCommands(const SensorCommands&) = delete;  // options write to the members
    SensorCommands& operator=(const SensorCommands&) = delete;

    bool chosen() const;
    int run();

 private:
    void add_imu(CLI::App& evaluate);
    void add_allan(CLI::App& evaluate);
    void add_clock(CLI::App& evaluate);
    int run_imu(const Recording& recording);
    int run_allan(const Recording& recording) const;
    int run_clock(const Recording& recording) const;
    int fail(const Error& error) const;

    CLI::App* imu_ = nullptr;
    CLI::App* allan_ = nullptr;
    CLI::App* clock_ = nullptr;
    std::function<bool()> stop_;
    std::string file_;
    bool json_ = false;
    ImuEvaluationSettings settings_;
    double range_ms_ = 500;
    std::string yaml_;
    std::string topic_;
};

}  // namespace versavis::client
