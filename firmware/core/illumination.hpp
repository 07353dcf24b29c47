// SPDX-License-Identifier: BSD-3-Clause
// Light while any camera exposes, never for longer than allowed: the hardware lets the exposure
// lines through only while the gate is open, and the closing of the gate is set before it opens.
#pragma once

#include "exposure_tracker.hpp"
#include "output_queue.hpp"

namespace versavis::firmware {

/// Plans when the light's gate opens and closes, from the planned and the actual exposures, within
/// the limits on on-time and duty. Part of Board, called from Board::poll() only.
class Illumination {
 public:
    Illumination(OutputQueue& outputs, ChannelReports& reports);

    void configure(const wire::IlluminationConfiguration& configuration, Nanoseconds now);

    /// Dark at once; what was planned is forgotten.
    void stop(Nanoseconds now);

    /// A camera will expose; without an exposure line the light follows the plan alone.
    void plan(std::uint8_t camera, Nanoseconds start, Nanoseconds duration, bool has_strobe,
              Nanoseconds now);

    /// An exposure line changed, bounces included.
    void edge(std::uint8_t camera, bool exposing);

    /// The levels of these lines are unknown from here on, until they change.
    void edges_lost(std::uint32_t lines);

    /// An edge of the gate due at `asked` left at `left`: the light was on for longer.
    void moved(bool open, Nanoseconds asked, Nanoseconds left);

    /// All edges before `settled` were passed on: what came later may be unknown.
    void poll(Nanoseconds now, Nanoseconds settled);
    /// When poll() has something to do next; it learns of edges `lag` after they came.
    Nanoseconds next_wake(Nanoseconds lag) const {
        const Nanoseconds wake = next_end();
        return wake == never ? never : wake + lag;
    }

 private:
    struct Plan {
        Nanoseconds on;
        Nanoseconds lead_off;
    };
    static constexpr std::size_t max_plans = 8;

    bool lights(std::uint8_t camera) const { return (configuration_.cameras >> camera & 1U) != 0; }
    bool open() const { return gate_off_ != never; }
    Nanoseconds earned(Nanoseconds span) const;
    Nanoseconds budget(Nanoseconds at) const;
    bool exposes_before(Nanoseconds at) const;
    Nanoseconds next_end() const;
    void set_leads(Nanoseconds now);
    void open_next(Nanoseconds now);
    void open_gate(Nanoseconds on);
    void close_gate(Nanoseconds now);
    static Nanoseconds awaited_until(const Plan& plan);
    void forget_past(Nanoseconds settled);

    OutputQueue& outputs_;
    ChannelReports& reports_;
    wire::IlluminationConfiguration configuration_{};
    std::size_t plan_count_ = 0;
    std::uint8_t exposing_ = 0;  ///< cameras whose line is active
    bool over_ = false;          ///< the last exposure of this light has ended
    Nanoseconds gate_on_ = 0;
    Nanoseconds awaited_until_ = 0;       ///< exposures of this light that should have begun
    Nanoseconds gate_off_ = never;        ///< never: the gate is closed
    Nanoseconds dark_until_ = INT64_MIN;  ///< after the limit was reached
    Nanoseconds last_off_ = INT64_MIN;    ///< when the gate was last commanded to close
    Nanoseconds saved_ = 0;               ///< on-time that may be spent, as of saved_at_
    Nanoseconds saved_at_ = 0;
    Plan plans_[max_plans] = {};
};

}  // namespace versavis::firmware
