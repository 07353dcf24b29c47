// SPDX-License-Identifier: BSD-3-Clause
// What a call of the system that failed means to a program that reads streams.
#pragma once

#include <cerrno>

#include "versavis/error.hpp"

namespace versavis::ring {

/// `number`: an errno.
inline ErrorCode code_of(int number) {
    switch (number) {
        case ENOENT:
        case ENOTDIR:
        case ECONNREFUSED: return ErrorCode::absent;
        case EACCES:
        case EPERM: return ErrorCode::forbidden;
        case ENOMEM: return ErrorCode::no_memory;
        case EMFILE:
        case ENFILE:
        case EAGAIN: return ErrorCode::exhausted;
        default: return ErrorCode::other;
    }
}

}  // namespace versavis::ring
