// SPDX-License-Identifier: BSD-3-Clause
// Board and USB3 Vision camera of a scenario on one simulated bus. The testbed must live in the
// process that runs under umockdev-wrapper: here board and camera do as well.
#pragma once

#include <umockdev.h>

#include <memory>
#include <stdexcept>
#include <string>

#include "board_host.hpp"
#include "scenario.hpp"
#include "simulated_device.hpp"
#include "u3v_camera.hpp"
#include "usb_bridge.hpp"

namespace versavis::test {

class UsbRig {
 public:
    /// The scenario's first camera; the board is also at the socket. Throws when it cannot be.
    UsbRig(const rig::Scenario& scenario, const std::string& socket, const std::string& truth)
        : testbed_(umockdev_testbed_new()),
          surroundings_(zero_, scenario),
          truth_(std::move(*rig::GroundTruth::create(truth))),
          world_{scenario, zero_, surroundings_, *truth_},
          camera(std::make_shared<U3vCamera>(world_, scenario.cameras.at(0))),
          device(testbed_.get(), "1-2", camera),
          board_(std::move(*rig::BoardHost::create(world_, socket, {&camera->camera()}))),
          bridge_(testbed_.get(), socket, scenario.board.serial) {}

    /// Another camera on the bus, which takes commands and never answers.
    void add_mute(rig::CameraScenario settings) {
        settings.serial = "MUTE";
        mute_ = std::make_shared<U3vCamera>(world_, settings);
        mute_->mute(true);
        mute_device_ = std::make_unique<SimulatedDevice>(testbed_.get(), "1-3", mute_);
    }

    /// For UMOCKDEV_DIR of other processes.
    std::string directory() const { return umockdev_testbed_get_root_dir(testbed_.get()); }

 private:
    GObjectPtr<UMockdevTestbed> testbed_;
    HostTime zero_ = host_now();
    rig::Surroundings surroundings_;
    std::unique_ptr<rig::GroundTruth> truth_;
    rig::World world_;

 public:
    std::shared_ptr<U3vCamera> camera;
    SimulatedDevice device;

 private:
    std::unique_ptr<rig::BoardHost> board_;
    UsbBridge bridge_;
    std::shared_ptr<U3vCamera> mute_;
    std::unique_ptr<SimulatedDevice> mute_device_;
};

}  // namespace versavis::test
