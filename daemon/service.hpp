// SPDX-License-Identifier: BSD-3-Clause
// The whole service: board link, cameras and IMU wired to their rings.
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "board/asymmetry_store.hpp"
#include "board/board_link.hpp"
#include "board/grid_alignment.hpp"
#include "camera/camera.hpp"
#include "configuration/configuration.hpp"
#include "engine/ring/directory.hpp"
#include "stream/camera_pipeline.hpp"
#include "stream/clock_recorder.hpp"
#include "stream/event_journal.hpp"
#include "stream/imu_pipeline.hpp"
#include "stream/status.hpp"

namespace versavis::daemon {

class Service final : private BoardListener {
 public:
    /// Errors: the instance is served by another process, the rings cannot be made, the output
    /// clock is not set.
    static Expected<std::unique_ptr<Service>> create(const Configuration& configuration);
    ~Service() override;
    Service(const Service&) = delete;
    Service& operator=(const Service&) = delete;

    void start();

    /// Bounded waits and heartbeats; call it every 50 ms or so.
    void tick();

    /// "ok", "starting" or "degraded", as of the last status document.
    const std::string& health() const { return health_; }

    static constexpr Duration tick_interval = milliseconds(50);

 private:
    struct CameraUnit {
        CameraConfiguration configuration;
        std::unique_ptr<CameraPipeline> pipeline;
        std::unique_ptr<Camera> camera;
    };

    Service(const Configuration& configuration, ring::OwnedDirectory directory,
            clock::OutputClock output, ring::Writer status_ring);

    Expected<> make_parts();
    void add_camera(const CameraConfiguration& configuration);
    void publish_status(HostTime now);
    std::vector<StreamStatus> stream_status(HostTime now);
    const CameraUnit* find_camera(const std::string& name) const;
    CameraUnit* camera_at(unsigned output);
    void start(CameraPipeline& pipeline, pairing::Start how);
    void start_camera(CameraUnit& unit, pairing::Start how);

    void use_asymmetry_of(const std::string& port);
    void align_grid(HostTime now);
    void keep_asymmetry(const clock::ClockReport& clock, const std::string& port);

    void board_restarted() override;
    void board_synchronised() override;
    void board_connected() override;
    void board_lost() override;
    void exposure(const wire::Exposure& record) override;
    void imu_sample(const wire::ImuSample& sample) override;
    void board_event(const wire::Event& event) override;

    Configuration configuration_;
    ring::OwnedDirectory directory_;
    clock::Translator translator_;
    ring::Writer status_ring_;
    AsymmetryStore asymmetries_;
    std::string asymmetry_port_;  ///< to which what the translator uses belongs
    Duration kept_asymmetry_;
    std::unique_ptr<EventJournal> events_;
    std::unique_ptr<ClockRecorder> clock_recorder_;
    std::vector<std::unique_ptr<ImuPipeline>> imus_;
    CameraEnvironment environment_;
    std::vector<CameraUnit> cameras_;
    GridAlignment alignment_;
    std::unique_ptr<BoardLink> board_;
    HostTime started_;
    HostTime next_status_;
    std::map<std::string, std::pair<std::uint64_t, HostTime>> last_items_;
    std::string health_ = "starting";
};

}  // namespace versavis::daemon
