// SPDX-License-Identifier: BSD-3-Clause
// The inputs of the clock estimators: stamps of messages between host and board.
#pragma once

#include <variant>

#include "versavis/time.hpp"

namespace versavis::clock {

/// The four stamps of one exchange: host -> board from `sent` to `received`, board -> host from
/// `answered` to `arrived`. Either side may have begun; when the board did, `answered` is before
/// `received`.
struct Exchange {
    HostTime sent;
    BoardTime received;
    BoardTime answered;
    HostTime arrived;
};

/// A message board -> host that answers nothing.
struct OneWay {
    BoardTime sent;
    HostTime arrived;
};

using Message = std::variant<Exchange, OneWay>;

}  // namespace versavis::clock
