// SPDX-License-Identifier: BSD-3-Clause
#include "rig.hpp"

namespace versavis::rig {

namespace {

std::vector<Fault> board_faults(const Scenario& scenario, const std::string& camera) {
    std::vector<Fault> faults;
    for (const Fault& fault : scenario.faults)
        if (of_board(fault.kind) && fault.camera == camera) faults.push_back(fault);
    return faults;
}

}  // namespace

Expected<std::unique_ptr<Rig>> Rig::start(const Scenario& scenario, const std::string& socket_path,
                                          const std::string& truth_path) {
    const HostTime zero = host_now();
    std::unique_ptr<Rig> rig(new Rig(zero, scenario));
    auto truth = GroundTruth::create(truth_path);
    if (!truth) return Unexpected(truth.error());
    rig->truth_ = std::move(*truth);
    rig->truth_->add(rig->surroundings_.motion);
    std::vector<GigeCamera*> wired;
    for (const CameraScenario& settings : scenario.cameras) {
        auto camera =
            GigeCamera::create(scenario, settings, zero, rig->surroundings_, *rig->truth_);
        if (!camera) return Unexpected(camera.error());
        wired.push_back(camera->get());
        rig->cameras_.push_back(std::move(*camera));
    }
    auto board = BoardHost::create(scenario, socket_path, zero, rig->surroundings_, *rig->truth_,
                                   {wired.begin(), wired.end()});
    if (!board) return Unexpected(board.error());
    rig->board_ = std::move(*board);
    for (GigeCamera* camera : wired)
        camera->afflict_board(
            board_faults(scenario, camera->settings().name),
            [host = rig->board_.get()](const Fault& fault) { host->suffer(fault); });
    return rig;
}

}  // namespace versavis::rig
