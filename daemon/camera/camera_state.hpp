// SPDX-License-Identifier: BSD-3-Clause
// The states of a camera's life, and errors that lead to one.
#pragma once

#include "versavis/error.hpp"

namespace versavis::daemon {

enum class CameraState {
    absent,         ///< nobody answers
    unreachable,    ///< it answers, but its address is not of this host's networks
    busy,           ///< another program controls it
    misconfigured,  ///< it lacks or refuses something of its configuration
    opening,
    streaming,
    silent,   ///< it was there, and does not answer or send any more
    stopped,  ///< by request
    failed,   ///< anything else
};
const char* to_string(CameraState state);

struct CameraProblem {
    CameraState state = CameraState::failed;
    Error error;
};

template <class T = void>
using CameraResult = Expected<T, CameraProblem>;

inline Unexpected<CameraProblem> problem(CameraState state, Error error) {
    return Unexpected<CameraProblem>(CameraProblem{state, std::move(error)});
}

}  // namespace versavis::daemon
