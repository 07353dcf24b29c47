// SPDX-License-Identifier: BSD-3-Clause
#include "rig.hpp"

namespace versavis::rig {

Expected<std::unique_ptr<Rig>> Rig::start(const Scenario& scenario, const std::string& socket_path,
                                          const std::string& truth_path) {
    const HostTime zero = host_now();
    std::unique_ptr<Rig> rig(new Rig(zero, scenario));
    auto truth = GroundTruth::create(truth_path);
    if (!truth) return Unexpected(truth.error());
    rig->truth_ = std::move(*truth);
    rig->truth_->add(rig->surroundings_.motion);
    const World world{scenario, zero, rig->surroundings_, *rig->truth_};
    std::vector<GenicamCamera*> wired;
    for (const CameraScenario& settings : scenario.cameras) {
        auto camera = GigeCamera::create(world, settings);
        if (!camera) return Unexpected(camera.error());
        wired.push_back(&(*camera)->camera());
        rig->cameras_.push_back(std::move(*camera));
    }
    auto board = BoardHost::create(world, socket_path, wired);
    if (!board) return Unexpected(board.error());
    rig->board_ = std::move(*board);
    for (GenicamCamera* camera : wired) {
        camera->afflict_board(
            [host = rig->board_.get()](const Fault& fault) { host->suffer(fault); });
        if (camera->settings().aux_input >= 0)
            camera->show_actions([host = rig->board_.get(), camera](const LineActive& line) {
                host->show_auxiliary(camera->settings(), line);
            });
    }
    return rig;
}

Rig::~Rig() {
    for (const auto& camera : cameras_) {
        camera->camera().afflict_board({});
        camera->camera().show_actions({});
    }
}

}  // namespace versavis::rig
