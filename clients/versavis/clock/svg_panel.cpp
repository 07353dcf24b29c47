// SPDX-License-Identifier: BSD-3-Clause
#include "clock/svg_panel.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace versavis::client::svg {

namespace {

constexpr std::size_t most_dots = 1500;

/// Length of the UTF-8 sequence at the beginning that XML allows; 0: none.
std::size_t sequence_length(std::string_view text) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const unsigned lead = byte(0);
    if (lead < 0x80) return lead >= 0x20 && lead != 0x7F ? 1 : 0;
    const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
    if (lead < 0xC2 || lead > 0xF4 || text.size() < length) return 0;
    for (std::size_t i = 1; i < length; ++i)
        if ((byte(i) & 0xC0U) != 0x80U) return 0;
    const unsigned second = byte(1);
    const bool overlong = (lead == 0xE0 && second < 0xA0) || (lead == 0xF0 && second < 0x90);
    const bool too_large = lead == 0xF4 && second > 0x8F;
    const bool surrogate = lead == 0xED && second > 0x9F;
    const bool no_character = lead == 0xEF && second == 0xBF && byte(2) >= 0xBE;
    return overlong || too_large || surrogate || no_character ? 0 : length;
}

double quantile(std::vector<double>& values, double share) {
    const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), values.begin() + at, values.end());
    return values[static_cast<std::size_t>(at)];
}

std::string polyline(const std::string& path, const char* colour) {
    return fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.3\"/>\n", path,
                       colour);
}

}  // namespace

std::string escaped(std::string_view text) {
    std::string out;
    while (!text.empty()) {
        const std::size_t length = sequence_length(text);
        switch (text.front()) {
            case '&': out += "&amp;"; break;
            case '<': out += "&lt;"; break;
            case '>': out += "&gt;"; break;
            case '"': out += "&quot;"; break;
            default: out += length == 0 ? std::string_view("?") : text.substr(0, length);
        }
        text.remove_prefix(std::max<std::size_t>(length, 1));
    }
    return out;
}

std::string text(double x, double y, std::string_view content, Anchor anchor, int size,
                 const char* colour) {
    const char* name = anchor == Anchor::start    ? "start"
                       : anchor == Anchor::middle ? "middle"
                                                  : "end";
    return fmt::format(
        "<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{}\" text-anchor=\"{}\" "
        "fill=\"{}\">{}</text>\n",
        x, y, size, name, colour, escaped(content));
}

Span span_of(std::vector<double> values, double cut) {
    constexpr std::size_t many = 200;
    if (values.empty()) return {-1, 1};
    if (values.size() < many) cut = 0;
    const double low = quantile(values, cut);
    const double high = quantile(values, 1 - cut);
    const double size = std::max(std::abs(low), std::abs(high));
    // A constant needs a scale as well: one with short labels.
    const double room =
        std::max(0.08 * (high - low), high - low <= 1e-6 * size ? 0.01 * size : 0.0);
    if (room == 0) return {-1, 1};
    return {low - room, high + room};
}

std::vector<double> ticks(Span span, int about) {
    const double rough = (span.high - span.low) / about;
    const double power = std::pow(10, std::floor(std::log10(rough)));
    const double lead = rough / power;
    const double step = power * (lead < 1.5 ? 1 : lead < 3.5 ? 2 : lead < 7.5 ? 5 : 10);
    std::vector<double> values;
    const double first = std::ceil(span.low / step);
    for (int i = 0; i <= 4 * about && (first + i) * step <= span.high; ++i)
        values.push_back((first + i) * step + 0.0);  // no minus zero
    return values;
}

std::string tick_label(double value, double step) {
    const int digits = std::clamp(-static_cast<int>(std::floor(std::log10(step) + 1e-9)), 0, 12);
    return std::abs(value) >= 1e7 ? fmt::format("{:.4g}", value)
                                  : fmt::format("{:.{}f}", value, digits);
}

double Panel::px(double x) const {
    return box_.left + (x - x_.low) / (x_.high - x_.low) * box_.width;
}

double Panel::py(double y) const {
    const double share = (y - y_.low) / (y_.high - y_.low);
    return box_.top +
           (1 - std::clamp(share, -1.0, 2.0)) * box_.height;  // the rest is cut off anyway
}

std::size_t Panel::pixel(double x) const {
    return static_cast<std::size_t>(std::clamp(px(x) - box_.left, 0.0, box_.width));
}

void Panel::band(const std::vector<Bar>& bars, const char* colour) {
    if (bars.empty()) return;
    std::vector<Bar> columns;
    for (const Bar& bar : bars) {
        if (columns.empty() || pixel(columns.back().x) != pixel(bar.x)) {
            columns.push_back(bar);
            continue;
        }
        columns.back().y.low = std::min(columns.back().y.low, bar.y.low);
        columns.back().y.high = std::max(columns.back().y.high, bar.y.high);
    }
    std::string path;
    for (const Bar& bar : columns)
        path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", px(bar.x), py(bar.y.high));
    for (auto bar = columns.rbegin(); bar != columns.rend(); ++bar)
        path += fmt::format("L{:.1f} {:.1f}", px(bar->x), py(bar->y.low));
    content_ += fmt::format("<path d=\"{}Z\" fill=\"{}\" fill-opacity=\"0.7\"/>\n", path, colour);
}

