// SPDX-License-Identifier: BSD-3-Clause
#include "evaluate/led_board.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "base/median.hpp"

namespace versavis::client {

namespace {

constexpr int led_gaps = 9;  // between ten LEDs
/// Light of an LED is summed up within this part of the distance from LED to LED. If lower, light
/// is lost when the place is a little off; if higher, neighbours shine in.
constexpr double aperture = 0.45;
/// Dark is what is seen within this part of that distance, in the middle between two LEDs. If
/// lower, noise shows; if higher, LEDs shine in.
constexpr double gap_radius = 0.1;
/// Brightnesses at which spots are looked for. If lower, a dim board before a bright scene may be
/// missed.
constexpr int thresholds = 24;
/// Spots that are tried in pairs. If lower, a scene full of lamps hides the board.
constexpr std::size_t most_spots = 80;
/// Smallest area of a spot, in pixels. If lower, noise makes spots; if higher, boards below 80
/// pixels are missed.
constexpr std::size_t smallest_spot = 5;
/// Dark gaps are darker than the LEDs by this part of an LED's brightness, at least. If lower,
/// stripes of the scene pass for a board; if higher, a board in daylight does not.
constexpr double least_contrast = 0.3;
/// One of the outermost LEDs has at least this part of the other's light. If lower, a board that is
/// half covered is read; if higher, one that is seen from the side is not.
constexpr double least_balance = 0.4;

struct Point {
    double x = 0;
    double y = 0;
};

Point between(const LedPlace& place, double share) {
    return {place.x1 + (place.x2 - place.x1) * share, place.y1 + (place.y2 - place.y1) * share};
}

/// Calls `take` with x, y and value of each pixel whose centre is within a circle.
template <class Take>
void within(const GreyPicture& picture, Point centre, double radius, Take take) {
    const auto bound = [](double value, std::uint32_t size) {
        return static_cast<std::int64_t>(std::clamp(value, 0.0, static_cast<double>(size)));
    };
    for (std::int64_t y = bound(std::ceil(centre.y - radius), picture.height);
         y < bound(std::floor(centre.y + radius) + 1, picture.height); ++y)
        for (std::int64_t x = bound(std::ceil(centre.x - radius), picture.width);
             x < bound(std::floor(centre.x + radius) + 1, picture.width); ++x) {
            const double dx = static_cast<double>(x) - centre.x;
            const double dy = static_cast<double>(y) - centre.y;
            if (dx * dx + dy * dy <= radius * radius)
                take(dx, dy, picture.at(static_cast<std::size_t>(x), static_cast<std::size_t>(y)));
        }
}

/// None: the circle is outside the picture.
std::optional<double> mean(const GreyPicture& picture, Point centre, double radius) {
    double sum = 0;
    double count = 0;
    // A circle between four pixels holds none: their nearest has it.
    within(picture, centre, std::max(radius, 0.75), [&](double, double, double value) {
        sum += value;
        ++count;
    });
    if (count == 0) return std::nullopt;
    return sum / count;
}

struct Spot {
    Point centre;
    double radius = 0;
};

/// A connected part of the picture above a threshold.
struct Component {
    double area = 0;
    double x = 0;
    double y = 0;
    std::uint32_t left = UINT32_MAX, right = 0, top = UINT32_MAX, bottom = 0;

    void add(std::uint32_t px, std::uint32_t py) {
        ++area;
        x += px;
        y += py;
        left = std::min(left, px);
        right = std::max(right, px);
        top = std::min(top, py);
        bottom = std::max(bottom, py);
    }

    /// Nearly a disc.
    bool round() const {
        const double wide = right - left + 1;
        const double high = bottom - top + 1;
        return std::max(wide, high) <= 1.8 * std::min(wide, high) && area >= 0.5 * wide * high;
    }
};

class SpotFinder {
 public:
    explicit SpotFinder(const GreyPicture& picture)
        : picture_(picture), largest_(picture.pixels.size() / 50) {}

