// SPDX-License-Identifier: BSD-3-Clause
// The pairing of a camera done again from its evidence, and frames proved that only what came later
// proves.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "engine/pairing/recording.hpp"

namespace versavis::client {

struct ProvedFrame {
    pairing::Arrival arrival;
    pairing::Exposure exposure;
    bool afterwards = false;  ///< by frames on both sides, or later ones; not by what came before
};

/// Pairs the frames of one camera again, from its recorded evidence, and proves further frames by
/// their proved neighbours. Used by one thread.
class FrameProof {
 public:
    FrameProof();
    FrameProof(FrameProof&&) noexcept;
    FrameProof& operator=(FrameProof&&) noexcept;
    ~FrameProof();

    /// In the order of the ring. What precedes the begin of a stream of the camera is ignored.
    void add(const pairing::Evidence& evidence);

    /// The stream's begin was there.
    bool begun() const;

    /// Once, at the end.
    std::vector<ProvedFrame> finish();

 private:
    struct Run;
    std::unique_ptr<Run> run_;
};

}  // namespace versavis::client
