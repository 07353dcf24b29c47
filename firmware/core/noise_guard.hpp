// SPDX-License-Identifier: BSD-3-Clause
// Keeps an input that never stops changing, such as one that is not connected, from taking all the
// time.
#pragma once

#include "hal.hpp"

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
        if (edge.input >= input_count || ++counts_[edge.input] < limit) return true;
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
    static constexpr std::uint16_t limit = 400;  // both edges of 8 kHz make 160
    static constexpr Nanoseconds silence = 1'000'000'000;

    EdgeStream& edges_;
    std::uint32_t inputs_ = 0;
    std::uint32_t muted_ = 0;
    Nanoseconds until_ = 0;
    Nanoseconds window_ = 0;
    std::uint16_t counts_[input_count] = {};
};

}  // namespace versavis::firmware
