// SPDX-License-Identifier: BSD-3-Clause
// Uses what is known of the asymmetry of the port in use, and keeps what PPS measures of it.
#pragma once

#include <mutex>
#include <string>

#include "board/asymmetry_store.hpp"
#include "engine/clock/translator.hpp"

namespace versavis::daemon {

/// Thread-safe.
class AsymmetryKeeper {
 public:
    /// `directory` as for AsymmetryStore.
    AsymmetryKeeper(const std::string& directory, clock::Translator& translator)
        : store_(directory), translator_(translator) {}

    /// The board is at this port. At the same port again, what was measured meanwhile stays, also
    /// where it could not be stored.
    void use(const std::string& port);

    /// What PPS measured outlives the service; it is written when it changed by more than its
    /// sigma.
    void keep(const clock::ClockReport& clock);

 private:
    std::mutex mutex_;
    AsymmetryStore store_;
    clock::Translator& translator_;
    std::string port_;  ///< to which what the translator uses belongs; empty: none yet
    Duration kept_;
};

}  // namespace versavis::daemon
