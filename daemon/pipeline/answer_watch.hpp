// SPDX-License-Identifier: BSD-3-Clause
// How a camera answers its triggers: which it takes, how its block ids count, and how fast its
// clock runs.
#pragma once

#include <cstdint>
#include <deque>

#include "engine/pairing/evidence.hpp"
#include "wire/messages.hpp"

namespace versavis::daemon {

struct AnswerReport {
    std::uint64_t ignored = 0;       ///< triggers whose exposure line stayed silent
    std::uint64_t ids_repeated = 0;  ///< frames with the block id of the one before
    std::uint64_t ids_restarted = 0;
    std::uint64_t ids_skipped = 0;  ///< by frames that did not arrive whole
    std::uint64_t block_id = 0;     ///< of the newest frame
    std::uint64_t every = 1;        ///< n: it takes every n-th trigger, and did so lately without
                                    ///< exception; else 1
    Duration lead;          ///< by which its exposure line rises before the trigger; 0: it does not
    Duration shortest;      ///< between two triggers that it took, lately; 0: unknown
    double clock_rate = 1;  ///< of its clock, when it cannot be a clock in nanoseconds; else 1
};

/// Not thread-safe.
class AnswerWatch {
 public:
    /// `period`: of the triggers.
    explicit AnswerWatch(Duration period) : period_(period) {}

    void recorded(const wire::Exposure& record);
    void arrived(const pairing::Arrival& arrival);

    /// A new stream of the camera, or a new life of the board. What was counted stays.
    void restart();

    const AnswerReport& report() const { return report_; }

 private:
    struct Take {
        std::uint64_t trigger = 0;
        BoardTime at;
    };
    struct Time {
        CameraTime camera;
        HostTime arrived;
    };

    void measure_lead(const wire::Exposure& record);
    void measure_takes();
    void measure_clock();

    Duration period_;
    std::deque<Take> takes_;
    int leads_ = 0;  ///< records in a row whose line rose with the next trigger
    std::deque<Time> times_;
    AnswerReport report_;
};

}  // namespace versavis::daemon
