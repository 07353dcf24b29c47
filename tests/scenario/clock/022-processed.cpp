// SPDX-License-Identifier: BSD-3-Clause
// `versavis process` by the truth of simulated worlds: in none are its stamps worse than live.
#include <catch2/catch.hpp>
#include <map>
#include <optional>
#include <random>

#include "../../support/temporary_directory.hpp"
#include "../../unit/recording_sketch.hpp"
#include "engine/clock/envelope_filter.hpp"
#include "engine/clock/pps_reference.hpp"
#include "engine/clock/recording.hpp"
#include "process/recording_process.hpp"
#include "recording/recording.hpp"
#include "score.hpp"
#include "versavis/metadata.hpp"

using namespace versavis;
using namespace versavis::clock_world;
using ring::StreamKind;

namespace {

constexpr Duration output_minus_host = seconds(1'700'000'000);

/// What cannot be improved may come out slightly worse by chance.
constexpr double chance = 1.01;

/// Octaves by which sigma may be wrong, whatever it was live: of so few seeds, a twentieth is
/// chance.
constexpr double honest = 1.05;

/// What is special about a file.
struct Regime {
    std::string name;
    Settings settings;
    Span pulses{};                           ///< PPS, whose seconds a disciplined host names
    std::optional<TrueTime> output_stepped;  /// by 1.5 s
    unsigned seeds = 8;
};

/// Errors and sigmas of the stamps of one source in one epoch.
struct Judged {
    Score score;
    Score settled;  ///< without its first seconds
    std::optional<TrueTime> begin;
    std::size_t count = 0;

    void add(TrueTime at, Duration error, std::uint32_t sigma_ns) {
        clock::HostEstimate estimate;
        estimate.sigma = {std::int64_t{sigma_ns}};
        if (!begin) begin = at;
        score.add(error, estimate);
        if (at - *begin > settling) settled.add(error, estimate);
        ++count;
    }
    void add(const Judged& other) {
        score.add(other.score);
        settled.add(other.settled);
        count += other.count;
    }

 private:
    static constexpr Duration settling = seconds(10);
};

/// A service in one of these worlds, and what is recorded of it: the clock of `exact` is all that
/// is uncertain, the times of `rough` are off by 20 us besides.
class Service {
 public:
    Service(const World& world, const Regime& regime)
        : world_(world), regime_(regime), random_(world.settings().seed) {}

    void run() {
        TrueTime next_second{seconds(1).ns};
        TrueTime next_sample{seconds(1).ns};
        for (const Delivery& delivery : world_.deliveries()) {
            for (; next_sample < delivery.at; next_sample = next_sample + milliseconds(50))
                sample(next_sample);
            for (; next_second < delivery.at; next_second = next_second + seconds(1))
                second(next_second);
            std::visit([&](const auto& message) { take(message, delivery.at); }, delivery.message);
        }
    }

    OutputTime truth(TrueTime at) const {
        const bool stepped = regime_.output_stepped && at >= *regime_.output_stepped;
        return OutputTime{world_.host(at).ns} + output_minus_host +
               (stepped ? milliseconds(1500) : Duration{});
    }
    /// Of the samples in the file, each of a source; true time of what they show.
    std::map<std::string, std::vector<TrueTime>> instants;
    test::RecordingSketch file;

 private:
    template <class T>
    void item(const std::string& stream, StreamKind kind, OutputTime time, const T& metadata) {
        file.add_item(stream, kind, number_++, time, pack(metadata));
    }

    void take(const clock::Exchange& exchange, TrueTime at) {
        filter_.add(exchange);
        item("clock", StreamKind::clock, truth(at),
             clock::to_metadata(clock::ClockItem{clock::RecordedExchange{
                 7, 1, 0, exchange.sent, exchange.received, exchange.answered, exchange.arrived}}));
    }
    void take(const clock::OneWay& message, TrueTime at) {
        filter_.add(message);
        item("clock", StreamKind::clock, truth(at),
             clock::to_metadata(
                 clock::ClockItem{clock::RecordedMessage{7, message.sent, message.arrived}}));
    }

    Duration difference(TrueTime at) const { return {truth(at).ns - world_.host(at).ns}; }

    std::uint32_t epoch(TrueTime at) const {
        const bool stepped = regime_.output_stepped && at >= *regime_.output_stepped;
        return 1 + (stepped ? 1U : 0U) + static_cast<std::uint32_t>(filter_.restarts()) + jumps_;
    }

    void record_output(TrueTime at) {
        recorded_epoch_ = epoch(at);
        item("clock", StreamKind::clock, truth(at),
             clock::to_metadata(clock::ClockItem{clock::RecordedOutput{
                 recorded_epoch_, world_.host(at), difference(at), nanoseconds(60)}}));
    }

    void second(TrueTime at) {
        record_output(at);
        if (!regime_.pulses.holds(at) || !filter_.confirmed()) return;
        clock::HostEstimate by_link = filter_.translate(world_.board(at));
        by_link.time = by_link.time + filter_.presumed_asymmetry();
        // The output clock is set so that it shows whole seconds when pulses come.
        pps_.pulse(world_.board(at), by_link, {world_.host(at), difference(at), {}, 0}, true);
        const auto measured = pps_.left_in_link();
        if (!measured) return;
        asymmetry_ = {asymmetry_.offset + measured->offset, measured->sigma};
        filter_.set_asymmetry(asymmetry_);
        pps_.link_corrected();
    }

    void sample(TrueTime at) {
        const BoardTime board = world_.board(at);
        if (!filter_.confirmed()) return;
        const clock::HostEstimate by_link = filter_.translate(board);
        OutputTime time{by_link.time.ns + difference(at).ns};
        Duration sigma = by_link.sigma;
        if (const auto pulse = pps_.translate(board, board)) {
            if (!by_pulses_ && absolute(pulse->time - time) > microseconds(100)) ++jumps_;
            by_pulses_ = true;
            time = pulse->time;
            sigma = pulse->sigma;
        } else {
            if (by_pulses_) ++jumps_;
            by_pulses_ = false;
        }
        if (epoch(at) != recorded_epoch_) record_output(at);
        add("exact", at, board, by_link, time, sigma, {});
        const Duration off{std::llround(std::normal_distribution<>(0, 20e3)(random_))};
        add("rough", at, board + off, by_link, time + off, rounded(std::hypot(sigma.ns, 20e3)),
            off);
    }

    void add(const std::string& stream, TrueTime at, BoardTime board,
             const clock::HostEstimate& by_link, OutputTime time, Duration sigma, Duration off) {
        ImuMetadata sample{};
        sample.board_time = board;
        sample.host_time = by_link.time + off;
        sample.sigma_ns = static_cast<std::uint32_t>(sigma.ns);
        sample.epoch = epoch(at);
        const bool sure = by_link.state == clock::ClockState::locked ||
                          by_link.state == clock::ClockState::converging;
        sample.flags = sure ? 0U : static_cast<std::uint32_t>(flag_holdover);
        item(stream, StreamKind::imu, time, sample);
        instants[stream].push_back(at);
    }

    static Duration rounded(double ns) { return {std::llround(ns)}; }

    const World& world_;
    const Regime& regime_;
    Random random_;
    clock::EnvelopeFilter filter_;
    clock::PpsReference pps_{clock::PpsLabels::host};
    clock::Asymmetry asymmetry_;
    bool by_pulses_ = false;
    std::uint32_t jumps_ = 0;
    std::uint32_t recorded_epoch_ = 0;
    std::uint64_t number_ = 0;
};

/// By source and epoch.
using Verdicts = std::map<std::pair<std::string, std::uint32_t>, Judged>;

Verdicts judge(const std::string& path, const Service& service) {
    Verdicts verdicts;
    const auto recording = client::Recording::open(path);
    REQUIRE(recording);
    std::map<std::string, std::size_t> next;
    REQUIRE(recording->for_each({"exact", "rough"}, [&](const client::RecordedItem& item) {
        const auto sample = unpack<ImuMetadata>(item.metadata);
        const TrueTime at = service.instants.at(item.stream).at(next[item.stream]++);
        verdicts[{item.stream, sample.epoch}].add(at, item.time - service.truth(at),
                                                  sample.sigma_ns);
        return true;
    }));
    return verdicts;
}

/// 0: sigma is what it says; 1: the error's mean square is half, or twice, that of sigma.
double octaves(const Score& score) { return std::abs(std::log2(score.nees())); }

Settings usb(double imu_hz, Duration length, const UsbSettings& link = {}) {
    Settings settings;
    settings.imu_hz = imu_hz;
    settings.length = length;
    settings.link = [link](Random& random) { return usb_full_speed(link, random); };
    return settings;
}

Settings jittery(MakeLink link) {
    Settings settings;
    settings.exchange_hz = 1;
    settings.length = seconds(500);
    settings.link = std::move(link);
    return settings;
}

std::vector<Regime> regimes() {
    std::vector<Regime> list;
    const auto add = [&](const std::string& name, Settings settings) -> Regime& {
        list.push_back({name, std::move(settings), {}, {}});
        return list.back();
    };
    add("USB", usb(0, seconds(500)));
    add("USB with IMU", usb(200, seconds(300)));
    add("visible jitter", jittery([](Random&) { return visible_jitter(); }));
    add("invisible jitter", jittery([](Random&) { return invisible_jitter(); }));
    Settings loaded;
    loaded.exchange_hz = 20;
    loaded.length = seconds(80);
    loaded.link = [](Random& random) {
        return measured(VERSAVIS_TEST_DATA "/clock/pty_load_delays.csv", random);
    };
    add("loaded trace", loaded);
    add("late wake-ups", usb(0, seconds(500),
                             {.transfer = microseconds(50),
                              .wake_up = microseconds(40),
                              .wakes_up_to_send = false}));
    add("burst of load", usb(200, seconds(300), {.load = {{seconds(200).ns}, {seconds(230).ns}}}));
    Settings silent = usb(0, seconds(400));
    silent.silence = {{seconds(200).ns}, {seconds(260).ns}};
    add("silence", silent);
    silent.length = seconds(270);
    silent.silence.end = {seconds(280).ns};
    add("silence at the end", silent);
    add("start", usb(0, seconds(20))).seeds = 24;
    add("one minute", usb(200, seconds(60)));
    Settings slow = usb(0, seconds(400));
    slow.exchange_hz = 1;
    add("one exchange a second", slow).seeds = 16;
    add("slower link",
        usb(0, seconds(400),
            {.slow = {{seconds(200).ns}, {seconds(300).ns}}, .slower = microseconds(200)}));
    Settings rigid = usb(0, seconds(400));
    rigid.dither = 0;
    add("without dither", rigid);
    Settings stepped = usb(200, seconds(200));
    stepped.host_changes = {{{seconds(100).ns}, milliseconds(20)}};
    add("host clock steps", stepped).seeds = 24;
    Settings slewed = usb(0, seconds(400));
    slewed.host_changes = {{{seconds(200).ns}, Duration{}, 50}};
    add("host clock changes its rate", slewed);
    Settings reset = usb(0, seconds(200));
    reset.board_begin = seconds(1000);
    reset.board_reset = TrueTime{seconds(100).ns};
    add("board restarts", reset).seeds = 24;
    add("output clock steps", usb(0, seconds(200))).output_stepped = TrueTime{seconds(100).ns};
    const UsbSettings unequal{.longer_to_host = microseconds(200)};
    add("PPS from the middle on", usb(200, seconds(200), unequal)).pulses = {{seconds(100).ns},
                                                                             {seconds(201).ns}};
    add("PPS for a while", usb(0, seconds(250), unequal)).pulses = {{seconds(80).ns},
                                                                    {seconds(150).ns}};
    const UsbSettings nearly_equal{.longer_to_host = microseconds(6)};
    add("PPS over an equal link", usb(0, seconds(200), nearly_equal)).pulses = {{seconds(60).ns},
                                                                                {seconds(140).ns}};
    return list;
}

}  // namespace

TEST_CASE("clock 022: processed stamps are no worse than live ones") {
    for (const Regime& regime : regimes()) {
        Verdicts live;
        Verdicts processed;
        std::string reports;
        Settings settings = regime.settings;
        for (settings.seed = 1; settings.seed <= regime.seeds; ++settings.seed) {
            const World world(settings);
            Service service(world, regime);
            service.run();
            const test::TemporaryDirectory directory;
            const std::string old_file = directory.path() / "old.mcap";
            const std::string new_file = directory.path() / "new.mcap";
            service.file.write(old_file);
            const auto report =
                client::process_recording(old_file, new_file, [](double) { return true; });
            REQUIRE(report);
            reports += to_text(*report);
            const auto merge = [](Verdicts& all, const Verdicts& one) {
                for (const auto& [key, judged] : one) all[key].add(judged);
            };
            merge(live, judge(old_file, service));
            merge(processed, judge(new_file, service));
        }
        REQUIRE(live.size() == processed.size());
        for (auto& [key, before] : live) {
            Judged& after = processed.at(key);
            INFO(regime.name << ", " << key.first << ", epoch " << key.second << ":\n" << reports);
            REQUIRE(after.count == before.count);
            CHECK(after.score.p99_us() <= before.score.p99_us() * chance);
            CHECK(after.score.rms_us() <= before.score.rms_us() * chance);
            CHECK(octaves(after.settled) <= std::max(honest, octaves(before.settled) + 0.02));
        }
    }
}

TEST_CASE("clock 022: the report says what was left for which reason") {
    using client::Choice;
    Settings settings = usb(0, seconds(250));
    const World world(settings);
    const Regime regime{"PPS", settings, {{seconds(120).ns}, {seconds(251).ns}}, {}};
    Service service(world, regime);
    service.run();
    const test::TemporaryDirectory directory;
    service.file.write(directory.path() / "old.mcap");
    const auto report = client::process_recording(
        directory.path() / "old.mcap", directory.path() / "new.mcap", [](double) { return true; });
    REQUIRE(report);
    const client::ProcessedStream& stream = report->streams.at("exact");
    INFO(to_text(*report));
    REQUIRE(stream.epochs.size() == 1);
    const client::ProcessedEpoch& epoch = stream.epochs.front();
    std::uint64_t all = 0;
    for (const std::uint64_t stamps : epoch.stamps) all += stamps;
    CHECK(all == epoch.items);
    CHECK(epoch.items == stream.items);
    CHECK(epoch.improved() > 1000);
    CHECK(epoch.stamps[static_cast<std::size_t>(Choice::other_clock)] > 2500);
    CHECK(epoch.sigma_after_ns < epoch.sigma_before_ns);
    CHECK_THAT(to_text(*report), Catch::Contains("left as they were: by PPS"));
    const auto json = to_json(*report)["streams"]["exact"]["epochs"][0];
    CHECK(json["improved"] == epoch.improved());
    CHECK(json["left"]["other_clock"] ==
          epoch.stamps[static_cast<std::size_t>(Choice::other_clock)]);
}
