// SPDX-License-Identifier: BSD-3-Clause
// The whole rig: board, cameras and IMU of a scenario, running until it is destroyed.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "board_host.hpp"
#include "gige_camera.hpp"
#include "ground_truth.hpp"
#include "scenario.hpp"

namespace versavis::rig {

class Rig {
 public:
    /// Errors: an address or the socket is taken; the ground truth cannot be written.
    static Expected<std::unique_ptr<Rig>> start(const Scenario& scenario,
                                                const std::string& socket_path,
                                                const std::string& truth_path);

    /// Cameras outlive the board, and must not show it anything more.
    ~Rig();
    Rig(const Rig&) = delete;
    Rig& operator=(const Rig&) = delete;

 private:
    Rig(HostTime zero, const Scenario& scenario) : surroundings_(zero, scenario) {}

    Surroundings surroundings_;
    std::unique_ptr<GroundTruth> truth_;
    std::vector<std::unique_ptr<GigeCamera>> cameras_;
    std::unique_ptr<BoardHost> board_;
};

}  // namespace versavis::rig
