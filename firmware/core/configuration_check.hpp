// SPDX-License-Identifier: BSD-3-Clause
// Checks a configuration from the host against what the board can do.
#pragma once

#include "base/hal.hpp"
#include "wire/messages.hpp"

namespace versavis::firmware {

/// Receives what is refused, field by field.
struct RefusalSink {
    virtual void refuse(const wire::Refusal& refusal) = 0;

 protected:
    ~RefusalSink() = default;
};

/// `facts`: what the board has.
void check(const wire::Configuration& configuration, const PortFacts& facts, RefusalSink& sink);

}  // namespace versavis::firmware
