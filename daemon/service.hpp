// SPDX-License-Identifier: BSD-3-Clause
// The whole service: board link, cameras and IMUs wired to their rings.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "board/asymmetry_keeper.hpp"
#include "board/board_link.hpp"
#include "board/grid_alignment.hpp"
#include "board/tick_numbers.hpp"
#include "board/time_announcer.hpp"
#include "board/trigger_grid.hpp"
#include "camera_group.hpp"
#include "control/control.hpp"
#include "engine/ring/directory.hpp"
#include "health/clock_step_detector.hpp"
#include "health/status_publisher.hpp"
#include "pipeline/imu_pipeline.hpp"
#include "pipeline/nmea_pipeline.hpp"
#include "plausibility/event_validator.hpp"
#include "publish/clock_recorder.hpp"
#include "publish/event_journal.hpp"
#include "settings/configuration.hpp"

namespace versavis::daemon {

class Service final : public Controlled, private BoardListener {
 public:
    /// Errors: the instance is served by another process, the rings cannot be made, the output
    /// clock is not set.
    static Expected<std::unique_ptr<Service>> create(const Configuration& configuration);
    ~Service() override;
    Service(const Service&) = delete;
    Service& operator=(const Service&) = delete;

    void start();

    /// Ends all, in bounded time. False: a device still keeps a thread waiting, and the process
    /// must end without destroying anything.
    bool stop();

    /// Bounded waits and heartbeats; call it every 50 ms or so.
    void tick();

    /// Takes effect at once: what only cameras need is theirs alone; what the board has stops the
    /// cameras that it concerns until it is configured anew.
    void reconfigure(const Configuration& configuration) override;
    void ask(const std::string& camera, CameraWish wish) override;
    ChangeReport changes(const std::string& camera) const override;
    bool report_lidars(const std::vector<LidarReport>& reports) override;

    const std::filesystem::path& directory() const { return directory_.path(); }

    /// As of the last status document.
    const Summary& health() const { return status_.summary(); }

    static constexpr Duration tick_interval = milliseconds(50);

 private:
    Service(const Configuration& configuration, ring::OwnedDirectory directory,
            clock::OutputClock output, StatusPublisher status);

    Expected<> make_rings();
    Expected<> make_cameras();
    bool board_needed() const {
        return !imus_.empty() || cameras_->any_needs_board() || time_announcer_.wanted();
    }
    void announce(HostTime now);
    void check_time_pulse(const wire::Event& event, HostTime received);
    void use_pps(const wire::Event& event);
    Status collect_status(HostTime now);
    void report_output_step(const OutputStep& step);
    void report_hidden_clock();
    void report_discipline(const clock::KernelState& kernel);

    // On the link's thread.
    void board_restarted() override;
    void board_configured(const wire::ConfigurationAnswer& answer) override;
    void board_synchronised() override;
    void board_connected() override;
    void cameras_changed(std::uint8_t outputs, std::uint8_t other_rate) override;
    void board_lost() override;
    void exposure(const wire::Exposure& record, HostTime received) override;
    bool imu_sample(const wire::ImuSample& sample, HostTime received) override;
    void exchange_doubted(const Implausibility& doubt) override;
    void board_event(const wire::Event& event, HostTime received) override;
    void sentence(const wire::Sentence& sentence, HostTime received) override;

    Configuration configuration_;                       ///< of the main thread
    const std::vector<std::string> time_output_names_;  ///< for the link's
    ring::OwnedDirectory directory_;
    clock::Translator translator_;
    StatusPublisher status_;
    ClockStepDetector output_steps_;
    bool host_disciplined_ = true;
    AsymmetryKeeper asymmetry_;
    GridAlignment alignment_;
    TimeAnnouncer time_announcer_;
    LidarReports lidars_;
    TickNumbers ticks_;  ///< of the link's thread
    TriggerGrid grid_;   ///< the same
    std::unique_ptr<EventJournal> events_;
    EventValidator event_witness_{translator_};
    std::unique_ptr<ClockRecorder> clock_recorder_;
    std::vector<std::unique_ptr<ImuPipeline>> imus_;
    NmeaPipeline nmea_{translator_};
    std::unique_ptr<BoardLink> board_;
    std::unique_ptr<CameraGroup> cameras_;
    std::atomic<bool> unkept_{false};  ///< the board could not store its configuration
    HostTime started_;
    HostTime changed_;  ///< by request
};

}  // namespace versavis::daemon