    /// The largest discs, each at the lowest threshold at which it is one.
    std::vector<Spot> find() {
        const auto [low, high] =
            std::minmax_element(picture_.pixels.begin(), picture_.pixels.end());
        for (int i = thresholds - 1; i > 0; --i)
            look(*low + (*high - *low) * (double{1} * i / thresholds));
        std::sort(spots_.begin(), spots_.end(),
                  [](const Spot& a, const Spot& b) { return a.radius > b.radius; });
        if (spots_.size() > most_spots) spots_.resize(most_spots);
        return spots_;
    }

 private:
    void look(double threshold) {
        seen_.assign(picture_.pixels.size(), false);
        for (std::uint32_t y = 0; y < picture_.height; ++y)
            for (std::uint32_t x = 0; x < picture_.width; ++x)
                if (take(x, y, threshold)) keep(grow(x, y, threshold));
    }

    bool take(std::uint32_t x, std::uint32_t y, double threshold) {
        const std::size_t i = std::size_t{y} * picture_.width + x;
        if (seen_[i] || picture_.pixels[i] <= threshold) return false;
        return seen_[i] = true;
    }

    Component grow(std::uint32_t x, std::uint32_t y, double threshold) {
        Component component;
        pending_.assign(1, {x, y});
        while (!pending_.empty()) {
            const auto [px, py] = pending_.back();
            pending_.pop_back();
            component.add(px, py);
            const auto visit = [&](std::uint32_t nx, std::uint32_t ny) {
                if (nx < picture_.width && ny < picture_.height && take(nx, ny, threshold))
                    pending_.emplace_back(nx, ny);
            };
            visit(px + 1, py);
            visit(px - 1, py);  // below 0 is beyond the width
            visit(px, py + 1);
            visit(px, py - 1);
        }
        return component;
    }

    void keep(const Component& component) {
        if (component.area < smallest_spot || component.area > static_cast<double>(largest_) ||
            !component.round())
            return;
        const Spot spot{{component.x / component.area, component.y / component.area},
                        std::sqrt(component.area / 3.14159265358979)};
        for (Spot& known : spots_)
            if (std::hypot(known.centre.x - spot.centre.x, known.centre.y - spot.centre.y) <
                std::max(1.5, 0.5 * known.radius)) {
                known = spot;  // at a lower threshold it is larger
                return;
            }
        spots_.push_back(spot);
    }

    const GreyPicture& picture_;
    std::size_t largest_;
    std::vector<bool> seen_;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> pending_;
    std::vector<Spot> spots_;
};

/// How much darker than the LEDs it is between them, as a part of their brightness, if the two
/// places may be the ends of the board: at least one LED between them is lit. 0: they are not.
double contrast(const GreyPicture& darkest, const GreyPicture& brightest, const LedPlace& place) {
    const double small = gap_radius * place.pitch();
    const auto first = mean(darkest, {place.x1, place.y1}, small);
    const auto last = mean(darkest, {place.x2, place.y2}, small);
    if (!first || !last) return 0;
    const double on = std::min(*first, *last);
    double gap = 0;
    for (int i = 0; i < led_gaps; ++i) {
        const auto level = mean(brightest, between(place, (i + 0.5) / led_gaps), small);
        if (!level || *level >= on) return 0;
        gap = std::max(gap, *level);
    }
    bool any = false;
    for (int led = 1; led < led_gaps; ++led) {
        const auto level = mean(brightest, between(place, double{1} * led / led_gaps), small);
        any = any || (level && *level > gap + 0.25 * (on - gap));
    }
    return any ? (on - gap) / on : 0;
}

/// Moves a centre to the middle of the light around it.
Point centred(const GreyPicture& picture, Point centre, double radius, double dark) {
    for (int i = 0; i < 3; ++i) {
        double sum = 0;
        double x = 0;
        double y = 0;
        within(picture, centre, radius, [&](double dx, double dy, double value) {
            const double light = std::max(0.0, value - dark);
            sum += light;
            x += light * dx;
            y += light * dy;
        });
        if (sum > 0) centre = {centre.x + x / sum, centre.y + y / sum};
    }
    return centre;
}

double median_gap(const GreyPicture& picture, const LedPlace& place) {
    std::vector<double> levels;
    for (int i = 0; i < led_gaps; ++i)
        if (const auto level =
                mean(picture, between(place, (i + 0.5) / led_gaps), gap_radius * place.pitch()))
            levels.push_back(*level);
    if (levels.empty()) return 0;
    return median(std::move(levels));
}

}  // namespace

double LedPlace::pitch() const { return std::hypot(x2 - x1, y2 - y1) / led_gaps; }

void LedSearch::add(const GreyPicture& picture) {
    if (pictures_ == 0) darkest_ = brightest_ = picture;
    if (picture.pixels.size() != darkest_.pixels.size() || picture.width != darkest_.width) return;
    ++pictures_;
    for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
        darkest_.pixels[i] = std::min(darkest_.pixels[i], picture.pixels[i]);
        brightest_.pixels[i] = std::max(brightest_.pixels[i], picture.pixels[i]);
    }
}

