// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/pairing/pairing.hpp"

#include <catch2/catch.hpp>
#include <map>
#include <queue>
#include <random>
#include <set>

#include "versavis/wire/messages.hpp"

using namespace versavis;
using namespace versavis::pairing;

namespace {

struct Faults {
    std::set<std::uint64_t> frame_lost;       ///< by pulse
    std::set<std::uint64_t> trigger_ignored;  ///< no exposure, no block id
    std::set<std::uint64_t> record_lost;
    std::set<std::uint64_t> record_late;  ///< by 100 ms
    std::uint64_t stale_frames = 0;       ///< frames of nobody before the first
    std::uint64_t ids_restart_at = 0;
    bool strobe_wired = true;  ///< else an ignored trigger looks like any other
    bool camera_clock = true;
    bool ids_count_ignored = false;
    std::uint64_t clock_jumps_at = 0;  ///< camera clock, by ...
    Duration clock_jump;
    Duration readout{2'500'000};  ///< end of exposure to arrival, +-1.5 ms
    std::uint64_t reset_at = 0;   ///< pairing is told to begin anew while triggers go on
};

/// Camera, board and link in virtual time: each message is delivered when it would arrive.
class World : public Outcome {
 public:
    World(double rate_hz, double drift_ppm, Faults faults, std::uint64_t first_block_id = 1)
        : period_ns_(1e9 / rate_hz),
          drift_ppm_(drift_ppm),
          faults_(std::move(faults)),
          block_id_(first_block_id - 1) {}

    void run(std::uint64_t ticks) {
        Limits limits;
        limits.pattern_duration = {static_cast<std::int64_t>(22 * period_ns_)};
        Pairing pairing(limits, *this);
        pairing_ = &pairing;
        for (std::uint64_t i = 0; i < faults_.stale_frames; ++i) deliver_stale(i);
        std::uint64_t pattern_tick = 0;
        for (std::uint64_t tick = 0; tick < ticks; ++tick, ++pattern_tick) {
            const HostTime now{static_cast<std::int64_t>(1e9 + static_cast<double>(tick) * period_ns_)};
            deliver_until(now);
            pairing.advance(now);
            if (tick != 0 && tick == faults_.reset_at) pairing.reset();
            if (pairing.wants_pattern(now)) {
                pairing.pattern_requested(now);
                pattern_tick = 0;
                ++patterns;
            }
            const bool gap = pattern_tick < wire::start_pattern_length &&
                             (wire::start_pattern_bits >> pattern_tick & 1U) == 0;
            if (!gap) pulse(now, tick);
        }
        deliver_until(HostTime{INT64_MAX});
        final_state = pairing.state();
    }

    std::uint64_t published = 0;
    std::uint64_t wrong = 0;
    std::uint64_t withheld = 0;
    std::uint64_t sent = 0;
    std::uint64_t unpaired_exposures = 0;
    std::uint64_t locks = 0;
    std::uint64_t slips = 0;
    std::uint64_t patterns = 0;
    std::uint64_t first_published_after_pulses = 0;
    std::map<EventReason, std::uint64_t> reasons;
    State final_state = State::searching;

 private:
    struct Message {
        HostTime at;
        std::uint64_t order;
        bool is_frame;
        Exposure exposure;
        Arrival arrival;
        bool operator<(const Message& other) const {
            return other.at < at || (other.at == at && other.order < order);
        }
    };

    void pulse(HostTime trigger, std::uint64_t tick) {
        ++pulse_;
        const bool ignored = faults_.trigger_ignored.count(pulse_) != 0;
        const HostTime start = trigger + microseconds(20);
        const HostTime end = start + milliseconds(2);
        Exposure exposure;
        exposure.trigger = pulse_;
        exposure.tick = tick;
        exposure.start = BoardTime{start.ns + board_offset};
        exposure.end = BoardTime{end.ns + board_offset};
        exposure.earliest_on_host = end;
        exposure.exposed = !ignored || !faults_.strobe_wired;
        const Duration record_delay =
            faults_.record_late.count(pulse_) != 0 ? milliseconds(100) : microseconds(500);
        record_at_ =
            std::max(record_at_, end + record_delay);  // the link keeps the order: later records wait, too
        if (faults_.record_lost.count(pulse_) == 0) queue_.push({record_at_, ++order_, false, exposure, {}});
        if (pulse_ == faults_.ids_restart_at) block_id_ = 0;
        if (pulse_ == faults_.clock_jumps_at) camera_offset_ += faults_.clock_jump.ns;
        if (!ignored || faults_.ids_count_ignored) ++block_id_;
        if (ignored || faults_.frame_lost.count(pulse_) != 0) return;
        ++sent;
        const Duration jitter{std::uniform_int_distribution<std::int64_t>(-1'500'000, 1'500'000)(random_)};
        const Duration readout = faults_.readout + jitter;
        truth_[++slot_] = pulse_;
        queue_.push({end + readout, ++order_, true, {}, frame(block_id_, start, end + readout)});
    }

