// SPDX-License-Identifier: BSD-3-Clause
// Levels of named lines over time, for people to look at: as VCD (GTKWave) or as an SVG diagram.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace versavis::scenario {

class Trace {
 public:
    /// The line `name` has `level` from `at_ns` on. Times of one line increase.
    void set(const std::string& name, std::int64_t at_ns, bool level);

    /// Value change dump, resolution 1 ns.
    std::string vcd() const;

    struct Window {
        std::string title;
        std::int64_t from_ns;
        std::int64_t to_ns;
        std::int64_t tick_ns;  ///< distance between time marks
        std::vector<std::string> lines;
        std::vector<std::int64_t>
            marks;  ///< instants with a dashed line through all, such as grid points
    };
    std::string svg(const Window& window) const;

 private:
    struct Change {
        std::int64_t at_ns;
        bool level;
    };
    struct Line {
        std::string name;
        std::vector<Change> changes;
    };
    Line& line(const std::string& name);

    std::vector<Line> lines_;
};

}  // namespace versavis::scenario
