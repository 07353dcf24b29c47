// SPDX-License-Identifier: BSD-3-Clause
#include "troubles.hpp"

namespace versavis::clock_world {

namespace {

bool one_in(int n, Random& random) { return std::uniform_int_distribution<>(1, n)(random) == 1; }

Duration between(Duration least, Duration most, Random& random) {
    return {std::uniform_int_distribution<std::int64_t>(least.ns, most.ns)(random)};
}

TrueTime instant(Random& random) { return {between(seconds(60), seconds(240), random).ns}; }

MakeLink any_link(std::uint64_t seed, const UsbSettings& usb) {
    if (seed % 4 == 1) return [](Random&) { return visible_jitter(); };
    if (seed % 4 == 2) return [](Random&) { return invisible_jitter(); };
    return [usb](Random& random) { return usb_full_speed(usb, random); };
}

}  // namespace

Settings troubled(std::uint64_t seed) {
    Random random(seed ^ 0x5eed);
    Settings settings;
    settings.seed = seed;
    const bool usb = seed % 4 == 0 || seed % 4 == 3;
    settings.length = usb ? seconds(420) : seconds(720);
    settings.exchange_hz = usb ? 10 : 1;
    if (usb && one_in(2, random)) settings.imu_hz = 200;
    UsbSettings link;
    if (one_in(2, random)) {
        link.load.begin = instant(random);
        link.load.end = link.load.begin + between(seconds(1), seconds(60), random);
    }
    settings.link = any_link(seed, link);
    if (one_in(3, random)) settings.lost = 0.3;
    if (one_in(3, random)) {
        settings.silence.begin = instant(random);
        settings.silence.end = settings.silence.begin + between(seconds(1), seconds(60), random);
    }
    if (one_in(3, random)) settings.board_reset = instant(random);
    if (one_in(3, random))
        settings.host_changes = {{instant(random), between(-seconds(70), seconds(70), random)}};
    else if (one_in(3, random)) {
        const TrueTime begin = instant(random);
        const double ppm = std::uniform_real_distribution<>(-500, 500)(random);
        settings.host_changes = {{begin, {}, ppm},
                                 {begin + between(seconds(1), seconds(60), random), {}}};
    }
    return settings;
}

}  // namespace versavis::clock_world