    Arrival frame(std::uint64_t block_id, HostTime start, HostTime arrived) const {
        Arrival arrival;
        arrival.slot = slot_;
        arrival.block_id = block_id;
        const double drifted = static_cast<double>(start.ns) * (1 + drift_ppm_ * 1e-6);
        if (faults_.camera_clock) arrival.camera_time = {camera_offset_ + static_cast<std::int64_t>(drifted)};
        arrival.arrived = arrived;
        return arrival;
    }

    void deliver_stale(std::uint64_t age) {
        truth_[++slot_] = 0;
        const HostTime start{500'000'000 - static_cast<std::int64_t>(age) * 30'000'000};
        const HostTime arrived{999'000'000};
        queue_.push({arrived, ++order_, true, {}, frame(1000 - age, start, arrived)});
    }

    void deliver_until(HostTime now) {
        while (!queue_.empty() && queue_.top().at <= now) {
            const Message message = queue_.top();
            queue_.pop();
            if (message.is_frame)
                pairing_->add(message.arrival);
            else
                pairing_->add(message.exposure);
        }
    }

    void paired(const Arrival& arrival, const Exposure& exposure) override {
        if (published++ == 0) first_published_after_pulses = pulse_;
        if (truth_.at(arrival.slot) != exposure.trigger) ++wrong;
    }
    void frame_unpaired(const Arrival& /*arrival*/, EventReason reason) override {
        ++withheld;
        ++reasons[reason];
    }
    void exposure_unpaired(const Exposure& /*exposure*/, EventReason reason) override {
        ++unpaired_exposures;
        ++reasons[reason];
    }
    void locked(const Exposure& /*first*/) override { ++locks; }
    void slipped(const Arrival& /*at*/) override { ++slips; }

    static constexpr std::int64_t board_offset = 77'000'000'000;

    double period_ns_;
    double drift_ppm_;
    Faults faults_;
    Pairing* pairing_ = nullptr;
    std::mt19937_64 random_{1};
    std::priority_queue<Message> queue_;
    HostTime record_at_;
    std::uint64_t order_ = 0;
    std::int64_t camera_offset_ = 5'000'000'000'000;
    std::uint64_t pulse_ = 0;
    std::uint64_t block_id_;
    std::uint32_t slot_ = 0;
    std::map<std::uint32_t, std::uint64_t> truth_;
};

}  // namespace

TEST_CASE("pairing: a clean start publishes every frame, the first ones within half a second at 20 Hz") {
    const double rate = GENERATE(5.0, 20.0, 155.0);
    const double drift = GENERATE(-100.0, 0.0, 100.0);
    World world(rate, drift, {}, GENERATE(1U, 4711U));
    world.run(400);
    CHECK(world.wrong == 0);
    CHECK(world.withheld == 0);
    CHECK(world.published >= world.sent - 1);
    CHECK(world.first_published_after_pulses <= 5);
    CHECK(world.locks == 1);
    CHECK(world.final_state == State::locked);
}

TEST_CASE("pairing: a camera without a clock is paired by arrival") {
    Faults faults;
    faults.camera_clock = false;
    World world(20, 0, faults);
    world.run(200);
    CHECK(world.wrong == 0);
    CHECK(world.withheld == 0);
    CHECK(world.final_state == State::locked);
}

TEST_CASE("pairing: lost frames leave their triggers unpaired and shift nothing") {
    Faults faults;
    faults.frame_lost = {2, 50, 51, 90};
    World world(20, 50, faults);
    world.run(200);
    CHECK(world.wrong == 0);
    CHECK(world.withheld == 0);
    CHECK(world.slips == 0);
    CHECK(world.reasons[EventReason::frame_missing] == 4);
}

