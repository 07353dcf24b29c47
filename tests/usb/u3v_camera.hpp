// SPDX-License-Identifier: BSD-3-Clause
// An emulated USB3 Vision camera: control channel, trigger input, stream of frames.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "u3v_registers.hpp"
#include "usbfs_node.hpp"

namespace versavis::test {

class U3vCamera final : public UsbFunction {
 public:
    /// What the host may learn about an exposure, and what became of its frame.
    struct Exposure {
        std::uint64_t block_id;
        std::uint64_t start_ns;  ///< of the camera's clock: what the leader carries
        bool sent;
    };

    /// A frame made elsewhere: scene, clock and exposure are not the camera's own.
    struct Shot {
        std::uint64_t timestamp_ns = 0;
        std::chrono::nanoseconds until_sent{};  ///< from now to the leader
        std::span<const std::uint8_t> pixels;   ///< must outlive the camera
        std::vector<std::uint8_t> mark;         ///< replaces the first pixels
        std::function<void(bool sent)> done;
    };
    /// Takes the next block id; none: it does not acquire.
    std::optional<std::uint64_t> shoot(Shot shot);
    /// An edge to this level would trigger an exposure.
    bool listens(bool level) const;
    float exposure_us() const { return registers_.real(reg_exposure_time); }

    enum class Defect { none, no_leader, half_payload, no_trailer, payload_like_leader, too_long };

    explicit U3vCamera(const U3vRegisters::Identity& identity);
    ~U3vCamera() override;

    /// The trigger line changed. Returns true if the camera exposes.
    bool trigger_line(bool level);

    /// Faults.
    void stall_data();
    void mute(bool muted) {
        muted_ = muted;
    }  ///< the control channel takes commands and never answers
    void answer_late(unsigned pending_ms) {
        pending_ms_ = pending_ms;
    }  ///< next command, by a PENDING_ACK
    void drop_frames(unsigned count) { drop_ = count; }
    void spoil_frame(Defect defect) { defect_ = defect; }  ///< the next one

    std::uint64_t halts_cleared() const { return halts_cleared_; }
    std::deque<Exposure> exposures() const;
    bool streaming() const;

    const UsbDescription& description() const override { return description_; }
    void receive(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) override;
    void halt_cleared(std::uint8_t endpoint) override;
    void plugged(bool in) override;

 private:
    struct Frame {
        std::uint64_t due_ns;
        std::uint64_t start_ns;
        std::uint64_t block_id;
        Shot shot{};
    };

    struct Answer {
        std::uint64_t due_ns;
        Bytes packet;
    };

    std::uint16_t read_memory(std::span<const std::uint8_t> command, Bytes& body) const;
    std::uint16_t write_memory(std::span<const std::uint8_t> command, Bytes& body);
    void written(std::uint32_t address);
    bool expose(std::uint64_t at_ns);
    void run();
    void transmit(const Frame& frame);
    void send_leader(const Frame& frame);
    void send_payload(const Frame& frame, Defect defect);
    void send_trailer(const Frame& frame);
    bool stream_enabled() const { return (registers_.bootstrap(sirm_control) & 1U) != 0; }

    UsbDescription description_;
    U3vRegisters registers_;

    std::mutex sending_;        ///< held while a frame goes to the node: an unplug waits for it
    mutable std::mutex mutex_;  ///< guards what follows, down to exposures_
    std::condition_variable changed_;
    bool plugged_ = false;
    bool acquiring_ = false;
    bool stop_ = false;
    std::uint64_t block_id_ = 0;
    std::uint64_t busy_until_ns_ = 0;
    std::uint64_t free_run_next_ns_ = 0;
    std::deque<Frame> frames_;
    std::deque<Answer> late_answers_;
    std::deque<Exposure> exposures_;

    std::atomic<bool> muted_{false};
    std::atomic<unsigned> pending_ms_{0};
    std::atomic<unsigned> drop_{0};
    std::atomic<Defect> defect_{Defect::none};
    std::atomic<std::uint64_t> halts_cleared_{0};
    std::thread thread_;
};

}  // namespace versavis::test
