// SPDX-License-Identifier: BSD-3-Clause
// Holds each sample of an IMU against the numbers and times of those before it.
#pragma once

#include <optional>

#include "configuration/configuration.hpp"
#include "stream/doubt.hpp"
#include "stream/steady_value.hpp"
#include "stream/witness.hpp"
#include "wire/messages.hpp"

namespace versavis::daemon {

/// What no honest sample says, whatever came before it. The board's times of a sample that passes
/// can be subtracted from each other without overflow.
std::optional<Doubt> contradicts_itself(const wire::ImuSample& sample);

/// The samples that were believed: their times follow from their numbers.
class SampleHistory {
 public:
    explicit SampleHistory(const ImuConfiguration& configuration);

    std::optional<Doubt> doubt(const wire::ImuSample& sample) const;
    void learn(const wire::ImuSample& sample);

 private:
    SteadyValue pace_;  ///< from one sample to the next
    std::optional<wire::ImuSample> newest_;
};

using ImuWitness = Witness<SampleHistory>;

}  // namespace versavis::daemon
