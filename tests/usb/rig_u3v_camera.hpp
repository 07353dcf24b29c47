// SPDX-License-Identifier: BSD-3-Clause
// A camera of the rig that sends its frames by USB3 Vision.
#pragma once

#include <cmath>
#include <cstring>
#include <memory>
#include <mutex>

#include "ground_truth.hpp"
#include "motion.hpp"
#include "scene.hpp"
#include "simulated_device.hpp"
#include "skewed_clock.hpp"
#include "triggered_camera.hpp"
#include "u3v_camera.hpp"

namespace versavis::test {

class RigU3vCamera final : public rig::TriggeredCamera {
 public:
    RigU3vCamera(UMockdevTestbed* testbed, const std::string& port,
                 const rig::CameraScenario& settings, HostTime zero, const rig::Motion& motion,
                 rig::GroundTruth& truth, std::uint64_t seed)
        : settings_(settings),
          motion_(motion),
          truth_(truth),
          clock_(zero, settings.clock),
          wall_(settings.width, settings.height, seed),
          camera_(std::make_shared<U3vCamera>(U3vRegisters::Identity{
              "VersaVIS", "RigCamera", settings.serial, settings.width, settings.height})),
          device_(testbed, port, camera_) {}

    std::optional<rig::LineActive> trigger_line(bool level,
                                                const rig::TriggerPulse& pulse) override;
    const rig::CameraScenario& settings() const override { return settings_; }
    U3vCamera& camera() { return *camera_; }
    SimulatedDevice& device() { return device_; }

 private:
    std::optional<rig::LineActive> expose(const rig::TriggerPulse& pulse);

    rig::CameraScenario settings_;
    const rig::Motion& motion_;
    rig::GroundTruth& truth_;
    rig::SkewedClock clock_;
    rig::Wall wall_;
    std::uint64_t exposures_ = 0;
    HostTime busy_until_;
    std::shared_ptr<U3vCamera> camera_;
    SimulatedDevice device_;
};

}  // namespace versavis::test
