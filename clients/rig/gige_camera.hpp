// SPDX-License-Identifier: BSD-3-Clause
// An emulated GigE Vision camera: control server, trigger input, exposure line, frames.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "camera_view.hpp"
#include "event_sender.hpp"
#include "gige_registers.hpp"
#include "ground_truth.hpp"
#include "gvsp_transmitter.hpp"
#include "posix/file_descriptor.hpp"
#include "scenario.hpp"
#include "skewed_clock.hpp"
#include "triggered_camera.hpp"

namespace versavis::rig {

class GigeCamera final : public TriggeredCamera {
 public:
    /// Binds the control port. Error: the address does not exist or is taken.
    static Expected<std::unique_ptr<GigeCamera>> create(const Scenario& scenario,
                                                        const CameraScenario& settings,
                                                        HostTime zero,
                                                        const Surroundings& surroundings,
                                                        GroundTruth& truth);
    ~GigeCamera() override;
    GigeCamera(const GigeCamera&) = delete;
    GigeCamera& operator=(const GigeCamera&) = delete;

    std::optional<LineActive> trigger_line(bool level, const TriggerPulse& pulse) override;

    /// Calls `afflict` at the exposure of each of these faults, counted since the rig's start.
    void afflict_board(std::vector<Fault> faults, std::function<void(const Fault&)> afflict);

    const CameraScenario& settings() const override { return settings_; }

 private:
    GigeCamera(const Scenario& scenario, const CameraScenario& settings, HostTime zero,
               const Surroundings& surroundings, GroundTruth& truth, const CameraFamily& family,
               FileDescriptor socket, FileDescriptor broadcast_socket);

    void serve();
    void receive(int socket);
    void handle(std::span<const std::uint8_t> packet, const sockaddr_in& from);
    std::vector<std::uint8_t> answer(std::uint16_t command, std::span<const std::uint8_t> body,
                                     const sockaddr_in& from, std::uint16_t& status);
    std::uint16_t write_register(std::uint32_t address, std::uint32_t value,
                                 const sockaddr_in& from);
    bool in_control(const sockaddr_in& from) const;
    void lose_controller();
    bool acquiring();
    void start_acquisition();
    void stop_acquisition();
    void configure_stream();
    void configure_messages();
    void send_event(CameraEventId id, HostTime at, std::uint64_t block_id);
    void power_cycle();
    void free_run(HostTime now);
    bool pending(std::uint16_t command, std::span<const std::uint8_t> body) const;
    bool muted() const { return host_now().ns < muted_until_ns_.load(); }

    using Interval = std::pair<HostTime, HostTime>;
    std::optional<Interval> expose(HostTime trigger, const TriggerPulse* pulse);
    std::vector<Interval> take_trigger(const TriggerPulse& pulse);
    double exposures_to_make();
    std::optional<LineActive> shown(const std::vector<Interval>& exposures) const;
    bool ignores(const TriggerPulse* pulse);
    std::uint64_t ticks(HostTime at) const;
    bool exposes_by_itself() const;
    Duration exposure_at(HostTime at) const;
    const Fault* active_fault(FaultKind kind) const;
    void next_block_id();
    Missing missing_part() const;
    std::vector<std::uint8_t> chunks(Duration exposure, std::uint64_t block_id) const;
    void apply_outages();
    void report_ptp(HostTime at);

    CameraScenario settings_;
    std::vector<Fault> faults_;
    HostTime zero_;
    GroundTruth& truth_;
    SkewedClock clock_;
    CameraFamily family_;
    GigeRegisters registers_;
    CameraView view_;
    GvspTransmitter transmitter_;

    std::mutex mutex_;  ///< guards what follows, down to busy_until_
    bool acquiring_ = false;
    std::uint64_t block_id_ = 0;
    std::int64_t clock_step_ns_ = 0;
    std::uint64_t camera_time_ns_ = 0;  ///< of the newest frame
    std::uint64_t exposures_ = 0;
    std::uint64_t triggers_taken_ = 0;
    std::mt19937_64 random_;  ///< draws the triggers that it ignores
    HostTime busy_until_;
    HostTime free_run_next_;
    std::vector<Fault> board_faults_;
    std::function<void(const Fault&)> afflict_board_;

    sockaddr_in controller_{};  ///< used by the server thread only
    HostTime last_contact_;
    std::atomic<std::int64_t> muted_until_ns_{INT64_MIN};
    std::atomic<bool> power_cycle_pending_{false};
    std::atomic<bool> stop_{false};
    FileDescriptor socket_;
    FileDescriptor broadcast_socket_;  ///< receives discovery; none on loopback
    EventSender events_;
    std::thread server_;
};

}  // namespace versavis::rig
