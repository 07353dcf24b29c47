// SPDX-License-Identifier: BSD-3-Clause
#include "clock/clock_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <numeric>

#include "clock/svg_panel.hpp"
#include "posix/file.hpp"

namespace versavis::client {

namespace {

using namespace clock;
using svg::Anchor;
using Points = std::vector<ClockPoint>;

constexpr const char* blue = "#1f5fa8";
constexpr const char* pale_blue = "#c9dcf2";
constexpr const char* dark = "#333";

constexpr double start_s = 10;  // shown as the start, unless exchanges are rare
constexpr std::size_t start_points = 30;
constexpr double page_width = 1200;
constexpr double page_height = 910;
constexpr double panel_width = 475;
constexpr double panel_height = 160;
constexpr double first_top = 104;
constexpr double panel_pitch = 198;
constexpr std::array column_left{95.0, 690.0};

using Wide = __int128;  // recorded stamps may have any value

BoardTime board_middle(const Exchange& e) { return {std::midpoint(e.received.ns, e.answered.ns)}; }
HostTime host_middle(const Exchange& e) { return {std::midpoint(e.sent.ns, e.arrived.ns)}; }

/// The unit that keeps the labels of an axis short.
struct Unit {
    const char* name;
    double ns;
};

Unit unit_for(svg::Span span_ns) {
    const double largest = std::max(std::abs(span_ns.low), std::abs(span_ns.high));
    if (largest >= 2e9) return {"s", 1e9};
    if (largest >= 2e7) return {"ms", 1e6};
    return {"us", 1e3};
}

Unit unit_of_time(double seconds) {
    if (seconds >= 4 * 3600) return {"h", 3600};
    if (seconds >= 15 * 60) return {"min", 60};
    return {"s", 1};
}

std::string with_unit(double value, Unit axis) {
    if (axis.name == std::string_view("ppm")) return fmt::format("{:.3g} ppm", value);
    const double ns = value * axis.ns;
    const Unit unit = ns >= 1e9 ? Unit{"s", 1e9} : ns >= 1e6 ? Unit{"ms", 1e6} : Unit{"us", 1e3};
    return fmt::format("{:.3g} {}", ns / unit.ns, unit.name);
}

/// A straight line through the offsets.
struct Line {
    double at_zero = 0;
    double slope = 0;

    double at(double t) const { return at_zero + slope * t; }
};

Line fitted(const Points& points) {
    const auto count = static_cast<double>(points.size());
    double t = 0;
    double y = 0;
    for (const ClockPoint& p : points) {
        t += p.time_s / count;
        y += p.offset_ns / count;
    }
    double tt = 0;
    double ty = 0;
    for (const ClockPoint& p : points) {
        tt += (p.time_s - t) * (p.time_s - t);
        ty += (p.time_s - t) * (p.offset_ns - y);
    }
    const double slope = tt > 0 ? ty / tt : 0;
    return {y - slope * t, slope};
}

std::vector<double> collected(const Points& points,
                              const std::function<double(const ClockPoint&)>& value) {
    std::vector<double> values;
    values.reserve(points.size());
    for (const ClockPoint& p : points) values.push_back(value(p));
    return values;
}

/// One of the two columns of the plot.
class Column {
 public:
    Column(Points points, double left, Line line, std::string title)
        : points_(std::move(points)), left_(left), line_(line), title_(std::move(title)) {
        const double begin = points_.front().time_s;
        const double end = points_.back().time_s;
        time_ = unit_of_time(end);
        const double room = std::max(0.01 * (end - begin), 0.005);
        x_ = {(begin - room) / time_.ns, (end + room) / time_.ns};
    }

    std::string drawn() const {
        return svg::text(left_ + panel_width / 2, first_top - 34, title_, Anchor::middle, 14) +
               offset() + skew() + residual() + innovation();
    }

 private:
    double x(const ClockPoint& p) const { return p.time_s / time_.ns; }

    svg::Panel panel(int row, svg::Span y) const {
        return {{left_, first_top + row * panel_pitch, panel_width, panel_height}, x_, y};
    }

    std::string heading(int row, const std::string& text, const std::string& note) const {
        const double y = first_top + row * panel_pitch - 7;
        return svg::text(left_, y, text, Anchor::start, 12) +
               svg::text(left_ + panel_width, y, note, Anchor::end, 11, "#666");
    }

