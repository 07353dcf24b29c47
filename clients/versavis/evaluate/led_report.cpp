// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/led_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>

#include "base/median.hpp"
#include "evaluate/led_calibration.hpp"

namespace versavis::client {

namespace {

/// Two cameras that are off by less than half a step show the same count.
constexpr double half_step = 0.5;
/// Pictures used to detect at which end of the row a camera sees the running LEDs. If lower, a few
/// noisy ones decide.
constexpr std::size_t most_tried = 200;
/// Readings that a rate is fitted to, at least. If lower, noise makes it; if higher, short
/// recordings have none.
constexpr std::size_t least_fitted = 20;
/// Fewest pairs for a confidence interval. If lower, it is a guess; if higher, short recordings
/// have none.
constexpr std::size_t least_interval = 10;
/// The board's clock and that of the stamps differ by less. If lower, a bad oscillator is called a
/// wrong rate; if higher, 970.5 Hz is called 970.
constexpr double most_skew = 5e-4;
/// This share of wrong increments says that the board is read in a wrong way. If lower, a few bad
/// pictures do; if higher, a wrong order of bits passes for a bad service.
constexpr double doubtful_share = 0.2;
/// A phase known to this, in steps, is as good as one from a step within the exposure. If lower,
/// exposures of nearly a step have fewer of them; if higher, offsets are off by 10 us.
constexpr double exact = 0.005;
/// Normal distribution, 95 %.
constexpr double two_sided = 1.96;

double s(Duration d) { return static_cast<double>(d.ns) * 1e-9; }

struct Read {
    LedReading reading;
    bool usable = false;  ///< its count
    bool split = false;   ///< its phase within the step
};

bool readable(const LedObservation& shot, double rate_hz) {
    const double exposure = s(shot.exposure) * rate_hz;
    return exposure > 0 && exposure <= most_led_steps;
}

Read read_shot(const LedObservation& shot, double rate_hz, const LedLayout& layout) {
    Read read;
    if (shot.picture.state == LedState::hidden || !readable(shot, rate_hz)) return read;
    read.reading = read_leds(shot.picture.levels, s(shot.exposure) * rate_hz, layout);
    read.usable = !read.reading.ambiguous;
    read.split =
        read.usable && read.reading.half_width < exact && shot.picture.state == LedState::good;
    return read;
}

std::vector<Read> read_all(const std::vector<LedObservation>& shots, double rate_hz,
                           const LedLayout& layout) {
    std::vector<Read> all;
    all.reserve(shots.size());
    for (const LedObservation& shot : shots) all.push_back(read_shot(shot, rate_hz, layout));
    return all;
}

bool binary_first(const std::vector<LedObservation>& shots, double rate_hz, LedLayout layout) {
    double residuals[2] = {};
    const std::size_t stride = std::max<std::size_t>(1, shots.size() / most_tried);
    for (const bool reversed : {false, true}) {
        layout.binary_first = reversed;
        for (std::size_t i = 0; i < shots.size(); i += stride)
            residuals[reversed ? 1 : 0] += read_shot(shots[i], rate_hz, layout).reading.residual;
    }
    return residuals[1] < residuals[0];
}

/// Steps that the board made beyond those that the stamps say, from -32 to 32.
double excess(const LedObservation& a, const Read& read_a, const LedObservation& b,
              const Read& read_b, double rate_hz) {
    return wrapped_steps(read_b.reading.phase - read_a.reading.phase - s(b.time - a.time) * rate_hz,
                         std::min(read_a.reading.period, read_b.reading.period));
}

bool fits(double excess, const Read& a, const Read& b) {
    return std::abs(excess) < half_step + a.reading.half_width + b.reading.half_width;
}

bool continuous(const LedObservation& a, const LedObservation& b) {
    return a.life == b.life && a.epoch == b.epoch;
}

struct Increments {
    std::size_t all = 0;
    std::size_t wrong = 0;
};

Increments increments(const std::vector<LedObservation>& shots, const std::vector<Read>& reads,
                      double rate_hz) {
    Increments count;
    for (std::size_t i = 1; i < shots.size(); ++i) {
        if (!reads[i].usable || !reads[i - 1].usable || !continuous(shots[i - 1], shots[i]))
            continue;
        ++count.all;
        const double off = excess(shots[i - 1], reads[i - 1], shots[i], reads[i], rate_hz);
        if (!fits(off, reads[i - 1], reads[i])) ++count.wrong;
    }
    return count;
}

/// A line through phases over stamps, least squares.
struct Line {
    double rate_hz = 0;
    double scatter_s = 0;
};

std::optional<Line> fit_line(const std::vector<LedObservation>& shots,
                             const std::vector<Read>& reads, double rate_hz) {
    std::vector<double> t;
    std::vector<double> beyond;  // steps beyond rate_hz * t
    std::optional<std::size_t> last;
    for (std::size_t i = 0; i < shots.size(); ++i) {
        if (!reads[i].split) continue;
        const bool first = !last.has_value();
        if (!first && !continuous(shots[*last], shots[i])) break;
        beyond.push_back(first ? 0
                               : beyond.back() + excess(shots[*last], reads[*last], shots[i],
                                                        reads[i], rate_hz));
        t.push_back(first ? 0 : t.back() + s(shots[i].time - shots[*last].time));
        last = i;
    }
    if (t.size() < least_fitted) return std::nullopt;
    const auto n = static_cast<double>(t.size());
    const double mean_t = std::accumulate(t.begin(), t.end(), 0.0) / n;
    const double mean_b = std::accumulate(beyond.begin(), beyond.end(), 0.0) / n;
    double tt = 0;
    double tb = 0;
    for (std::size_t i = 0; i < t.size(); ++i) {
        tt += (t[i] - mean_t) * (t[i] - mean_t);
        tb += (t[i] - mean_t) * (beyond[i] - mean_b);
    }
    const double slope = tt > 0 ? tb / tt : 0;
    double squares = 0;
    for (std::size_t i = 0; i < t.size(); ++i)
        squares += std::pow(beyond[i] - mean_b - slope * (t[i] - mean_t), 2);
    return Line{rate_hz + slope, std::sqrt(squares / n) / rate_hz};
}

struct Camera {
    const std::vector<LedObservation>* recorded = nullptr;
    std::vector<LedObservation> shots;  ///< calibrated by the layout
    std::vector<Read> reads;
    LedLayout layout;
};

LedCameraReport report_camera(const std::string& name, const Camera& camera, double rate_hz) {
    LedCameraReport report;
    report.name = name;
    report.binary_first = camera.layout.binary_first;
    report.pictures = camera.shots.size();
    for (std::size_t i = 0; i < camera.shots.size(); ++i) {
        const LedObservation& shot = camera.shots[i];
        const Read& read = camera.reads[i];
        if (!readable(shot, rate_hz))
            ++report.too_long;
        else if (shot.picture.state == LedState::hidden)
            ++report.hidden;
        else if (!read.usable)
            ++report.ambiguous;
        if (shot.picture.state == LedState::saturated) ++report.saturated;
        if (read.usable) ++report.read;
        if (read.split) ++report.split;
        if (!shot.triggered) ++report.untriggered;
    }
    const Increments counted = increments(camera.shots, camera.reads, rate_hz);
    report.increments = counted.all;
    report.wrong_increments = counted.wrong;
    if (const auto line = fit_line(camera.shots, camera.reads, rate_hz)) {
        report.rate_hz = line->rate_hz;
        report.scatter_us = line->scatter_s * 1e6;
    }
    return report;
}

/// Mean, scatter and interval of the offsets of single pairs.
void describe(LedPairReport& report, const std::vector<double>& offsets_us) {
    report.split = offsets_us.size();
    report.interval_us = std::numeric_limits<double>::infinity();
    if (offsets_us.empty()) return;
    const auto n = static_cast<double>(offsets_us.size());
    report.offset_us = std::accumulate(offsets_us.begin(), offsets_us.end(), 0.0) / n;
    double squares = 0;
    for (const double offset : offsets_us) {
        squares += std::pow(offset - report.offset_us, 2);
        report.largest_us = std::max(report.largest_us, std::abs(offset));
    }
    if (offsets_us.size() < least_interval) return;
    report.deviation_us = std::sqrt(squares / (n - 1));
    report.interval_us = two_sided * report.deviation_us / std::sqrt(n);
}

LedPairReport report_pair(const std::string& first, const Camera& a, const std::string& second,
                          const Camera& b, double rate_hz) {
    LedPairReport report;
    report.first = first;
    report.second = second;
    std::vector<double> offsets_us;
    std::map<std::pair<std::uint64_t, std::pair<std::uint32_t, std::uint64_t>>, std::size_t>
        of_tick;
    const auto key = [](const LedObservation& shot) {
        return std::pair(shot.life, std::pair(shot.epoch, shot.tick));
    };
    for (std::size_t i = 0; i < b.shots.size(); ++i)
        if (b.shots[i].triggered) of_tick[key(b.shots[i])] = i;
    for (std::size_t i = 0; i < a.shots.size(); ++i) {
        if (!a.shots[i].triggered) continue;
        const auto found = of_tick.find(key(a.shots[i]));
        if (found == of_tick.end()) continue;
        const LedObservation& shot_b = b.shots[found->second];
        const Read& read_b = b.reads[found->second];
        const bool seen = a.shots[i].picture.state != LedState::hidden &&
                          shot_b.picture.state != LedState::hidden;
        if (!seen) continue;
        ++report.pairs;
        if (!a.reads[i].usable || !read_b.usable) {
            ++report.ambiguous;
            continue;
        }
        const double off = excess(a.shots[i], a.reads[i], shot_b, read_b, rate_hz);
        const bool halved = std::min(a.reads[i].reading.period, read_b.reading.period) < led_period;
        if (std::abs(off) < half_step && halved) ++report.modulo_32;
        if (std::abs(off) < half_step)
            ++report.matches;
        else if (fits(off, a.reads[i], read_b))
            ++report.ambiguous;
        else
            ++report.mismatches;
        if (a.reads[i].split && read_b.split) offsets_us.push_back(off / rate_hz * 1e6);
    }
    describe(report, offsets_us);
    return report;
}

std::string describe(const LedLayout& layout) {
    return fmt::format("--direction {} --bits {}", layout.backward ? "backward" : "forward",
                       layout.high_bit_first ? "high-first" : "low-first");
}

/// The layouts that the increments of all cameras fit.
std::vector<std::string> fitting_layouts(const std::map<std::string, Camera>& cameras,
                                         double rate_hz) {
    std::vector<std::string> fitting;
    for (const bool backward : {false, true})
        for (const bool high_bit_first : {false, true}) {
            Increments sum;
            LedLayout layout{high_bit_first, backward, false};
            for (const auto& [name, camera] : cameras) {
                layout.binary_first = camera.layout.binary_first;
                const auto shots = calibrated_leds(*camera.recorded, rate_hz, layout);
                const Increments some =
                    increments(shots, read_all(shots, rate_hz, layout), rate_hz);
                sum.all += some.all;
                sum.wrong += some.wrong;
            }
            if (sum.all > 0 &&
                static_cast<double>(sum.wrong) < doubtful_share * static_cast<double>(sum.all))
                fitting.push_back(describe(layout));
        }
    return fitting;
}

/// The usual time from picture to picture.
std::optional<double> period_s(const std::vector<LedObservation>& shots) {
    std::vector<double> steps;
    for (std::size_t i = 1; i < shots.size(); ++i)
        if (continuous(shots[i - 1], shots[i]))
            steps.push_back(s(shots[i].time - shots[i - 1].time));
    if (steps.empty()) return std::nullopt;
    return median(std::move(steps));
}

/// A service that is wrong by whole pictures shows the same counts again after some of them.
void note_blind_spots(LedReport& report, const std::map<std::string, Camera>& cameras) {
    for (const auto& [name, camera] : cameras) {
        const auto period = period_s(camera.shots);
        if (!period || *period <= 0) continue;
        const double steps = *period * report.rate_hz;
        const auto whole = std::llround(steps);
        if (std::abs(steps - static_cast<double>(whole)) > 0.01) continue;
        const std::int64_t seen =
            led_period / std::gcd<std::int64_t>(whole % led_period, led_period);
        if (seen >= led_period) continue;
        report.notes.push_back(fmt::format(
            "{}: at {:.6g} steps from picture to picture only {} of 64 counts ever occur: an error "
            "of a multiple of {} pictures would go unnoticed{}; at 970 Hz all counts occur",
            name, steps, seen, seen,
            whole % 4 == 0 ? ", and so would the wrong direction of the running LEDs" : ""));
    }
}

void note_increments(LedReport& report, const std::map<std::string, Camera>& cameras,
                     const LedReportSettings& settings) {
    std::size_t all = 0;
    std::size_t wrong = 0;
    for (const LedCameraReport& camera : report.cameras) {
        all += camera.increments;
        wrong += camera.wrong_increments;
    }
    if (static_cast<double>(wrong) <= doubtful_share * static_cast<double>(all)) return;
    const std::vector<std::string> fitting = fitting_layouts(cameras, report.rate_hz);
    if (fitting.empty())
        report.notes.push_back(
            fmt::format("{} of {} increments contradict the stamps, whatever the order of the "
                        "LEDs: is --rate {:g} right?",
                        wrong, all, settings.rate_hz));
    else
        report.notes.push_back(
            fmt::format("{} of {} increments contradict the stamps with {}; they fit with {}",
                        wrong, all, describe(settings.layout), fmt::join(fitting, ", or ")));
}

void note_cameras(LedReport& report) {
    for (const LedCameraReport& camera : report.cameras) {
        if (2 * camera.saturated > camera.pictures)
            report.notes.push_back(camera.name +
                                   ": its LEDs are saturated, so offsets within a step are not "
                                   "measured; reduce its gain, or close its iris");
        else if (camera.read > 0 && camera.split == 0)
            report.notes.push_back(
                fmt::format("{}: no step fell into an exposure, so offsets within a step are not "
                            "measured; expose for {:.4g} us, a little more than a step",
                            camera.name, 1.1e6 / report.rate_hz));
        if (camera.too_long > 0)
            report.notes.push_back(
                fmt::format("{}: {} exposures are unknown or last more than {:g} steps; expose "
                            "shorter, or pass --exposure {}=US",
                            camera.name, camera.too_long, most_led_steps, camera.name));
        if (camera.untriggered > 0)
            report.notes.push_back(fmt::format(
                "{}: {} pictures were not triggered: they have no tick, and are in no pair",
                camera.name, camera.untriggered));
        if (camera.rate_hz > 0 && std::abs(camera.rate_hz / report.rate_hz - 1) > most_skew)
            report.notes.push_back(fmt::format(
                "{}: according to its stamps, the board makes {:.3f} steps per second, not {:g}",
                camera.name, camera.rate_hz, report.rate_hz));
    }
    if (report.pairs.empty())
        report.notes.emplace_back("only one camera sees the board: there are no pairs");
}

/// Why nothing could be read.
Error nothing_read(const LedReport& report) {
    std::size_t too_long = 0;
    std::size_t hidden = 0;
    std::size_t ambiguous = 0;
    for (const LedCameraReport& camera : report.cameras) {
        too_long += camera.too_long;
        hidden += camera.hidden;
        ambiguous += camera.ambiguous;
    }
    const std::string counts = fmt::format(
        "no picture could be read: {} exposures unknown or too long, {} without the outermost "
        "LEDs, "
        "{} ambiguous",
        too_long, hidden, ambiguous);
    if (too_long >= hidden && too_long >= ambiguous)
        return {"", counts,
                fmt::format("expose for at most {:.4g} us, three steps",
                            most_led_steps * 1e6 / report.rate_hz)};
    if (hidden >= ambiguous)
        return {"", counts, "give the positions of the outermost LEDs: --board CAMERA=X1,Y1,X2,Y2"};
    return {"", counts, "docs/user/evaluate.md shows the board that is expected"};
}

}  // namespace

std::size_t LedReport::pictures_read() const {
    std::size_t read = 0;
    for (const LedCameraReport& camera : cameras) read += camera.read;
    return read;
}

bool LedReport::ok() const {
    const bool increments_fit = std::all_of(cameras.begin(), cameras.end(),
                                            [](const auto& c) { return c.wrong_increments == 0; });
    const bool pairs_match = std::all_of(pairs.begin(), pairs.end(), [](const auto& p) {
        return p.mismatches == 0 && p.matches > 0;
    });
    return !pairs.empty() && increments_fit && pairs_match;
}

Expected<LedReport> led_report(const LedObservations& shots, const LedReportSettings& settings) {
    LedReport report;
    report.rate_hz = settings.rate_hz;
    std::map<std::string, Camera> cameras;
    for (const auto& [name, of_camera] : shots) {
        Camera camera{&of_camera, {}, {}, settings.layout};
        const auto known = settings.binary_first.find(name);
        camera.layout.binary_first = known != settings.binary_first.end()
                                         ? known->second
                                         : binary_first(of_camera, report.rate_hz, camera.layout);
        camera.shots = calibrated_leds(of_camera, report.rate_hz, camera.layout);
        camera.reads = read_all(camera.shots, report.rate_hz, camera.layout);
        report.cameras.push_back(report_camera(name, camera, report.rate_hz));
        cameras.emplace(name, std::move(camera));
    }
    if (report.pictures_read() == 0) return Unexpected(nothing_read(report));
    for (auto a = cameras.begin(); a != cameras.end(); ++a)
        for (auto b = std::next(a); b != cameras.end(); ++b)
            report.pairs.push_back(
                report_pair(a->first, a->second, b->first, b->second, report.rate_hz));
    note_increments(report, cameras, settings);
    note_cameras(report);
    note_blind_spots(report, cameras);
    return report;
}

std::string to_text(const LedReport& report) {
    std::string text = fmt::format("LED board at {:g} steps per second: {}\n", report.rate_hz,
                                   report.ok() ? "all pairs match" : "NOT all match");
    for (const LedCameraReport& c : report.cameras)
        text += fmt::format(
            "  {}: {} pictures, {} read, {} ambiguous, {} hidden, {} saturated; {} increments, {} "
            "against the stamps; scatter {:.1f} us over {} with a step within the exposure\n",
            c.name, c.pictures, c.read, c.ambiguous, c.hidden, c.saturated, c.increments,
            c.wrong_increments, c.scatter_us, c.split);
    for (const LedPairReport& p : report.pairs) {
        text += fmt::format(
            "  {} and {}: {} pairs, {} match ({} of them up to 32 steps), {} do not, {} "
            "ambiguous",
            p.first, p.second, p.pairs, p.matches, p.modulo_32, p.mismatches, p.ambiguous);
        if (std::isfinite(p.interval_us))
            text += fmt::format(
                "; {} exposes {:+.1f} us (+-{:.1f}, 95 %) later than its stamps say, single pairs "
                "+-{:.1f} us",
                p.second, p.offset_us, p.interval_us, p.deviation_us);
        text += "\n";
    }
    for (const std::string& note : report.notes) text += "  note: " + note + "\n";
    return text;
}

nlohmann::json to_json(const LedReport& report) {
    nlohmann::json document{{"ok", report.ok()},
                            {"rate_hz", report.rate_hz},
                            {"cameras", nlohmann::json::array()},
                            {"pairs", nlohmann::json::array()},
                            {"notes", report.notes}};
    for (const LedCameraReport& c : report.cameras)
        document["cameras"].push_back(
            {{"name", c.name},
             {"pictures", c.pictures},
             {"read", c.read},
             {"ambiguous", c.ambiguous},
             {"saturated", c.saturated},
             {"hidden", c.hidden},
             {"too_long", c.too_long},
             {"split", c.split},
             {"untriggered", c.untriggered},
             {"increments", c.increments},
             {"wrong_increments", c.wrong_increments},
             {"scatter_us", c.scatter_us},
             {"rate_hz", c.rate_hz > 0 ? nlohmann::json(c.rate_hz) : nlohmann::json()},
             {"binary_first", c.binary_first}});
    for (const LedPairReport& p : report.pairs) {
        const bool finite = std::isfinite(p.interval_us);
        const auto number = [finite](double value) {
            return finite ? nlohmann::json(value) : nlohmann::json();
        };
        document["pairs"].push_back({{"first", p.first},
                                     {"second", p.second},
                                     {"pairs", p.pairs},
                                     {"matches", p.matches},
                                     {"modulo_32", p.modulo_32},
                                     {"mismatches", p.mismatches},
                                     {"ambiguous", p.ambiguous},
                                     {"split", p.split},
                                     {"offset_us", number(p.offset_us)},
                                     {"interval_us", number(p.interval_us)},
                                     {"deviation_us", number(p.deviation_us)},
                                     {"largest_us", number(p.largest_us)}});
    }
    return document;
}

}  // namespace versavis::client
