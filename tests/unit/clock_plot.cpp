// SPDX-License-Identifier: BSD-3-Clause
#include "clock/clock_plot.hpp"

#include <boost/property_tree/ptree.hpp>
#include <boost/property_tree/xml_parser.hpp>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <sstream>

#include "clock/svg_panel.hpp"

using namespace versavis;
using namespace versavis::client;
using Catch::Contains;

namespace {

/// Exchanges with a board that runs 50 ppm slow; each delay is the longer, the later in a cycle.
ClockRecording recording(std::int64_t count, Duration interval = milliseconds(100)) {
    ClockRecording all;
    for (std::int64_t i = 0; i < count; ++i) {
        const std::int64_t t = i * interval.ns;
        const std::int64_t there = 100'000 + i % 7 * 10'000;
        const std::int64_t back = 100'000 + i % 5 * 10'000;
        const auto board = [](std::int64_t host) { return BoardTime{host - host / 20'000}; };
        all.messages.push_back(
            {{t + there + back},
             clock::Exchange{{t}, board(t + there), board(t + there), {t + there + back}}});
    }
    return all;
}

std::vector<ClockPoint> history(std::int64_t count, EstimatorKind kind = EstimatorKind::envelope) {
    return clock_history(recording(count), *make_estimator(kind));
}

/// Throws when it is no well-formed XML.
boost::property_tree::ptree parsed(const std::string& svg) {
    std::istringstream in(svg);
    boost::property_tree::ptree tree;
    boost::property_tree::read_xml(in, tree);
    return tree;
}

/// All texts of the drawing, one per line.
std::string texts(const boost::property_tree::ptree& tree) {
    std::string out;
    for (const auto& [name, child] : tree)
        out += name == "text" ? child.data() + "\n" : texts(child);
    return out;
}

}  // namespace

TEST_CASE("clock_plot: history has a point per exchange, with what it measured and changed") {
    const auto points =
        clock_history(recording(600, seconds(1)), *make_estimator(EstimatorKind::ekf_fair));
    REQUIRE(points.size() == 600);
    CHECK(points[0].time_s == 0);
    CHECK(points[0].residual_ns == 0);
    CHECK(points[599].time_s == Approx(599).margin(0.01));
    // Host minus board clock grows by 50 us a second.
    CHECK(points[599].offset_ns - points[499].offset_ns == Approx(5e6).epsilon(0.05));
    CHECK(points[599].skew_ppm == Approx(50).epsilon(0.05));
    // The published gain is the ratio of the two.
    CHECK(points[599].innovation_ns == Approx(0.0515 * points[599].residual_ns).margin(2));
}

TEST_CASE("clock_plot: corrections by one-way messages count for the next exchange") {
    auto mixed = recording(2);
    const auto alone = clock_history(mixed, *make_estimator(EstimatorKind::envelope));
    mixed.messages.insert(mixed.messages.begin() + 1,
                          {{50'000'000}, clock::OneWay{{40'000'000}, {50'000'000}}});
    CHECK(clock_history(mixed, *make_estimator(EstimatorKind::envelope)).size() == alone.size());
}

TEST_CASE("clock_plot: the drawing is XML with all four panels twice, each with its unit") {
    const auto count = GENERATE(1, 2, 40, 2000);
    const std::string svg = clock_svg(history(count), {"title", "envelope"});
    const std::string all = texts(parsed(svg));
    for (const char* label :
         {"offset [", "skew [ppm]", "residual [", "innovation [", "time since"}) {
        const auto first = all.find(label);
        CHECK(first != std::string::npos);
        CHECK(all.find(label, first + 1) != std::string::npos);
    }
    CHECK(svg.find("nan") == std::string::npos);
    CHECK(svg.find("inf") == std::string::npos);
}

TEST_CASE("clock_plot: a title may hold anything") {
    const std::string title = "<&\">\x01 \xC3\xA9 \xFF \xED\xA0\x80 \xE2\x82";
    CHECK_THAT(texts(parsed(clock_svg(history(5), {title, "x"}))),
               Contains("<&\">? \xC3\xA9 ? ??? ??"));
}

TEST_CASE("clock_plot: its size does not grow with the recording") {
    const std::string small = clock_svg(history(20'000), {"", ""});
    const std::string large = clock_svg(history(200'000), {"", ""});
    CHECK(large.size() < 500'000);
    CHECK(large.size() < 2 * small.size());
}

TEST_CASE("clock_plot: absurd stamps are drawn, too") {
    constexpr std::int64_t far = std::int64_t{1} << 60;
    ClockRecording all = recording(10);
    for (const std::int64_t h : {far, -far})
        all.messages.push_back({{h}, clock::Exchange{{h}, {-h}, {-h}, {h + 1000}}});
    for (const auto kind : {EstimatorKind::ekf, EstimatorKind::ekf_fair}) {
        const std::string svg = clock_svg(clock_history(all, *make_estimator(kind)), {"", ""});
        CHECK_NOTHROW(parsed(svg));
        CHECK(svg.find("nan") == std::string::npos);
    }
}

TEST_CASE("svg_panel: ticks are round and within the span") {
    CHECK(svg::ticks({0, 10}, 5) == std::vector<double>{0, 2, 4, 6, 8, 10});
    CHECK(svg::ticks({-0.13, 0.21}, 4) == std::vector<double>{-0.1, 0, 0.1, 0.2});
    CHECK(svg::tick_label(0.25, 0.05) == "0.25");
    CHECK(svg::tick_label(-3, 1) == "-3");
    const svg::Span constant = svg::span_of({5, 5, 5});
    CHECK(constant.low < 5);
    CHECK(constant.high > 5);
}

TEST_CASE("svg_panel: what is outside of the axes is counted and not drawn") {
    svg::Panel panel({0, 0, 100, 100}, {0, 1}, {0, 1});
    CHECK(panel.cloud({{0.5, 0.5}, {0.5, 2}, {0.5, -1}}, "red") == 2);
    CHECK_THAT(panel.finished("y", "x"), Contains("M50.0 50.0h0") && !Contains("-100.0h0"));
}
