// SPDX-License-Identifier: BSD-3-Clause
// Uses what is known of the asymmetry of the port in use, and keeps what PPS measures of it.
#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "board/asymmetry_store.hpp"
#include "engine/clock/translator.hpp"

namespace versavis::daemon {

/// Thread-safe.
class AsymmetryKeeper {
 public:
    /// `directory` as for AsymmetryStore.
    AsymmetryKeeper(const std::string& directory, clock::Translator& translator);
    ~AsymmetryKeeper();  ///< what was kept is written by then
    AsymmetryKeeper(const AsymmetryKeeper&) = delete;
    AsymmetryKeeper& operator=(const AsymmetryKeeper&) = delete;

    /// The board is at this port. At the same port again, what was measured meanwhile stays, also
    /// where it could not be stored.
    void use(const std::string& port);

    /// What PPS measured outlives the service; it is written when it changed by more than its
    /// sigma, by a thread of its own: a disk may take its time.
    void keep(const clock::ClockReport& clock);

 private:
    void write();

    AsymmetryStore store_;
    std::mutex mutex_;  ///< not held while the disk is waited for
    clock::Translator& translator_;
    std::string port_;  ///< to which what the translator uses belongs; empty: none yet
    Duration kept_;
    std::optional<std::pair<std::string, clock::Asymmetry>> unwritten_;
    bool stop_ = false;
    std::condition_variable changed_;
    std::thread writer_;
};

}  // namespace versavis::daemon
