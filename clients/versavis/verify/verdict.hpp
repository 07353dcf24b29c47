// SPDX-License-Identifier: BSD-3-Clause
// What is found about the stamps of a stream, second by second.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "versavis/time.hpp"

namespace versavis::client {

enum class Grade : std::uint8_t {
    untrusted,  ///< something contradicts the stamp
    plausible,  ///< nothing contradicts it, but a witness is missing
    proved,
};

const char* to_string(Grade grade);  ///< "not to be trusted", "plausible", "proved"

enum class Finding : std::uint8_t {
    // not to be trusted
    impossible_value,
    no_exposure,
    other_middle,
    other_length,
    record_differs,
    no_arrival,
    other_arrival,
    too_early,
    camera_clock,
    block_step,
    stated_length,
    host_time,
    uneven,
    output_time,
    other_second,
    backwards,
    missing,
    repeated,
    sample_clock,
    message_stamp,
    pictures,
    // plausible
    no_edges,
    no_hardware,
    by_camera,
    no_camera_clock,
    no_start,
    no_exchange,
    contradictory_exchanges,
    no_output_reading,
    second_doubted,
    no_record,
    clock_uncertain,
};
inline constexpr std::size_t finding_count = static_cast<std::size_t>(Finding::clock_uncertain) + 1;

Grade grade_of(Finding finding);
const char* name_of(Finding finding);   ///< for programs: "other_middle"
const char* words_of(Finding finding);  ///< for people

/// Seconds in a row with the same finding.
struct FindingSpan {
    Finding finding{};
    std::int64_t from_s = 0;
    std::int64_t to_s = 0;  ///< inclusive
    std::uint64_t items = 0;
    Duration worst;  ///< by amount; 0: it has none
};

/// The second with the most items that one finding makes untrusted, and that finding.
struct WorstSecond {
    Finding finding{};
    std::int64_t second = 0;
    std::uint64_t items = 0;
    Duration worst;  ///< as of FindingSpan
};

struct SecondVerdict {
    std::uint64_t items = 0;
    std::uint64_t withheld = 0;
    Grade grade = Grade::proved;
    /// Host times against the middle of their bounds.
    Duration lowest;
    Duration highest;
    Duration half_width;  ///< of the bounds; 0: there are none
};

/// `seconds` count from the beginning of the recording.
struct StreamVerdict {
    std::string name;
    std::string kind;  ///< camera, imu
    std::uint64_t items = 0;
    std::array<std::uint64_t, 3> graded{};  ///< by Grade
    std::uint64_t withheld = 0;             ///< published as suspect: no stamp to be judged
    std::uint64_t lost = 0;                 ///< as the recorder noted
    Duration sigma;                         ///< median
    std::map<std::int64_t, SecondVerdict> seconds;
    std::vector<FindingSpan> findings;        ///< worst first
    std::optional<WorstSecond> worst_second;  ///< none: nothing is untrusted

    Grade grade() const;
};

/// Collects the findings of one stream.
class VerdictBuilder {
 public:
    VerdictBuilder(std::string name, std::string kind);

    /// The next item, of this second.
    void begin_item(std::int64_t second, std::uint32_t sigma_ns);
    /// About the item.
    void add(Finding finding, Duration by = {});
    void add_position(Duration from_middle, Duration half_width);
    void withhold();
    void add_lost(std::uint64_t items) { verdict_.lost += items; }
    /// Items whose times are impossible, wherever they are.
    void add_damaged(std::uint64_t items);

    StreamVerdict finish();

 private:
    struct Cell {
        std::uint64_t items = 0;
        Duration worst;
    };
    void end_item();

    StreamVerdict verdict_;
    std::array<std::map<std::int64_t, Cell>, finding_count> cells_;
    std::vector<std::uint32_t> sigmas_;
    bool open_ = false;
    bool withheld_ = false;
    Grade grade_ = Grade::proved;
    std::int64_t second_ = 0;
};

}  // namespace versavis::client