    std::string offset() const {
        const auto value = [&](const ClockPoint& p) { return p.offset_ns - line_.at(p.time_s); };
        const auto band = [](const ClockPoint& p) { return p.sigma_ns; };
        const svg::Span span = svg::span_of(collected(points_, value));
        return curve(0, "offset", "offset estimate minus a straight line", unit_for(span), value,
                     band);
    }

    std::string skew() const {
        const auto value = [](const ClockPoint& p) { return p.skew_ppm; };
        const auto band = [](const ClockPoint& p) { return p.skew_sigma_ppm; };
        return curve(1, "skew", "skew, host against board clock", {"ppm", 1}, value, band);
    }

    template <class Value, class Band>
    std::string curve(int row, const char* name, const char* text, Unit unit, Value value,
                      Band band) const {
        svg::Span y = svg::span_of(collected(points_, value));
        y = {y.low / unit.ns, y.high / unit.ns};
        std::vector<svg::Bar> bars;
        std::vector<svg::Point> line;
        for (const ClockPoint& p : points_) {
            const double v = value(p) / unit.ns;
            const double s = band(p) / unit.ns;
            bars.push_back({x(p), {v - s, v + s}});
            line.push_back({x(p), v});
        }
        const double last_sigma = band(points_.back()) / unit.ns;
        // A band that is about as high as the curve is shown whole; a much higher one would hide
        // the curve.
        if (last_sigma < y.high - y.low) y = {y.low - last_sigma, y.high + last_sigma};
        svg::Panel axes = panel(row, y);
        axes.band(bars, pale_blue);
        axes.line(line, blue);
        return axes.finished(fmt::format("{} [{}]", name, unit.name), "") +
               heading(row, text,
                       fmt::format("band: ± sigma, {} at the end", with_unit(last_sigma, unit)));
    }

    std::string residual() const {
        return cloud(2, points_, "residual", "residual: measured minus estimate",
                     [](const ClockPoint& p) { return p.residual_ns; });
    }

    std::string innovation() const {
        Points corrections;
        for (const ClockPoint& p : points_)
            if (p.innovation_ns != 0) corrections.push_back(p);
        return cloud(3, corrections, "innovation", "innovation: change of the offset estimate",
                     [](const ClockPoint& p) { return p.innovation_ns; });
    }

    template <class Value>
    std::string cloud(int row, const Points& points, const char* name, const char* text,
                      Value value) const {
        svg::Span y = svg::span_of(collected(points, value), 0.02);
        const Unit unit = unit_for(y);
        y = {y.low / unit.ns, y.high / unit.ns};
        std::vector<svg::Point> dots;
        for (const ClockPoint& p : points) dots.push_back({x(p), value(p) / unit.ns});
        svg::Panel axes = panel(row, y);
        const std::size_t outside = axes.cloud(dots, dark);
        const bool last = row == 3;
        const std::string x_label = fmt::format("time since the first exchange [{}]", time_.name);
        std::string note = fmt::format("{} values", dots.size());
        if (outside != 0) note += fmt::format(", {} outside", outside);
        return axes.finished(fmt::format("{} [{}]", name, unit.name), last ? x_label : "") +
               heading(row, text, note);
    }

