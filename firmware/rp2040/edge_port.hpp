// SPDX-License-Identifier: BSD-3-Clause
// Edges of the inputs: the watcher's words, each with levels and a count, written into a ring.
#pragma once

#include "board_clock.hpp"
#include "loop_signal.hpp"
#include "sample_clock.hpp"
#include "state_machine.hpp"

namespace versavis::rp2040 {

/// Turns the watcher's words into stamped edges for the core. The main loop takes them; changed()
/// and count_run() are called from interrupts.
class EdgePort final : public firmware::EdgeStream {
 public:
    EdgePort(BoardClock& clock, LoopSignal& loop) : clock_(clock), loop_(loop) {
        for (Nanoseconds& rise : rise_) rise = firmware::never;
    }

    void set_up();

    void listen(std::uint32_t inputs) override;
    bool pop(firmware::Edge& edge) override;
    Nanoseconds settled() override { return settled_; }
    std::uint32_t take_lost() override;
    wire::StampTest stamp_test() override { return stamp_test_; }

    /// Exposure lines whose low level means exposing, for the state machines too.
    void invert(std::uint32_t inputs);

    /// From the interrupt of the block: something has changed.
    void changed();
    /// From the interrupt of a channel: the other one goes on.
    void count_run();

    /// True: edges are to be popped, of another input than data-ready or more than half of what
    /// fits. False: the next change causes an interrupt.
    bool wants_attention();

    /// Inputs have changed since the last call; the interrupt may have reported it already.
    bool has_changed() const { return (pio(0).flags >> watcher::flag & 1U) != 0; }

    /// When a data-ready input rose for the last time that is known; never: it did not.
    Nanoseconds last_rise(std::uint8_t input);

    static constexpr unsigned capacity = 512;

    /// After that time an edge is in the ring for certain, whatever else the channels do. If lower,
    /// it may not be; if higher, all edges are known a microsecond later.
    static constexpr Nanoseconds known_after = 1'000;

 private:
    static constexpr unsigned ring_bits = 11;
    static_assert(capacity * sizeof(std::uint32_t) == 1U << ring_bits);

    void set_up_machine();
    void set_up_ring();
    void apply(std::uint32_t pins);
    void wait_for_ring() const;
    std::uint32_t written() const;
    bool overwritten(std::uint32_t index) const;
    void scan();
    void scan_word(std::uint32_t word, std::uint32_t now_low_ns);
    void take_change();
    std::uint32_t quiet(std::uint32_t index);
    void drop_all();
    void loop_came_back();
    void judge_loop(bool as_expected);

    BoardClock& clock_;
    LoopSignal& loop_;
    StateMachine watcher_{0, watcher::machine};
    volatile std::uint32_t runs_ = 0;  ///< of the channels, that have ended
    std::uint32_t read_ = 0;           ///< words read so far
    std::uint32_t scanned_ = 0;        ///< words looked at so far
    std::uint32_t scanned_low_ns_ = 0;
    SampleClock samples_;              ///< of the words looked at
    std::uint32_t state_ = 0;          ///< of the pins, after what was read
    std::uint32_t scanned_state_ = 0;  ///< after what was looked at
    std::uint32_t changes_ = 0;        ///< pins whose edges in state_ are still to be popped
    Nanoseconds changed_at_ = 0;       ///< all of them
    std::uint32_t lost_ = 0;
    std::uint32_t listened_ = 0;  ///< pins
    std::uint32_t inverted_ = 0;  ///< pins
    unsigned loops_good_ = 0;     ///< edges through the loop, one after the other
    wire::StampTest stamp_test_ = wire::StampTest::none;
    bool attention_ = false;
    Nanoseconds settled_ = 0;
    /// Pins whose changes are, for now, none of the line, but of what the watcher sees of it.
    std::uint32_t quiet_ = 0;
    std::uint32_t quiet_until_[watched_inputs] = {};
    Nanoseconds rise_[watched_inputs];
    std::uint32_t low_ns_[capacity];  ///< of the changes that were looked at
};

}  // namespace versavis::rp2040