TEST_CASE("pairing: an ignored trigger is known from the silent exposure line") {
    Faults faults;
    faults.trigger_ignored = {1, 60, 61};
    faults.ids_count_ignored = GENERATE(false, true);
    World world(20, 50, faults);
    world.run(200);
    CHECK(world.wrong == 0);
    CHECK(world.slips == 0);
    CHECK(world.reasons[EventReason::trigger_ignored] == 3);
    CHECK(world.published >= world.sent - 1);
}

TEST_CASE("pairing: without an exposure line an ignored trigger is a slip, found at once and repaired") {
    Faults faults;
    faults.trigger_ignored = {60};
    faults.strobe_wired = false;
    World world(20, 50, faults);
    world.run(200);
    CHECK(world.wrong == 0);
    CHECK(world.slips == 1);
    CHECK(world.withheld <= 5);
    CHECK(world.final_state == State::locked);
}

TEST_CASE("pairing: a lost exposure record costs its frame only") {
    Faults faults;
    faults.record_lost = {60};
    World world(20, 50, faults);
    world.run(200);
    CHECK(world.wrong == 0);
    CHECK(world.slips == 0);
    CHECK(world.reasons[EventReason::exposure_missing] == 1);
    CHECK(world.withheld == 1);
}

TEST_CASE("pairing: a late exposure record is waited for") {
    Faults faults;
    faults.record_late = {60, 61};
    World world(20, 50, faults);
    world.run(200);
    CHECK(world.wrong == 0);
    CHECK(world.withheld == 0);
}

TEST_CASE("pairing: frames from before the start are never published") {
    Faults faults;
    faults.stale_frames = 3;
    World world(20, 50, faults);
    world.run(200);
    CHECK(world.wrong == 0);
    CHECK(world.published >= world.sent - 8);
    CHECK(world.withheld <= 10);
    CHECK(world.final_state == State::locked);
}

TEST_CASE("pairing: ids that begin anew are a slip that camera time repairs") {
    Faults faults;
    faults.ids_restart_at = 80;
    World world(20, 50, faults);
    world.run(200);
    CHECK(world.wrong == 0);
    CHECK(world.slips == 1);
    CHECK(world.withheld <= 5);
    CHECK(world.final_state == State::locked);
}

TEST_CASE("pairing: a camera clock that jumps is found, not followed") {
    Faults faults;
    faults.clock_jumps_at = 80;
    faults.clock_jump =
        GENERATE(milliseconds(50), -milliseconds(50), milliseconds(60), seconds(1), -seconds(1));
    faults.readout = GENERATE(microseconds(2500), milliseconds(60));  // below and above the period
    World world(20, 50, faults);
    world.run(300);
    INFO(faults.clock_jump.ns << " " << faults.readout.ns);
    CHECK(world.wrong == 0);
    CHECK(world.slips >= 1);
    CHECK(world.final_state == State::locked);
}

TEST_CASE("pairing: regular triggers prove nothing, even if only one alignment fits") {
    Faults faults;
    faults.reset_at = 100;
    faults.readout = milliseconds(60);
    World world(20, 50, faults);
    world.run(300);
    CHECK(world.wrong == 0);
    CHECK(world.patterns >= 1);
    CHECK(world.final_state == State::locked);
}

TEST_CASE("pairing: random faults, many seeds: never a wrong pair, always locked again") {
    for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
        std::mt19937_64 random(seed);
        const auto some = [&](std::uint64_t most) {
            std::set<std::uint64_t> pulses;
            for (std::uint64_t i = random() % (most + 1); i > 0; --i) pulses.insert(1 + random() % 350);
            return pulses;
        };
        Faults faults;
        faults.frame_lost = some(12);
        faults.trigger_ignored = some(6);
        faults.record_lost = some(6);
        faults.record_late = some(6);
        faults.stale_frames = random() % 4;
        faults.strobe_wired = random() % 2 == 0;
        faults.ids_count_ignored = random() % 2 == 0;
        const double rates[] = {5, 20, 155};
        World world(rates[random() % 3], static_cast<double>(random() % 201) - 100, faults,
                    1 + random() % 70000);
        world.run(600);
        INFO("seed " << seed);
        CHECK(world.wrong == 0);
        CHECK(world.final_state == State::locked);
        CHECK(world.published > world.sent / 3);
    }
}
