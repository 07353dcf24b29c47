// SPDX-License-Identifier: BSD-3-Clause
// What went wrong, where, and what to do about it.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace versavis {

struct Error {
    std::string where;  ///< the file, stream, device or key concerned
    std::string what;   ///< what happened
    std::string cure;   ///< what the user can do next; empty when there is nothing to do

    /// "where: what (cure)" on one line.
    std::string message() const {
        return (where.empty() ? "" : where + ": ") + what + (cure.empty() ? "" : "; " + cure);
    }
};

template <class T = void>
using Expected = tl::expected<T, Error>;

inline tl::unexpected<Error> failure(std::string where, std::string what, std::string cure = {}) {
    return tl::unexpected<Error>(Error{std::move(where), std::move(what), std::move(cure)});
}

}  // namespace versavis
