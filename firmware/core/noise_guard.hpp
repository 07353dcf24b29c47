// SPDX-License-Identifier: BSD-3-Clause
// Keeps an input that never stops changing, such as one that is not connected, from taking all the
// time, and leaves out the echoes of pulses.
#pragma once

#include "base/hal.hpp"
#include "wire/configuration.hpp"

namespace versavis::firmware {

/// An input with more edges than any sensor makes is ignored for a second.
class NoiseGuard {
 public:
    explicit NoiseGuard(EdgeStream& edges) : edges_(edges) {}

    /// Inputs that are in use.
    void listen(std::uint32_t inputs) {
        inputs_ = inputs;
        muted_ = 0;
        edges_.listen(inputs);
    }

    /// False: this edge was one too many; the input is ignored for a second.
    bool take(const Edge& edge) {
        if (edge.at - window_ >= window) {
            window_ = edge.at;
            for (std::uint16_t& count : counts_) count = 0;
        }
        const std::uint16_t most = is_data_ready(edge.input) ? most_ready : most_changes;
        if (++counts_[edge.input] <= most) return true;
        if ((muted_ >> edge.input & 1U) != 0)
            return true;  // stamped before the input was switched off
        muted_ |= 1U << edge.input;
        until_ = edge.at + silence;
        edges_.listen(inputs_ & ~muted_);
        return false;
    }

    void poll(Nanoseconds now) {
        if (muted_ == 0 || now < until_) return;
        muted_ = 0;
        edges_.listen(inputs_);
    }

    Nanoseconds next_wake() const { return muted_ == 0 ? never : until_; }

 private:
    static constexpr Nanoseconds window = 10'000'000;
    /// Edges within a window. A camera at 1 kHz makes 20, a LiDAR at 5 kHz 100. If lower, the
    /// latter is noise; if higher, noise takes more time.
    static constexpr std::uint16_t most_changes = 128;
    /// 8 kHz makes 80. If lower, that is noise; if higher, noise takes more time.
    static constexpr std::uint16_t most_ready = 160;
    /// If lower, a floating input takes more time; if higher, an input that recovered waits.
    static constexpr Nanoseconds silence = 1'000'000'000;

    EdgeStream& edges_;
    std::uint32_t inputs_ = 0;
    std::uint32_t muted_ = 0;
    Nanoseconds until_ = 0;
    Nanoseconds window_ = 0;
    std::uint16_t counts_[input_count] = {};
};

/// Pulses closer to the one before than a source can send them are its echoes.
class EchoFilter {
 public:
    explicit constexpr EchoFilter(Nanoseconds width) : width_(width) {}

    /// False: an echo.
    bool take(Nanoseconds at) {
        if (at - newest_ < width_) return false;
        newest_ = at;
        return true;
    }

 private:
    Nanoseconds width_;
    Nanoseconds newest_ = INT64_MIN / 2;
};

}  // namespace versavis::firmware
