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

/// Why samples do not reach from the first instant of a span to the second.
enum class SpanGap : std::uint32_t {
    none = 0,
    begin = 1,    ///< no sample at or before the first instant is known
    end = 2,      ///< no sample of the second instant or later has come yet
    epoch = 3,    ///< the epoch began or ended within it: times beyond that do not compare
    numbers = 4,  ///< sample numbers stand still or go back: nobody knows how many are missing
};
VERSAVIS_API const char* to_string(SpanGap gap);

struct ImuSpan {
    std::vector<ImuSample> samples;   ///< after the first instant, up to and with the second
    std::optional<ImuSample> beyond;  ///< the first one after the second instant, to interpolate
    std::uint64_t lost = 0;           ///< missing within the span, by the samples' numbers
    SpanGap gap = SpanGap::begin;

    /// Samples reach from the first instant to the second, though some may be lost between them.
    bool covered() const { return gap == SpanGap::none; }
    bool complete() const { return covered() && lost == 0; }
};

/// Not thread-safe.
class VERSAVIS_API ImuWindow {
 public:
    /// Errors: as for ImuStream::open. It begins with what the ring still holds.
    static Expected<ImuWindow> open(const std::string& name, const StreamOptions& options = {});

    /// Samples with `after` < time <= `upto`. Waits until one of `upto` or later has come, or of a
    /// later epoch, for `patience` at most. Spans may follow each other or overlap; what lies
    /// before `after` is forgotten, but found again as long as the ring holds it. Instants of two
    /// epochs have no samples between them: SpanGap::epoch. Error: Pause::restarted, once: times
    /// before and after do not compare.
    Expected<ImuSpan, NoItem> between(const EpochTime& after, const EpochTime& upto,
                                      Duration patience);

    /// Takes what has come, without waiting. Error: Pause::restarted.
    Expected<void, NoItem> collect();

    /// True when a sample of this time or later has come, or one of a later epoch.
    bool reaches(const EpochTime& time) const;

    /// As between(), of what was collected.
    ImuSpan take(const EpochTime& after, const EpochTime& upto);

    ring::Reader& reader() { return stream_.reader(); }

 private:
    explicit ImuWindow(ImuStream stream) : stream_(std::move(stream)) {}
    void look_back(const EpochTime& after);
    void forget();

    ImuStream stream_;
    std::deque<ImuSample> samples_;    ///< as they came, of one epoch after the other
    std::optional<ImuSample> before_;  ///< the one before the first of samples_
};

}  // namespace versavis
