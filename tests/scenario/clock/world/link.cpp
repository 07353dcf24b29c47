// SPDX-License-Identifier: BSD-3-Clause
#include "link.hpp"

#include <cmath>
#include <fstream>
#include <stdexcept>
#include <vector>

namespace versavis::clock_world {

namespace {

constexpr Duration shortest = microseconds(300);
constexpr std::int64_t spread_ns = 10'000'000;

Duration jitter(Random& random) {
    return shortest + Duration{std::uniform_int_distribution<std::int64_t>(0, spread_ns)(random)};
}

class Visible final : public Link {
 public:
    Duration to_board(TrueTime /*sent*/, Random& random) override { return jitter(random); }
    Duration to_host(TrueTime /*sent*/, Random& random) override { return jitter(random); }
};

class Invisible final : public Link {
 public:
    Duration to_board(TrueTime /*sent*/, Random& random) override { return last_ = jitter(random); }
    Duration to_host(TrueTime /*sent*/, Random& /*random*/) override {
        return shortest * 2 + Duration{spread_ns} - last_;
    }

 private:
    Duration last_;
};

class UsbFullSpeed final : public Link {
 public:
    UsbFullSpeed(const UsbSettings& settings, Random& random)
        : settings_(settings),
          phase_{std::uniform_int_distribution<std::int64_t>(0, frame.ns)(random)} {}

    Duration to_board(TrueTime sent, Random& random) override {
        const Duration awake = wake_up(sent, random) / 3 * (settings_.wakes_up_to_send ? 1 : 0);
        const Duration interrupt{std::uniform_int_distribution<std::int64_t>(0, 3'000)(random)};
        return awake + until_next(frame, sent + awake) + settings_.transfer + interrupt +
               slowed(sent);
    }
    Duration to_host(TrueTime sent, Random& random) override {
        const Duration polled = until_next(poll, sent) + settings_.transfer;
        return polled + wake_up(sent + polled, random) + settings_.longer_to_host + slowed(sent);
    }

 private:
    static constexpr Duration frame = milliseconds(1);
    static constexpr Duration poll = microseconds(125);

    Duration until_next(Duration period, TrueTime at) const {
        return {period.ns - 1 - (at.ns + frame.ns - phase_.ns) % period.ns};
    }
    Duration slowed(TrueTime at) const {
        return settings_.slow.holds(at) ? settings_.slower : Duration{};
    }
    Duration wake_up(TrueTime at, Random& random) const {
        const auto median_ns = static_cast<double>(settings_.wake_up.ns);
        double ns = std::lognormal_distribution<>(std::log(median_ns), 0.5)(random);
        const double luck = std::uniform_real_distribution<>()(random);
        if (luck < 0.03) ns += std::exponential_distribution<>(1 / 150e3)(random);
        if (luck > 0.997) ns += std::exponential_distribution<>(1 / 2e6)(random);
        if (settings_.load.holds(at)) ns += std::exponential_distribution<>(1 / 6e6)(random);
        return {std::llround(ns)};
    }

    UsbSettings settings_;
    Duration phase_;
};

class Measured final : public Link {
 public:
    Measured(const std::string& file, Random& random) {
        std::ifstream in(file);
        std::string line;
        std::getline(in, line);
        char comma = 0;
        for (Row row{}; in >> row.to_board_ns >> comma >> row.to_host_ns;) rows_.push_back(row);
        if (rows_.empty()) throw std::runtime_error("no delays in " + file);
        next_ = std::uniform_int_distribution<std::size_t>(0, rows_.size() - 1)(random);
    }
    Duration to_board(TrueTime /*sent*/, Random& /*random*/) override {
        return {rows_[next_].to_board_ns};
    }
    Duration to_host(TrueTime /*sent*/, Random& /*random*/) override {
        const Row row = rows_[next_];
        next_ = (next_ + 1) % rows_.size();
        return {row.to_host_ns};
    }

 private:
    struct Row {
        std::int64_t to_board_ns;
        std::int64_t to_host_ns;
    };
    std::vector<Row> rows_;
    std::size_t next_ = 0;
};

}  // namespace

std::unique_ptr<Link> visible_jitter() { return std::make_unique<Visible>(); }
std::unique_ptr<Link> invisible_jitter() { return std::make_unique<Invisible>(); }
std::unique_ptr<Link> usb_full_speed(const UsbSettings& settings, Random& random) {
    return std::make_unique<UsbFullSpeed>(settings, random);
}
std::unique_ptr<Link> measured(const std::string& file, Random& random) {
    return std::make_unique<Measured>(file, random);
}

}  // namespace versavis::clock_world
