// SPDX-License-Identifier: BSD-3-Clause
// What the board counted while the service looked, from counters that run since the board's boot.
#pragma once

#include <optional>

#include "wire/messages.hpp"

namespace versavis::daemon {

class BoardCounters {
 public:
    /// The board began a life: its counters began at zero. Before the first report of the service
    /// they may be of a life that began long ago.
    void board_restarted() {
        if (last_) last_ = wire::Health{};
    }

    /// The report with its counters as of the service's first look.
    wire::Health since_start(const wire::Health& report);

 private:
    std::optional<wire::Health> last_;
    wire::Health sum_{};
};

}  // namespace versavis::daemon