Expected<LedPlace> LedSearch::find(const std::string& stream) const {
    if (pictures_ == 0) return failure(stream, "there is no picture of it", "record the camera");
    const std::vector<Spot> spots = SpotFinder(darkest_).find();
    LedPlace best;
    double clearest = least_contrast;
    for (std::size_t i = 0; i < spots.size(); ++i)
        for (std::size_t k = i + 1; k < spots.size(); ++k) {
            const LedPlace place{spots[i].centre.x, spots[i].centre.y, spots[k].centre.x,
                                 spots[k].centre.y};
            const bool apart = place.pitch() > 2 * std::max(spots[i].radius, spots[k].radius);
            const bool alike = spots[k].radius > 0.5 * spots[i].radius;
            const double clear = apart && alike ? contrast(darkest_, brightest_, place) : 0;
            if (clear <= clearest) continue;
            clearest = clear;
            best = place;
        }
    if (clearest == least_contrast)
        return failure(stream,
                       fmt::format("no LED board was found in {} pictures: two LEDs that are "
                                   "always on, with dark gaps and lit LEDs between them",
                                   pictures_),
                       fmt::format("look at one with 'versavis export', and give the positions of "
                                   "the outermost LEDs: --board {}=X1,Y1,X2,Y2",
                                   stream));
    // Spots come by size, which noise decides between the two.
    if (std::tie(best.x2, best.y2) < std::tie(best.x1, best.y1)) {
        std::swap(best.x1, best.x2);
        std::swap(best.y1, best.y2);
    }
    const double dark = median_gap(darkest_, best);
    const double radius = aperture * best.pitch();
    const Point first = centred(darkest_, {best.x1, best.y1}, radius, dark);
    const Point last = centred(darkest_, {best.x2, best.y2}, radius, dark);
    return LedPlace{first.x, first.y, last.x, last.y};
}

LedPicture measure_leds(const GreyPicture& picture, const LedPlace& place) {
    const double radius = aperture * place.pitch();
    const double dark = median_gap(picture, place);
    const double limit = 0.98 * picture.full;
    bool saturated = false;
    const auto light = [&](int led) {
        double sum = 0;
        within(picture, between(place, double{1} * led / led_gaps), radius,
               [&](double, double, double value) {
                   sum += value - dark;
                   saturated = saturated || value >= limit;
               });
        return sum;
    };
    const double first = light(0);
    const double last = light(led_gaps);
    LedPicture seen;
    // At least a grey level brighter than dark, over the whole circle.
    const double least = 3.14159265358979 * radius * radius;
    if (std::min(first, last) < std::max(least, least_balance * std::max(first, last))) return seen;
    for (int led = 1; led < led_gaps; ++led) {
        const double share = double{1} * led / led_gaps;
        seen.levels.at(static_cast<std::size_t>(led - 1)) =
            light(led) / (first * (1 - share) + last * share);
    }
    seen.state = saturated ? LedState::saturated : LedState::good;
    return seen;
}

}  // namespace versavis::client
