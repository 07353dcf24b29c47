// SPDX-License-Identifier: BSD-3-Clause
// A verification as a page that stands alone.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/markup_text.hpp"

#include "verify/verification.hpp"

namespace versavis::client {

namespace {

constexpr double chart_left = 90;
constexpr double chart_width = 860;
constexpr double strip_height = 18;
constexpr double plot_height = 110;

constexpr auto head = R"(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{title}</title><style>
:root{{--ink:#1b1f24;--paper:#fff;--line:#c8ccd1;--proved:#2e7d32;--plausible:#c77700;--untrusted:#b71c1c;
--band:#d7e8d8}}
@media(prefers-color-scheme:dark){{:root{{--ink:#e6e8ea;--paper:#16181b;--line:#454b52;--proved:#66bb6a;
--plausible:#ffb74d;--untrusted:#ef5350;--band:#24382a}}}}
body{{font:15px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper);max-width:60rem;
margin:2rem auto;padding:0 1rem}}
h1{{font-size:1.4rem}}h2{{font-size:1.1rem;margin-top:2rem}}
table{{border-collapse:collapse;width:100%}}td,th{{padding:.25rem .6rem;text-align:right;
border-bottom:1px solid var(--line)}}td:first-child,th:first-child,.text td,.text th{{text-align:left}}
.verdict{{font-weight:600;padding:.6rem .9rem;border-left:.4rem solid}}
.proved{{border-color:var(--proved);fill:var(--proved)}}
.plausible{{border-color:var(--plausible);fill:var(--plausible)}}
.untrusted{{border-color:var(--untrusted);fill:var(--untrusted)}}
svg{{width:100%;height:auto}}svg text{{font-size:12px;fill:var(--ink)}}
.key svg{{width:.8em;height:.8em}}
</style></head><body>
)";

const char* style_of(Grade grade) {
    switch (grade) {
        case Grade::untrusted: return "untrusted";
        case Grade::plausible: return "plausible";
        case Grade::proved: break;
    }
    return "proved";
}

/// Where a second is on the time line.
class TimeAxis {
 public:
    explicit TimeAxis(std::int64_t seconds) : seconds_(std::max<std::int64_t>(1, seconds)) {}

    double x(double second) const {
        return chart_left + chart_width * second / static_cast<double>(seconds_);
    }

    /// Ticks and their labels, below `y`.
    std::string ticks(double y) const {
        std::int64_t step = 1;
        for (const std::int64_t factor : {5, 2, 6, 5, 2, 6, 10, 10})
            if (seconds_ / step > 10) step *= factor;
        std::string svg;
        for (std::int64_t at = 0; at <= seconds_; at += step) {
            const double place = x(static_cast<double>(at));
            svg += fmt::format(
                R"svg(<line x1="{0:.1f}" x2="{0:.1f}" y1="{1:.1f}" y2="{2:.1f}" stroke="var(--line)"/>)svg"
                R"(<text x="{0:.1f}" y="{3:.1f}" text-anchor="middle">{4} s</text>)",
                place, y, y + 5, y + 18, at);
        }
        return svg + "\n";
    }

 private:
    std::int64_t seconds_;
};

/// Seconds in a row of one grade are one bar.
std::string strip(const StreamVerdict& stream, const TimeAxis& axis, double y) {
    std::string svg = fmt::format(R"(<text x="{}" y="{}" text-anchor="end">{}</text>)",
                                  chart_left - 8, y + strip_height - 5, markup_text(stream.name));
    auto from = stream.seconds.begin();
    while (from != stream.seconds.end()) {
        auto to = from;
        std::int64_t last = from->first;
        while (to != stream.seconds.end() && to->second.grade == from->second.grade &&
               to->first <= last + 1)
            last = (to++)->first;
        const double left = axis.x(static_cast<double>(from->first));
        const double wide = axis.x(static_cast<double>(last + 1)) - left;
        svg +=
            fmt::format(R"(<rect class="{}" x="{:.1f}" y="{}" width="{:.2f}" height="{}">)"
                        R"(<title>{}, seconds {} to {}: {}</title></rect>)",
                        style_of(from->second.grade), left, y, std::max(wide, 1.0), strip_height,
                        markup_text(stream.name), from->first, last, to_string(from->second.grade));
        from = to;
    }
    return svg + "\n";
}

std::string time_line(const Verification& verification) {
    const TimeAxis axis(verification.seconds);
    std::string svg;
    double y = 4;
    for (const StreamVerdict& stream : verification.streams) {
        svg += strip(stream, axis, y);
        y += strip_height + 6;
    }
    svg += axis.ticks(y);
    return fmt::format(R"(<svg viewBox="0 0 {} {}" role="img" aria-label="verdict by second">)",
                       chart_left + chart_width + 30, y + 24) +
           "\n" + svg + "</svg>\n";
}

/// Host times of the stream within their bounds.
std::string bounds_plot(const StreamVerdict& stream, std::int64_t seconds) {
    double most = 1;
    for (const auto& [second, verdict] : stream.seconds)
        most = std::max({most, static_cast<double>(verdict.half_width.ns) * 1.2,
                         std::abs(static_cast<double>(verdict.lowest.ns)),
                         std::abs(static_cast<double>(verdict.highest.ns))});
    const TimeAxis axis(seconds);
    const auto y = [&](double ns) { return plot_height / 2 + 8 - ns / most * plot_height / 2; };
    std::string band;
    std::string stamps;
    for (const auto& [second, verdict] : stream.seconds) {
        if (verdict.half_width.ns == 0) continue;
        const auto half = static_cast<double>(verdict.half_width.ns);
        const double left = axis.x(static_cast<double>(second));
        const double wide = axis.x(static_cast<double>(second + 1)) - left;
        const auto bar = [&](double low, double high, const char* fill) {
            return fmt::format(
                R"(<rect x="{:.2f}" y="{:.2f}" width="{:.2f}" height="{:.2f}" fill="{}"/>)", left,
                y(high), wide, std::max(y(low) - y(high), 1.2), fill);
        };
        band += bar(-half, half, "var(--band)");
        stamps += bar(static_cast<double>(verdict.lowest.ns),
                      static_cast<double>(verdict.highest.ns), "var(--ink)");
    }
    if (band.empty()) return "";
    const auto label = [&](double ns) {
        return fmt::format(R"(<text x="{}" y="{:.1f}" text-anchor="end">{:+.0f} us</text>)",
                           chart_left - 8, y(ns) + 4, ns * 1e-3);
    };
    return fmt::format("<h2>{}: host time against its bounds</h2>\n", markup_text(stream.name)) +
           fmt::format(R"(<svg viewBox="0 0 {} {}" role="img" aria-label="host time of {} against )"
                       R"(its bounds">)",
                       chart_left + chart_width + 30, plot_height + 40, markup_text(stream.name)) +
           "\n" + band + stamps + label(most) + label(-most) + label(0) +
           axis.ticks(plot_height + 12) + "</svg>\n";
}

std::string stream_table(const Verification& verification) {
    std::string rows;
    for (const StreamVerdict& stream : verification.streams)
        rows += fmt::format(
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>"
            "<td>{:.1f}</td></tr>\n",
            markup_text(stream.name), stream.items,
            stream.graded[static_cast<std::size_t>(Grade::proved)],
            stream.graded[static_cast<std::size_t>(Grade::plausible)],
            stream.graded[static_cast<std::size_t>(Grade::untrusted)], stream.withheld, stream.lost,
            static_cast<double>(stream.sigma.ns) * 1e-3);
    return "<table><tr><th>stream</th><th>items</th><th>proved</th><th>plausible</th><th>not to be "
           "trusted</th><th>suspect</th><th>lost</th><th>sigma, us</th></tr>\n" +
           rows + "</table>\n";
}

std::string finding_table(const Verification& verification) {
    std::string rows;
    for (const StreamVerdict& stream : verification.streams)
        for (const FindingSpan& span : stream.findings)
            rows += fmt::format(
                "<tr><td>{}</td><td>{} to {}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>"
                "</tr>\n",
                markup_text(stream.name), span.from_s, span.to_s, span.items,
                to_string(grade_of(span.finding)), markup_text(words_of(span.finding)),
                span.worst.ns == 0
                    ? ""
                    : fmt::format("{:+.1f} us", static_cast<double>(span.worst.ns) * 1e-3));
    if (rows.empty()) return "<p>Nothing was found.</p>\n";
    return "<table class=\"text\"><tr><th>stream</th><th>seconds</th><th>items</th><th>verdict</th>"
           "<th>finding</th><th>at most</th></tr>\n" +
           rows + "</table>\n";
}

}  // namespace

std::string to_html(const Verification& verification) {
    std::string page =
        fmt::format(head, fmt::arg("title", markup_text(verification.file) + ": verification"));
    page +=
        fmt::format("<h1>{}</h1>\n<p class=\"verdict {}\">{}</p>\n", markup_text(verification.file),
                    style_of(verification.grade()), markup_text(verification.sentence()));
    page += stream_table(verification);
    page += "<h2>Verdict by second</h2>\n<p class=\"key\">";
    for (const Grade grade : {Grade::proved, Grade::plausible, Grade::untrusted})
        page += fmt::format(
            R"(<svg viewBox="0 0 8 8" aria-hidden="true"><rect class="{}" width="8" height="8"/></svg> {} &nbsp; )",
            style_of(grade), to_string(grade));
    page += "</p>\n" + time_line(verification);
    page += "<h2>Findings</h2>\n" + finding_table(verification);
    for (const StreamVerdict& stream : verification.streams)
        page += bounds_plot(stream, verification.seconds);
    page += fmt::format(
        "<p>Grey band: where host times can lie at all, by {} exchanges with the board in {} "
        "boot{}; black: where they lie.</p>\n",
        verification.exchanges, verification.board_lives, verification.board_lives == 1 ? "" : "s");
    for (const std::string& note : verification.notes)
        page += fmt::format("<p>{}</p>\n", markup_text(note));
    return page + "</body></html>\n";
}

}  // namespace versavis::client
