// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/led_report.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

using namespace versavis;
using namespace versavis::client;

namespace {

struct Series {
    double rate_hz = 970;
    double frame_hz = 10;
    double exposure_s = 1e-3;
    double late_s = 0;  ///< it exposes so much later than its stamps say
    double skew = 0;    ///< the board's clock runs faster by this share
    double noise = 0;   ///< of the levels
    double first_s = 5.00021;
    LedLayout layout{};
    int frames = 400;
    unsigned seed = 1;
};

std::vector<LedObservation> shots(const Series& series) {
    std::mt19937 random(series.seed);
    std::normal_distribution<> noise(0, series.noise > 0 ? series.noise : 1);
    std::vector<LedObservation> out;
    for (int i = 0; i < series.frames; ++i) {
        LedObservation shot;
        shot.tick = static_cast<std::uint64_t>(i);
        const double stamp_s = series.first_s + i / series.frame_hz;
        shot.time = OutputTime{std::llround(stamp_s * 1e9)};
        shot.exposure = Duration{std::llround(series.exposure_s * 1e9)};
        const double middle_s = (stamp_s + series.late_s) * (1 + series.skew);
        const double start = (middle_s - series.exposure_s / 2) * series.rate_hz;
        shot.picture.state = LedState::good;
        shot.picture.levels = led_levels(start - 64 * std::floor(start / 64),
                                         series.exposure_s * series.rate_hz, series.layout);
        if (series.noise > 0)
            for (double& level : shot.picture.levels) level += noise(random);
        out.push_back(shot);
    }
    return out;
}

LedReport report_of(const LedObservations& all, double rate_hz = 970,
                    const LedLayout& layout = {}) {
    LedReportSettings settings;
    settings.rate_hz = rate_hz;
    settings.layout = layout;
    const auto made = led_report(all, settings);
    REQUIRE(made);
    return *made;
}

bool notes(const LedReport& report, const std::string& text) {
    for (const std::string& note : report.notes)
        if (note.find(text) != std::string::npos) return true;
    return false;
}

}  // namespace

TEST_CASE("led_report: 400 pairs match, and an offset within a step is found") {
    Series second;
    second.late_s = 37e-6;
    second.noise = 0.02;
    second.seed = 2;
    second.layout.binary_first = true;
    Series first;
    first.noise = 0.02;
    first.skew = second.skew = 40e-6;
    const LedReport made = report_of({{"cam0", shots(first)}, {"cam1", shots(second)}});
    INFO(to_text(made));
    CHECK(made.ok());
    const LedPairReport& pair = made.pairs.at(0);
    CHECK(pair.pairs == 400);
    CHECK(pair.matches == 400);
    CHECK(pair.offset_us == Approx(37).margin(4));
    CHECK(std::abs(pair.offset_us - 37) < 2 * pair.interval_us);
    CHECK(pair.interval_us < 5);
    CHECK_FALSE(made.cameras.at(0).binary_first);
    CHECK(made.cameras.at(1).binary_first);
    CHECK(made.cameras.at(0).increments == 399);
    CHECK(made.cameras.at(0).rate_hz == Approx(970 * (1 + 40e-6)).epsilon(3e-6));
    CHECK(made.notes.empty());
    CHECK(to_json(made)["pairs"][0]["offset_us"].get<double>() == pair.offset_us);
    CHECK_THAT(to_text(made), Catch::Contains("400 match (3 of them up to 32 steps), 0 do not"));
}

TEST_CASE("led_report: a camera that is a step off, or a whole picture, does not match") {
    Series second;
    second.late_s = GENERATE(1e-3, -3e-3, 0.1, -0.1);
    const LedReport made = report_of({{"cam0", shots({})}, {"cam1", shots(second)}});
    CHECK_FALSE(made.ok());
    CHECK(made.pairs.at(0).mismatches == 400);
    CHECK(made.cameras.at(1).wrong_increments == 0);
}

TEST_CASE("led_report: a slip in the middle is a wrong increment, and mismatches after it") {
    auto slipped = shots({});
    for (std::size_t i = 200; i < slipped.size(); ++i)
        slipped[i].picture = shots({})[i + 1 < slipped.size() ? i + 1 : i].picture;
    const LedReport made = report_of({{"cam0", shots({})}, {"cam1", slipped}});
    CHECK(made.cameras.at(1).wrong_increments == 2);  // the last picture stands still
    CHECK(made.pairs.at(0).mismatches == 199);
}

