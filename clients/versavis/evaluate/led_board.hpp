// SPDX-License-Identifier: BSD-3-Clause
// The LED timing board in a picture: where it is, and how bright each of its LEDs.
#pragma once

#include <array>
#include <string>

#include "evaluate/grey_picture.hpp"
#include "versavis/error.hpp"

namespace versavis::client {

/// In pixels: centres of the two outermost LEDs, which are always on.
struct LedPlace {
    double x1 = 0;
    double y1 = 0;
    double x2 = 0;
    double y2 = 0;

    double pitch() const;  ///< from LED to LED
};

/// The eight LEDs between the outermost, from the first end to the second: 0 dark, 1 as bright as
/// those that are always on.
using LedLevels = std::array<double, 8>;

enum class LedState {
    good,
    saturated,  ///< levels are no longer in proportion to the time that an LED was on
    hidden,     ///< the two outermost LEDs are not seen
};

struct LedPicture {
    LedState state = LedState::hidden;
    LedLevels levels{};
};

/// Finds a board that stands still before the camera, from some pictures.
class LedSearch {
 public:
    /// Ignores pictures of another size than the first.
    void add(const GreyPicture& picture);
    unsigned pictures() const { return pictures_; }

    /// The ends from left to right, or one above the other downwards. Error, about `stream`: there
    /// is no board to be seen, or no picture.
    Expected<LedPlace> find(const std::string& stream) const;

 private:
    unsigned pictures_ = 0;
    GreyPicture darkest_;    ///< of each pixel
    GreyPicture brightest_;  ///< of each pixel
};

LedPicture measure_leds(const GreyPicture& picture, const LedPlace& place);

}  // namespace versavis::client