    Points points_;
    double left_;
    Line line_;
    std::string title_;
    Unit time_{"s", 1};
    svg::Span x_;
};

std::string start_title(const Points& start) {
    const double length = start.back().time_s - start.front().time_s;
    return fmt::format("after the start: the first {:.{}f} s", length, length < 9.5 ? 1 : 0);
}

/// Index of the first point of the convergence.
std::size_t end_of_start(const Points& history) {
    const double first = history.front().time_s;
    const double rare = history[std::min(start_points, history.size() - 1)].time_s - first;
    const double half = (history.back().time_s - first) / 2;
    const double until = first + std::min(std::max(start_s, rare), half);
    const auto end = std::find_if(history.begin(), history.end(),
                                  [&](const ClockPoint& p) { return p.time_s > until; });
    return std::max<std::size_t>(static_cast<std::size_t>(end - history.begin()), 1);
}

}  // namespace

std::vector<ClockPoint> clock_history(const ClockRecording& recording, ClockEstimator& estimator) {
    Points history;
    std::optional<Exchange> first;
    HostTime begin;
    double changed_ns = 0;
    for (const TimedMessage& timed : recording.messages) {
        const auto* exchange = std::get_if<Exchange>(&timed.message);
        const BoardTime board =
            exchange != nullptr ? board_middle(*exchange) : std::get<OneWay>(timed.message).sent;
        const HostEstimate before = estimator.translate(board);
        estimator.add(timed.message);
        const HostEstimate after = estimator.translate(board);
        if (after.state == ClockState::init) continue;
        const bool began = before.state == ClockState::init;
        if (!began) changed_ns += static_cast<double>(Wide{after.time.ns} - Wide{before.time.ns});
        if (exchange == nullptr) continue;
        if (!first) {
            first = *exchange;
            begin = after.time;
        }
        const HostTime host = host_middle(*exchange);
        const Wide advance_host = Wide{after.time.ns} - Wide{host_middle(*first).ns};
        const Wide advance_board = Wide{board.ns} - Wide{board_middle(*first).ns};
        const HostTime expected = began ? after.time : before.time;
        // Both stamps of a point are at one instant, by the estimate; the midpoint may be far from
        // it.
        history.push_back({static_cast<double>(Wide{after.time.ns} - Wide{begin.ns}) * 1e-9,
                           static_cast<double>(advance_host - advance_board),
                           static_cast<double>(after.sigma.ns), estimator.skew_ppm(),
                           estimator.skew_sigma_ppm(),
                           static_cast<double>(Wide{host.ns} - Wide{expected.ns}), changed_ns});
        changed_ns = 0;
    }
    std::stable_sort(history.begin(), history.end(),
                     [](const ClockPoint& a, const ClockPoint& b) { return a.time_s < b.time_s; });
    return history;
}

std::string clock_svg(const std::vector<ClockPoint>& history, const ClockPlotTexts& texts) {
    const std::size_t split = end_of_start(history);
    const Points begin(history.begin(), history.begin() + static_cast<std::ptrdiff_t>(split));
    Points rest(history.begin() + static_cast<std::ptrdiff_t>(split), history.end());
    if (rest.empty()) rest = begin;
    const auto half = rest.begin() + static_cast<std::ptrdiff_t>(rest.size() / 2);
    const Line line = fitted(Points(half, rest.end()));  // an estimator may take long to converge
    std::string out = fmt::format(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" "
        "width=\"{0}\" "
        "height=\"{1}\" viewBox=\"0 0 {0} {1}\" font-family=\"sans-serif\">\n"
        "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        page_width, page_height);
    out += svg::text(page_width / 2, 26, texts.title, Anchor::middle, 17);
    out += svg::text(
        page_width / 2, 47,
        fmt::format("estimator {}, {} exchanges in {:.1f} s; the straight line: {:+.4f} ppm",
                    texts.estimator, history.size(), history.back().time_s - history.front().time_s,
                    std::round(line.slope * 10) * 1e-4 + 0.0),
        Anchor::middle, 12, "#666");
    out += Column(begin, column_left[0], line, start_title(begin)).drawn();
    out += Column(std::move(rest), column_left[1], line, "after convergence").drawn();
    return out + "</svg>\n";
}

Expected<std::size_t> plot_clock(const ClockPlotSettings& settings) {
    const auto checked = check_output(settings.out, {settings.exchanges, settings.oneway});
    if (!checked) return Unexpected(checked.error());
    const auto recording = read_clock_recording(settings.exchanges, settings.oneway);
    if (!recording) return Unexpected(recording.error());
    const auto estimator = make_estimator(settings.estimator);
    const Points history = clock_history(*recording, *estimator);
    if (history.empty())
        return failure(settings.exchanges, "contains no exchange that an estimator can start from",
                       "round trips must be positive: are the columns in the right order?");
    const std::string name = settings.estimator == EstimatorKind::envelope ? "envelope"
                             : settings.estimator == EstimatorKind::ekf
                                 ? "ekf, published start values"
                                 : "ekf, fair start values";
    const std::string title = settings.title.empty()
                                  ? std::filesystem::path(settings.exchanges).filename().string()
                                  : settings.title;
    const auto written = write_whole_file(settings.out, clock_svg(history, {title, name}));
    if (!written) return Unexpected(written.error());
    return history.size();
}

}  // namespace versavis::client