TEST_CASE("led_report: wrong direction and order of bits are reported, with those that fit") {
    Series series;
    series.layout.backward = GENERATE(true, false);
    series.layout.high_bit_first = !series.layout.backward;
    const LedReport made = report_of({{"cam0", shots(series)}, {"cam1", shots(series)}});
    CHECK_FALSE(made.ok());
    CHECK(notes(made, series.layout.backward
                          ? "they fit with --direction backward --bits low-first"
                          : "they fit with --direction forward --bits high-first"));
}

TEST_CASE("led_report: at 1 kHz and 10 Hz there are blind spots, and they are reported") {
    Series series;
    series.rate_hz = 1000;
    const LedReport made = report_of({{"cam0", shots(series)}, {"cam1", shots(series)}}, 1000);
    CHECK(made.ok());
    CHECK(notes(made, "only 16 of 64 counts ever occur"));
    CHECK(notes(made, "so would the wrong direction"));
    // What is blind: sixteen pictures off.
    Series off = series;
    off.late_s = 1.6;
    CHECK(report_of({{"cam0", shots(series)}, {"cam1", shots(off)}}, 1000).ok());
    series.rate_hz = off.rate_hz = 970;
    CHECK_FALSE(report_of({{"cam0", shots(series)}, {"cam1", shots(off)}}).ok());
}

TEST_CASE("led_report: the wrong rate is reported, a rate that is a little off as well") {
    CHECK(notes(report_of({{"cam0", shots({})}, {"cam1", shots({})}}, 1003.3), "--rate"));
    Series series;
    series.rate_hz = 971;
    CHECK(notes(report_of({{"cam0", shots(series)}, {"cam1", shots(series)}}, 970), "971.000"));
}

TEST_CASE("led_report: exposures that are short show counts alone, those that are long nothing") {
    Series series;
    series.exposure_s = 0.2e-3;
    const LedReport made = report_of({{"cam0", shots(series)}, {"cam1", shots(series)}});
    CHECK(made.ok());
    CHECK(made.pairs.at(0).split == 0);
    CHECK(std::isinf(made.pairs.at(0).interval_us));
    CHECK(notes(made, "expose for 1134 us"));
    CHECK(to_json(made)["pairs"][0]["offset_us"].is_null());
    series.exposure_s = 5e-3;
    const auto none = led_report({{"cam0", shots(series)}}, {});
    REQUIRE_FALSE(none);
    CHECK_THAT(none.error().message(), Catch::Contains("too long") && Catch::Contains("3000 us"));
}

TEST_CASE("led_report: saturated LEDs show the count alone, hidden ones nothing") {
    auto bright = shots({});
    for (LedObservation& shot : bright) shot.picture.state = LedState::saturated;
    const LedReport made = report_of({{"cam0", shots({})}, {"cam1", bright}});
    CHECK(made.pairs.at(0).matches == 400);
    CHECK(made.pairs.at(0).split == 0);
    CHECK(notes(made, "cam1: its LEDs are saturated"));
    auto hidden = shots({});
    for (LedObservation& shot : hidden) shot.picture.state = LedState::hidden;
    CHECK(report_of({{"cam0", shots({})}, {"cam1", hidden}}).pairs.at(0).pairs == 0);
    const auto none = led_report({{"cam1", hidden}}, {});
    REQUIRE_FALSE(none);
    CHECK_THAT(none.error().message(), Catch::Contains("400 without the outermost LEDs"));
    CHECK_FALSE(led_report({}, {}));
}

TEST_CASE("led_report: pairs are of one tick, epoch and life, and one camera makes none") {
    auto other = shots({});
    for (std::size_t i = 0; i < other.size(); ++i) {
        if (i < 100) other[i].epoch = 1;
        if (i >= 300) other[i].life = 1;
        if (i % 2 == 1) other[i].tick += 1000;
    }
    CHECK(report_of({{"cam0", shots({})}, {"cam1", other}}).pairs.at(0).pairs == 100);
    const LedReport alone = report_of({{"cam0", shots({})}});
    CHECK_FALSE(alone.ok());
    CHECK(notes(alone, "only one camera"));
}

TEST_CASE("led_report: pictures that were not triggered are in no pair, and that is reported") {
    auto arrived = shots({});
    for (LedObservation& shot : arrived) {
        shot.triggered = false;
        shot.tick = 0;
    }
    const LedReport free = report_of({{"cam0", arrived}, {"cam1", arrived}});
    CHECK(free.pairs.at(0).pairs == 0);
    CHECK(free.cameras.at(0).untriggered == 400);
    CHECK(notes(free, "cam0: 400 pictures were not triggered"));
    CHECK(report_of({{"cam0", arrived}, {"cam1", shots({})}}).pairs.at(0).pairs == 0);
    CHECK(to_json(free)["cameras"][0]["untriggered"] == 400);
}
