// SPDX-License-Identifier: BSD-3-Clause
// The order of the items of one stream: what is missing, and in which second each one is.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "verify/recorded_evidence.hpp"
#include "verify/verdict.hpp"

namespace versavis::client {

class StreamOrder {
 public:
    /// `gaps`: as the recorder noted them. `begin`: of the recording. `messages`: stamps in
    /// messages of ROS that differ, by the time of the item; null: none.
    StreamOrder(const std::vector<RecordedGap>& gaps, HostTime begin,
                const std::map<std::int64_t, Duration>* messages);

    /// The second of an item that says that it is of `host`. A time that is far off the one before
    /// does not count: the order of the file does, unless many in a row agree.
    std::int64_t second(HostTime host);

    /// Adds what its place contradicts, to the item that `verdict` is about.
    void judge(const StampedItem& item, std::uint32_t epoch, VerdictBuilder& verdict);

 private:
    bool noted(OutputTime before) const;

    const std::vector<RecordedGap>& gaps_;
    HostTime begin_;
    const std::map<std::int64_t, Duration>* messages_;
    std::optional<HostTime> last_host_;
    int far_off_ = 0;
    std::optional<StampedItem> last_;
    std::uint32_t last_epoch_ = 0;
};

}  // namespace versavis::client
