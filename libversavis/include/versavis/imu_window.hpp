// SPDX-License-Identifier: BSD-3-Clause
// IMU samples between two instants, waited for until they are all there.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "versavis/export.hpp"
#include "versavis/stream.hpp"

namespace versavis {

struct ImuSpan {
    std::vector<ImuSample> samples;   ///< after the first instant, up to and with the second
    std::optional<ImuSample> beyond;  ///< the first one after the second instant, to interpolate
    std::uint64_t lost = 0;           ///< missing within the span, by the samples' numbers
    bool covered = false;             ///< samples reach from the first instant to the second

    bool complete() const { return covered && lost == 0; }
};

/// Not thread-safe.
class VERSAVIS_API ImuWindow {
 public:
    /// Errors: as for ImuStream::open. It begins with what the ring still holds.
    static Expected<ImuWindow> open(const std::string& name, const StreamOptions& options = {});

    /// Samples with `after` < time <= `upto`. Waits until a sample of `upto` or later has come, for
    /// `patience` at most; then `covered` is false. Spans may follow each other or overlap; what
    /// lies before `after` is forgotten, but found again as long as the ring holds it. Error:
    /// Pause::restarted, once: times before and after do not compare.
    Expected<ImuSpan, NoItem> between(OutputTime after, OutputTime upto, Duration patience);

    /// Takes what has come, without waiting. Error: Pause::restarted.
    Expected<void, NoItem> collect();

    /// True when a sample of this time or later has come.
    bool reaches(OutputTime time) const;

    /// As between(), of what was collected.
    ImuSpan take(OutputTime after, OutputTime upto);

    ring::Reader& reader() { return stream_.reader(); }

 private:
    explicit ImuWindow(ImuStream stream) : stream_(std::move(stream)) {}
    void look_back(OutputTime after);

    ImuStream stream_;
    std::deque<ImuSample> samples_;
    std::optional<ImuSample> before_;  ///< the one before the first of samples_
};

}  // namespace versavis