void Panel::line(const std::vector<Point>& points, const char* colour) {
    std::string path;
    const auto to = [&](const Point& p) {
        path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", px(p.x), py(p.y));
    };
    const bool all = points.size() <= 2 * pixels();
    for (std::size_t i = 0; i < points.size();) {
        std::size_t low = i;
        std::size_t high = i;
        std::size_t end = i + 1;
        for (; !all && end < points.size() && pixel(points[end].x) == pixel(points[i].x); ++end) {
            if (points[end].y < points[low].y) low = end;
            if (points[end].y > points[high].y) high = end;
        }
        to(points[std::min(low, high)]);
        if (low != high) to(points[std::max(low, high)]);
        i = end;
    }
    if (!points.empty()) content_ += polyline(path, colour);
}

std::size_t Panel::cloud(const std::vector<Point>& points, const char* colour) {
    std::vector<Point> inside;
    for (const Point& p : points)
        if (p.y >= y_.low && p.y <= y_.high) inside.push_back(p);
    if (inside.size() <= most_dots)
        dots(inside, colour);
    else
        bars(inside, colour);
    return points.size() - inside.size();
}

void Panel::dots(const std::vector<Point>& points, const char* colour) {
    // Round caps of lines without length: a fifth of the bytes of circles.
    std::string path;
    for (const Point& p : points) path += fmt::format("M{:.1f} {:.1f}h0", px(p.x), py(p.y));
    if (path.empty()) return;
    content_ += fmt::format(
        "<path d=\"{}\" stroke=\"{}\" stroke-width=\"2.6\" stroke-linecap=\"round\" "
        "stroke-opacity=\"0.7\"/>\n",
        path, colour);
}

void Panel::bars(const std::vector<Point>& points, const char* colour) {
    std::vector<std::vector<double>> columns(pixels());
    for (const Point& p : points) columns[pixel(p.x)].push_back(p.y);
    std::string whole;
    std::string half;
    for (std::size_t i = 0; i < columns.size(); ++i) {
        if (columns[i].empty()) continue;
        const double x = box_.left + static_cast<double>(i);
        const auto bar = [&](double share) {
            const double low = py(quantile(columns[i], share));
            const double high = py(quantile(columns[i], 1 - share));
            return fmt::format("M{:.1f} {:.1f}V{:.1f}", x, low, std::min(high, low - 1));
        };
        whole += bar(0);
        half += bar(0.25);
    }
    for (const auto& [path, opacity] : {std::pair{whole, 0.25}, std::pair{half, 0.8}})
        content_ +=
            fmt::format("<path d=\"{}\" stroke=\"{}\" stroke-width=\"1\" stroke-opacity=\"{}\"/>\n",
                        path, colour, opacity);
}

std::string Panel::grid(bool x_labels) const {
    const double right = box_.left + box_.width;
    const double bottom = box_.top + box_.height;
    std::string path;
    std::string labels;
    const auto y_ticks = ticks(y_, 4);
    const double y_step = y_ticks.size() > 1 ? y_ticks[1] - y_ticks[0] : y_.high - y_.low;
    for (const double y : y_ticks) {
        path += fmt::format("M{:.1f} {:.1f}H{:.1f}", box_.left, py(y), right);
        labels += text(box_.left - 6, py(y) + 4, tick_label(y, y_step), Anchor::end, 11);
    }
    const auto x_ticks = ticks(x_, 6);
    const double x_step = x_ticks.size() > 1 ? x_ticks[1] - x_ticks[0] : x_.high - x_.low;
    for (const double x : x_ticks) {
        path += fmt::format("M{:.1f} {:.1f}V{:.1f}", px(x), box_.top, bottom);
        if (x_labels) labels += text(px(x), bottom + 16, tick_label(x, x_step), Anchor::middle, 11);
    }
    return fmt::format("<path d=\"{}\" stroke=\"#e4e4e4\" stroke-width=\"1\"/>\n{}", path, labels);
}

std::string Panel::finished(const std::string& y_label, const std::string& x_label) const {
    const auto box = fmt::format("x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"",
                                 box_.left, box_.top, box_.width, box_.height);
    const std::string id = fmt::format("c{:.0f}-{:.0f}", box_.left, box_.top);
    std::string out = grid(!x_label.empty());
    out += fmt::format(
        "<clipPath id=\"{}\"><rect {}/></clipPath>\n<g clip-path=\"url(#{})\">\n{}</g>\n", id, box,
        id, content_);
    out += fmt::format("<rect {} fill=\"none\" stroke=\"#888\"/>\n", box);
    const double y = box_.top + box_.height / 2;
    out += fmt::format("<g transform=\"translate({:.1f} {:.1f}) rotate(-90)\">{}</g>\n",
                       box_.left - 66, y, text(0, 0, y_label, Anchor::middle, 12));
    if (!x_label.empty())
        out += text(box_.left + box_.width / 2, box_.top + box_.height + 36, x_label,
                    Anchor::middle, 12);
    return out;
}

}  // namespace versavis::client::svg
