// SPDX-License-Identifier: BSD-3-Clause
#include "verify/even_line.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "base/median.hpp"

namespace versavis::client {

namespace {

/// Points of one line. Fewer: outliers side by side are half of them; more: clocks are no lines.
constexpr std::size_t group = 32;

void group_off_line(const LinePoint* points, std::size_t count, std::int64_t* off) {
    // y alone: what is left of it when it grows as x does, so that a double holds it exactly.
    const auto risen = [&](std::size_t i) {
        return static_cast<double>(points[i].y - points[0].y);
    };
    const auto along = [&](std::size_t i) {
        return static_cast<double>(points[i].x - points[0].x);
    };
    std::vector<double> values;
    values.reserve(count * count / 2);
    for (std::size_t a = 0; a < count; ++a)
        for (std::size_t b = a + 1; b < count; ++b)
            if (points[b].x != points[a].x)
                values.push_back((risen(b) - risen(a)) / (along(b) - along(a)));
    if (values.empty()) return;
    const double slope = median(values);
    values.clear();
    for (std::size_t i = 0; i < count; ++i) values.push_back(risen(i) - slope * along(i));
    const double level = median(std::move(values));
    for (std::size_t i = 0; i < count; ++i)
        off[i] = std::llround(risen(i) - slope * along(i) - level);
}

}  // namespace

std::vector<std::int64_t> off_line(const std::vector<LinePoint>& points) {
    std::vector<std::int64_t> off(points.size(), 0);
    if (points.size() < 4) return off;
    for (std::size_t begin = 0; begin < points.size(); begin += group) {
        // A short rest would have a line of its own outliers: it is judged with those before it.
        const std::size_t end = std::min(points.size(), begin + group);
        const std::size_t from = end - begin < group && end >= group ? end - group : begin;
        std::vector<std::int64_t> part(end - from, 0);
        group_off_line(points.data() + from, end - from, part.data());
        std::copy(part.begin() + static_cast<std::ptrdiff_t>(begin - from), part.end(),
                  off.begin() + static_cast<std::ptrdiff_t>(begin));
    }
    return off;
}

std::int64_t usual_amount(std::vector<std::int64_t> values) {
    if (values.empty()) return 0;
    for (std::int64_t& value : values) value = std::llabs(value);
    return median(std::move(values));
}

}  // namespace versavis::client
