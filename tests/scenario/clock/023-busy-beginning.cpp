// SPDX-License-Identifier: BSD-3-Clause
// A busy host delays all messages of one direction by some more for seconds: what slots of a tenth
// of a second say after a beginning is not independent.
#include <catch2/catch.hpp>

#include "engine/clock/envelope_filter.hpp"
#include "honest.hpp"

using namespace versavis;
using namespace versavis::clock_world;

namespace {

/// Each direction takes 25 us longer in the mean for `share` of the time, for 2 s in the mean.
class BusyHost final : public Link {
 public:
    BusyHost(double share, Random& random) : link_(usb_full_speed({}, random)), busy_(share) {}

    Duration to_board(TrueTime sent, Random& random) override {
        return link_->to_board(sent, random) + slowness(to_board_, sent, random);
    }
    Duration to_host(TrueTime sent, Random& random) override {
        return link_->to_host(sent, random) + slowness(to_host_, sent, random);
    }

 private:
    struct Load {
        TrueTime until;
        Duration slower;
    };

    static Duration exponential(double mean_ns, Random& random) {
        return {std::llround(std::exponential_distribution<>(1 / mean_ns)(random))};
    }
    Duration slowness(Load& load, TrueTime at, Random& random) {
        while (load.until <= at) {
            load.until = load.until + exponential(2e9, random);
            load.slower = busy_(random) ? exponential(25e3, random) : Duration{};
        }
        return load.slower;
    }

    std::unique_ptr<Link> link_;
    std::bernoulli_distribution busy_;
    Load to_board_;
    Load to_host_;
};

}  // namespace

TEST_CASE("clock 023: sigma is honest from the first second on, also of a busy host") {
    const bool busy = GENERATE(false, true);
    Settings settings;
    settings.imu_hz = GENERATE(0.0, 200.0);
    settings.length = seconds(70);
    settings.link = [busy](Random& random) {
        return std::make_unique<BusyHost>(busy ? 2.0 / 3 : 0.0, random);
    };
    const Duration ages[] = {milliseconds(300), seconds(1),  seconds(2), seconds(4),
                             seconds(8),        seconds(16), seconds(60)};
    std::vector<Score> scores(std::size(ages) - 1);
    for (settings.seed = 1; settings.seed <= 100; ++settings.seed) {
        const World world(settings);
        Observer<clock::EnvelopeFilter> observer(world);
        const TrueTime begin = world.deliveries().front().at;
        for (std::size_t i = 0; i < scores.size(); ++i)
            observer.observe({begin + ages[i], begin + ages[i + 1]}, milliseconds(100), scores[i]);
    }
    for (std::size_t i = 0; i < scores.size(); ++i) {
        INFO((busy ? "busy, " : "quiet, ") << settings.imu_hz << " Hz, from " << ages[i].ns);
        CHECK(scores[i].nees() > 0.5);
        CHECK(scores[i].nees() < (busy ? 4 : ages[i] < seconds(1) ? 3 : 2));
    }
}
