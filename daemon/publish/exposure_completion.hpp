// SPDX-License-Identifier: BSD-3-Clause
// What the board saw of an exposure, less the delays of the lines, and completed: the rest follows
// from configuration and history.
#pragma once

#include "engine/pairing/evidence.hpp"
#include "settings/configuration.hpp"
#include "settings/line_delays.hpp"
#include "wire/messages.hpp"

namespace versavis::daemon {

/// True when the board has both edges, be it from the camera's own line or from its master's.
bool measured(const wire::Exposure& record);

/// Not thread-safe.
class ExposureCompletion {
 public:
    explicit ExposureCompletion(const CameraConfiguration& configuration);

    /// Those of exposures to come.
    void set_line_delays(const LineDelays& lines) { lines_ = lines; }
    const LineDelays& line_delays() const { return lines_; }

    /// Start and end on the board's clock; the kind says which of them were seen.
    pairing::Exposure complete(const wire::Exposure& record);

    /// Puts the exposure on the host's clock, given its middle there.
    static void place_on_host(pairing::Exposure& exposure, const wire::Exposure& record,
                              HostTime middle_on_host);

 private:
    void take_off_delays(pairing::Exposure& exposure) const;
    Duration not_of_own_line(const wire::Exposure& record) const;

    LineDelays lines_;
    Duration max_exposure_;
    Duration last_exposure_;  ///< as measured last, or as configured
};

/// What the kind of an exposure's stamp adds to the error of the clock: one standard deviation.
Duration kind_sigma(const pairing::Exposure& exposure, Duration middle_to_arrival);

}  // namespace versavis::daemon
