// SPDX-License-Identifier: BSD-3-Clause
// Edges of the inputs: the watcher's changes and the stamper's counts, written side by side into
// two rings.
#pragma once

#include "board_clock.hpp"
#include "state_machine.hpp"

namespace versavis::rp2040 {

class EdgePort final : public firmware::EdgeStream {
 public:
    explicit EdgePort(BoardClock& clock) : clock_(clock) {
        for (Nanoseconds& rise : rise_) rise = firmware::never;
    }

    void set_up();

    void listen(std::uint32_t inputs) override;
    bool pop(firmware::Edge& edge) override;
    Nanoseconds settled() override { return settled_; }
    std::uint32_t take_lost() override;

    /// Exposure lines whose low level means exposing, for the state machines too.
    void invert(std::uint32_t inputs);

    /// From the interrupt of the block: something has changed.
    void changed();
    /// From the interrupt of a channel: its count is used up.
    void continue_rings();

    /// True: edges are to be popped, of another input than data-ready or more than half of what
    /// fits. False: the next change causes an interrupt.
    bool wants_attention();

    /// Inputs have changed since that was last asked, which the interrupt may have told already.
    bool has_changed() const { return (pio(0).flags >> watcher::flag & 1U) != 0; }

    /// When a data-ready input rose for the last time that is known; never: it did not.
    Nanoseconds last_rise(std::uint8_t input);

    static constexpr unsigned capacity = 512;

    /// After that time an edge is in the rings for certain, whatever else the channels do. At half,
    /// it may not be; at twice, all edges are known a microsecond later.
    static constexpr Nanoseconds known_after = 1'000;

 private:
    static constexpr unsigned ring_bits = 11;
    static_assert(capacity * sizeof(std::uint32_t) == 1U << ring_bits);

    void set_up_machines();
    void set_up_rings();
    void apply(std::uint32_t pins);
    void wait_for_rings() const;
    std::uint32_t written(unsigned ring) const;
    std::uint32_t arrived() const;
    void scan();
    void take_change();
    std::uint32_t quiet(std::uint32_t index);
    void drop_all();
    Nanoseconds time_of(std::uint32_t index) const;

    BoardClock& clock_;
    StateMachine watcher_{0, watcher::machine};
    StateMachine stamper_{0, stamper::machine};
    volatile std::uint32_t runs_[2] = {};  ///< of each ring, that have ended
    std::uint32_t stamps_ahead_ = 0;       ///< the stamp of a change lies so much further on
    std::uint32_t read_ = 0;               ///< changes read so far
    std::uint32_t scanned_ = 0;            ///< changes looked at so far
    Nanoseconds scanned_at_ = 0;
    std::uint32_t scanned_left_ = 0;   ///< until their next runs both rings had so many to get
    std::uint32_t state_ = 0;          ///< of the pins, after what was read
    std::uint32_t scanned_state_ = 0;  ///< after what was looked at
    std::uint32_t changes_ = 0;        ///< pins whose edges in state_ are still to be popped
    Nanoseconds changed_at_ = 0;       ///< all of them
    std::uint32_t lost_ = 0;
    std::uint32_t listened_ = 0;  ///< pins
    std::uint32_t inverted_ = 0;  ///< pins
    bool attention_ = false;
    Nanoseconds settled_ = 0;
    /// Pins whose changes are, for now, none of the line, but of what the watcher sees of it.
    std::uint32_t quiet_ = 0;
    std::uint32_t quiet_until_[watched_inputs] = {};
    Nanoseconds rise_[watched_inputs];
};

}  // namespace versavis::rp2040
