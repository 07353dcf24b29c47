// SPDX-License-Identifier: BSD-3-Clause
#include "trace.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

namespace versavis::scenario {

Trace::Line& Trace::line(const std::string& name) {
    for (Line& line : lines_)
        if (line.name == name) return line;
    lines_.push_back({name, {}});
    return lines_.back();
}

void Trace::set(const std::string& name, std::int64_t at_ns, bool level) {
    std::vector<Change>& changes = line(name).changes;
    if (changes.empty() ? level : changes.back().level != level) changes.push_back({at_ns, level});
}

std::string Trace::vcd() const {
    std::string out = "$timescale 1ns $end\n$scope module board $end\n";
    const auto symbol = [](std::size_t index) { return static_cast<char>('!' + index); };
    std::vector<std::tuple<std::int64_t, std::size_t, bool>> changes;
    for (std::size_t i = 0; i < lines_.size(); ++i) {
        out += fmt::format("$var wire 1 {} {} $end\n", symbol(i), lines_[i].name);
        for (const Change& change : lines_[i].changes)
            changes.emplace_back(change.at_ns, i, change.level);
    }
    out += "$upscope $end\n$enddefinitions $end\n#0\n";
    for (std::size_t i = 0; i < lines_.size(); ++i) out += fmt::format("0{}\n", symbol(i));
    std::stable_sort(changes.begin(), changes.end(),
                     [](const auto& a, const auto& b) { return std::get<0>(a) < std::get<0>(b); });
    std::int64_t now = 0;
    for (const auto& [at, index, level] : changes) {
        if (at != now) out += fmt::format("#{}\n", at);
        now = at;
        out += fmt::format("{}{}\n", level ? 1 : 0, symbol(index));
    }
    return out;
}

std::string Trace::svg(const Window& window) const {
    constexpr double label = 110;
    constexpr double width = 760;
    constexpr double row = 34;
    constexpr double swing = 20;
    constexpr double top = 40;
    const double bottom = top + row * static_cast<double>(window.lines.size());
    const auto x = [&](std::int64_t at) {
        return label + width * static_cast<double>(at - window.from_ns) /
                           static_cast<double>(window.to_ns - window.from_ns);
    };
    std::string out = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0f} {:.0f}\" "
        "font-family=\"sans-serif\" "
        "font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
        "<text x=\"10\" y=\"18\" font-size=\"14\">{}</text>\n",
        label + width + 40, bottom + 30, window.title);
    for (std::int64_t at = window.from_ns; at <= window.to_ns; at += window.tick_ns)
        out += fmt::format(
            "<line x1=\"{0:.1f}\" y1=\"{1:.1f}\" x2=\"{0:.1f}\" y2=\"{2:.1f}\" stroke=\"#ddd\"/>\n"
            "<text x=\"{0:.1f}\" y=\"{3:.1f}\" text-anchor=\"middle\" fill=\"#666\">{4:g} "
            "ms</text>\n",
            x(at), top - 10, bottom, bottom + 16, static_cast<double>(at - window.from_ns) / 1e6);
    for (const std::int64_t at : window.marks)
        if (at >= window.from_ns && at <= window.to_ns)
            out += fmt::format(
                "<line x1=\"{0:.1f}\" y1=\"{1:.1f}\" x2=\"{0:.1f}\" y2=\"{2:.1f}\" "
                "stroke=\"#c33\" stroke-dasharray=\"4 3\"/>\n",
                x(at), top - 10, bottom);
    double base = top + swing;
    for (const std::string& name : window.lines) {
        const auto found = std::find_if(lines_.begin(), lines_.end(),
                                        [&](const Line& line) { return line.name == name; });
        bool level = false;
        std::string points;
        const auto point = [&](std::int64_t at) {
            points += fmt::format("{:.1f},{:.1f} ", x(at), level ? base - swing : base);
        };
        if (found != lines_.end())
            for (const Change& change : found->changes)
                if (change.at_ns <= window.from_ns) level = change.level;
        point(window.from_ns);
        if (found != lines_.end())
            for (const Change& change : found->changes) {
                if (change.at_ns <= window.from_ns || change.at_ns > window.to_ns) continue;
                point(change.at_ns);
                level = change.level;
                point(change.at_ns);
            }
        point(window.to_ns);
        out += fmt::format(
            "<text x=\"10\" y=\"{:.1f}\">{}</text>\n<polyline points=\"{}\" fill=\"none\" "
            "stroke=\"#236\" stroke-width=\"1.5\"/>\n",
            base - 5, name, points);
        base += row;
    }
    return out + "</svg>\n";
}

}  // namespace versavis::scenario
