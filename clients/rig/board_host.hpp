// SPDX-License-Identifier: BSD-3-Clause
// Runs the firmware in real time behind a unix socket, wired to the emulated cameras and the IMU.
#pragma once

#include <array>
#include <atomic>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "../../firmware/native/virtual_board.hpp"
#include "adis_device.hpp"
#include "board.hpp"
#include "camera_view.hpp"
#include "emulated_board.hpp"
#include "engine/clock/output_clock.hpp"
#include "genicam_camera.hpp"
#include "ground_truth.hpp"
#include "posix/file_descriptor.hpp"
#include "skewed_clock.hpp"

namespace versavis::rig {

class BoardHost {
 public:
    /// Error: the socket cannot be created.
    static Expected<std::unique_ptr<BoardHost>> create(const World& world,
                                                       const std::string& socket_path,
                                                       std::vector<GenicamCamera*> cameras);
    ~BoardHost();
    BoardHost(const BoardHost&) = delete;
    BoardHost& operator=(const BoardHost&) = delete;

    /// From now on, for as long as the fault says. Callable from any thread.
    void suffer(const Fault& fault);

    /// An auxiliary input shows this. Callable from any thread.
    void show_auxiliary(const CameraScenario& camera, const LineActive& line);

 private:
    BoardHost(const World& world, std::string socket_path, std::vector<GenicamCamera*> cameras,
              std::unique_ptr<EmulatedChip> chip, FileDescriptor listener);

    void run();
    void live();
    void boot(firmware::Identity identity, const ClockErrors& clock, HostTime zero);
    void restart();
    void wait(HostTime until) const;
    void exchange_bytes();
    void hear_gnss(HostTime now);
    void hear_sync(HostTime now);
    void hear_auxiliaries();
    HostTime signal_samples(HostTime now);
    void accept_host();
    void drop_host();
    void reset() { reset_pending_ = true; }
    bool suffers(FaultKind kind) const;
    void plug(bool in);
    void write_late(HostTime now);
    void outputs_changed(firmware::Nanoseconds at, std::uint32_t pins);
    void show_exposure(const CameraScenario& camera, const LineActive& line);
    void line_changes(const CameraScenario& camera, HostTime at, bool active);
    void imu_transfer(firmware::Nanoseconds at, const firmware::ImuTransfer& transfer,
                      std::span<std::uint8_t> received);
    firmware::Nanoseconds board_now() const { return clock_->device_ns(host_now()); }

    std::string serial_;
    std::uint64_t seed_;
    ClockErrors clock_errors_;
    std::optional<clock::OutputClock> utc_;  ///< what the GNSS receiver sends, if there is one
    Duration sync_period_;                   ///< of another board's pulses; 0: there are none
    Duration link_delay_;
    std::string imu_name_;
    std::string socket_path_;
    devices::AdisDevice imu_;
    TimingBoard* leds_;  ///< nullptr: there is none
    GroundTruth& truth_;
    std::vector<GenicamCamera*> cameras_;
    FileDescriptor listener_;
    FileDescriptor host_;

    std::unique_ptr<SkewedClock> clock_;
    std::unique_ptr<EmulatedChip> chip_;  ///< none: the core runs in this process
    std::unique_ptr<firmware::VirtualBoard> board_;
    std::uint64_t life_ = 0;
    std::uint32_t pins_ = 0;
    std::uint64_t pulses_[firmware::camera_count] = {};
    struct TimePin {
        unsigned pin;
        const char* name;
        HostTime rise;  ///< the newest
    };
    TimePin time_pins_[2] = {{firmware::pin_sync, "sync", {}}, {firmware::pin_test, "test", {}}};
    std::uint32_t imu_serial_ = 0;  ///< of the newest sample that was read
    HostTime signalled_{};          ///< until here edges of the data-ready line are scheduled
    std::int64_t next_utc_s_ = 0;   ///< the second that the receiver marks next; 0: the coming one
    HostTime next_sync_{};          ///< when the other board's next pulse comes
    using Parcels = std::deque<std::pair<HostTime, std::vector<std::uint8_t>>>;
    Parcels late_;    ///< on its way to the host
    Parcels coming_;  ///< on its way from there
    bool plugged_ = true;
    struct AuxiliaryEdge {
        HostTime at;
        std::uint8_t input;
        bool level;
    };
    std::mutex auxiliary_mutex_;
    std::vector<AuxiliaryEdge> auxiliary_edges_;  ///< that the board is still to hear of
    std::array<std::atomic<std::int64_t>, fault_kinds> suffers_until_ns_{};
    std::atomic<std::int64_t> lateness_ns_{0};  ///< of late records
    std::atomic<bool> reset_pending_{false};
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

}  // namespace versavis::rig
