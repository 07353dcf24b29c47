// SPDX-License-Identifier: BSD-3-Clause
#include "campaign.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace versavis::test {

namespace {

constexpr double rates_hz[] = {5, 20, 155};
constexpr WorldClock clocks[] = {WorldClock::good, WorldClock::drifting, WorldClock::absent};
constexpr std::uint64_t first_fault = 40;
constexpr std::uint64_t fault_distance = 50;
constexpr std::uint64_t quiet_end = 120;  // pulses after the last fault ...
constexpr double quiet_end_s = 5;         // ... and seconds: time to estimate the board's clock
                                          // anew, and to lock again

/// What is no matter of the matrix, but may matter.
WorldSettings variation(std::uint64_t seed) {
    WorldSettings settings;
    settings.seed = seed;
    settings.strobe = seed % 2 != 0;
    settings.ids_count_ignored = seed / 2 % 2 != 0;
    settings.chunks = seed % 3 == 0;
    if (seed % 5 == 4) settings.readout = milliseconds(60);
    if (seed % 4 == 3) settings.late_frames = 0;
    settings.stamped = static_cast<pairing::Instant>(1 + seed % 7 % 3);
    if (seed % 7 == 2) settings.readout_start = milliseconds(1);
    settings.compensated = seed % 11 != 0 && seed % 8 == 1;
    if (seed % 11 != 0) return settings;
    settings.exposure = microseconds(500);
    settings.other_exposure = milliseconds(3);
    settings.switched_every = 1 + seed % 40;
    return settings;
}

void answer_unevenly(WorldSettings& settings, std::mt19937_64& random) {
    const auto chance = [&](double most) {
        return random() % 2 == 0 ? 0 : std::uniform_real_distribution<>(0, most)(random);
    };
    settings.ignored = chance(0.6);
    // Without a clock, a second frame that comes a period late is like the next trigger's.
    if (settings.clock != WorldClock::absent) settings.doubled = chance(0.3);
    const Duration period{std::llround(1e9 / settings.rate_hz)};
    if (random() % 3 == 0)
        settings.shortest_period =
            period * static_cast<std::int64_t>(1 + random() % 4) + period / 5 - milliseconds(1);
    if (random() % 2 == 0) settings.record_delay = milliseconds(random() % 200);
}

std::uint64_t end_after(std::uint64_t last_fault, double rate_hz) {
    return last_fault + quiet_end + static_cast<std::uint64_t>(quiet_end_s * rate_hz);
}

WorldSettings cell(FaultKind kind, WorldClock clock, bool wide_ids, double rate_hz,
                   std::uint64_t seed) {
    WorldSettings settings = variation(seed);
    settings.clock = clock;
    settings.wide_ids = wide_ids;
    settings.rate_hz = rate_hz;
    std::uint64_t pulse = first_fault + seed % fault_distance;
    for (int i = 0; i < 5; ++i, pulse += fault_distance) settings.faults[pulse] = kind;
    settings.pulses = end_after(pulse, rate_hz);
    if (kind == FaultKind::id_wrap) settings.first_id = 0xFFFF - first_fault;
    return settings;
}

}  // namespace

void Totals::add(const WorldSettings& settings, const Verdict& verdict) {
    const std::uint64_t before = wrong;
    ++runs;
    faults += settings.faults.size();
    frames += verdict.frames;
    published += verdict.published;
    wrong += verdict.wrong;
    if (settings.clock != WorldClock::absent) wrong += verdict.lies_published;
    withheld += verdict.withheld;
    withheld_needlessly += verdict.withheld_needlessly;
    slips += verdict.slips;
    const Duration ten_periods{std::llround(1e10 / settings.rate_hz)};
    if (verdict.unproved_at_end > seconds(1) + ten_periods) ++not_locked;
    if (wrong != before) wrong_seeds.push_back(settings.seed);
    if (settings.rate_hz != 20) return;
    if (verdict.published != 0 && settings.late_frames == 0)
        first_published.push_back(verdict.first_published);
    recoveries.insert(recoveries.end(), verdict.recoveries.begin(), verdict.recoveries.end());
}

std::vector<Row> run_matrix(unsigned seeds) {
    std::vector<Row> rows;
    for (const WorldClock clock : clocks)
        for (std::size_t kind = 0; kind < fault_kinds; ++kind) {
            Row row{static_cast<FaultKind>(kind), clock, {}};
            for (const bool wide_ids : {false, true})
                for (const double rate_hz : rates_hz)
                    for (unsigned seed = 0; seed < seeds; ++seed) {
                        const std::uint64_t number =
                            seed + 1000 * (kind + 1) + (wide_ids ? 500 : 0);
                        const WorldSettings settings =
                            cell(row.kind, clock, wide_ids, rate_hz, number);
                        row.totals.add(settings, run_world(settings));
                    }
            rows.push_back(std::move(row));
        }
    return rows;
}

Totals run_random(std::uint64_t faults, std::uint64_t seed, WorldClock clock,
                  const std::function<void(const Totals&)>& progress, Answers answers) {
    Totals totals;
    for (; totals.faults < faults; ++seed) {
        std::mt19937_64 random(seed);
        WorldSettings settings = variation(seed);
        settings.clock = clock;
        settings.wide_ids = random() % 2 == 0;
        settings.rate_hz = rates_hz[random() % 3];
        settings.first_id = 1 + random() % 70'000;
        std::uint64_t pulse = 0;
        for (int i = 0; i < 12; ++i) {
            pulse += 1 + random() % 100;
            const auto kind = static_cast<FaultKind>(random() % fault_kinds);
            if (kind != FaultKind::cameras_swapped && kind != FaultKind::id_wrap)
                settings.faults[pulse] = kind;
        }
        settings.pulses = end_after(pulse, settings.rate_hz);
        if (answers == Answers::unevenly) answer_unevenly(settings, random);
        totals.add(settings, run_world(settings));
        if (progress) progress(totals);
    }
    return totals;
}

Duration quantile(std::vector<Duration> values, double share) {
    if (values.empty()) return {};
    const auto at = values.begin() +
                    static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

std::string to_text(const std::string& name, const Totals& totals) {
    const double frames = static_cast<double>(std::max<std::uint64_t>(totals.frames, 1));
    return fmt::format("{:<32}{:>6}{:>8}{:>10}{:>7}{:>9.3f}{:>10.4f}{:>7}{:>8.3f}{:>8.3f}\n", name,
                       totals.runs, totals.faults, totals.frames, totals.wrong,
                       100 * static_cast<double>(totals.withheld) / frames,
                       100 * static_cast<double>(totals.withheld_needlessly) / frames,
                       totals.not_locked,
                       static_cast<double>(quantile(totals.first_published, 1).ns) * 1e-9,
                       static_cast<double>(quantile(totals.recoveries, 0.99).ns) * 1e-9);
}

std::string to_table(const std::vector<Row>& rows) {
    std::string text = fmt::format("{:<32}{:>6}{:>8}{:>10}{:>7}{:>9}{:>10}{:>7}{:>8}{:>8}\n",
                                   "fault, camera clock", "runs", "faults", "frames", "wrong",
                                   "withheld", "needless", "not", "first", "again");
    text += fmt::format("{:<32}{:>6}{:>8}{:>10}{:>7}{:>9}{:>10}{:>7}{:>8}{:>8}\n", "", "", "", "",
                        "", "%", "%", "locked", "s", "s, p99");
    for (const Row& row : rows)
        text +=
            to_text(fmt::format("{}, {}", to_string(row.kind), to_string(row.clock)), row.totals);
    return text;
}

}  // namespace versavis::test
