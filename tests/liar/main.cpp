// SPDX-License-Identifier: BSD-3-Clause
// versavis-liar: a liar between the rig's board and the service, and the judge of what the service
// makes of it.
#include <fmt/format.h>
#include <sysexits.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <memory>

#include "../support/stack.hpp"
#include "../support/temporary_directory.hpp"
#include "live_judge.hpp"
#include "proxy.hpp"

namespace versavis::liar {
namespace {

/// Of the rig's ADIS16448: 1/7000 gauss.
constexpr double magnetic_lsb_t = 1e-4 / 7000;

/// Stamps on their way: what happened later than this is not judged yet. At half, frames that a
/// loaded machine delivers late count as missing; at twice the run only takes longer.
constexpr Duration in_flight = milliseconds(300);

/// A stream must be back after this, where the machine has nothing else to do: a brief run, which
/// is one of many tests of a busy machine, shows how long it took and fails only if it is never
/// back.
constexpr Duration longest_recovery = seconds(1);

/// A stream that is not back after this does not come back.
constexpr Duration patience = seconds(8);

struct Settings {
    std::uint64_t messages = 100'000;
    std::uint64_t seed = 1;
    std::vector<std::string> kinds;
    bool brief = false;
    unsigned starts = 1;
    double rate_hz = 100;
    unsigned cameras = 3;
    unsigned subnet = 90;
    double floor_us = 300;
    std::string log;
};

struct Row {
    std::string name;
    std::uint64_t damaged = 0;
    Tally tally{};
    std::uint64_t wrong = 0;
    std::uint64_t mislabelled = 0;
    Duration worst{};
    std::optional<Duration> recovery = Duration{};
    std::vector<std::string> complaints{};
};

class Run {
 public:
    explicit Run(const Settings& settings)
        : settings_(settings),
          stack_(stack_settings(settings, socket_directory_)),
          liar_(settings.seed, Duration{static_cast<std::int64_t>(1e9 / settings.rate_hz)}) {
        std::ofstream(stack_.configuration_path(), std::ios::app)
            << "rate_hz = 819.2\n[clock]\noutput = \"monotonic_raw\"\n[ports]\ninputs = "
               "[\"pps\"]\n";
        if (!settings.log.empty()) log_.open(settings.log);
        stack_.start_rig();
        auto proxy = Proxy::start(proxy_path(socket_directory_), stack_.socket_path(), liar_);
        if (!proxy) throw std::runtime_error(proxy.error().message());
        proxy_ = std::move(*proxy);
        start_service();
    }

    int run() {
        std::vector<const Kind*> chosen;
        for (const Kind& kind : kinds())
            if (settings_.kinds.empty() || std::find(settings_.kinds.begin(), settings_.kinds.end(),
                                                     kind.name) != settings_.kinds.end())
                chosen.push_back(&kind);
        print_heading();
        Row truth{"the truth"};
        phase(
            truth, [&] { watch(milliseconds(settings_.brief ? 500 : 2000)); }, true);
        for (const Kind* kind : chosen) {
            Row row{std::string(kind->name)};
            const bool last = kind == chosen.back();
            judge_->set_edge_floor(kind->edge_floor);
            phase(
                row, [&] { inject(*kind, row); }, !settings_.brief || last);
            judge_->set_edge_floor({});
        }
        std::erase_if(chosen, [](const Kind* kind) {
            return kind->way == Way::step || kind->way == Way::regular;
        });
        if (!chosen.empty() && liar_.damaged() < settings_.messages) {
            for (unsigned i = 0; i < settings_.starts; ++i) tell_from_the_start(chosen);
            tell_at_random(chosen);
        }
        return finish();
    }

 private:
    static std::string proxy_path(const test::TemporaryDirectory& directory) {
        return (directory.path() / "liar").string();
    }

    static test::StackSettings stack_settings(const Settings& settings,
                                              const test::TemporaryDirectory& directory) {
        test::StackSettings stack;
        stack.name = fmt::format("liar-{}", ::getpid());
        stack.subnet = settings.subnet;
        stack.cameras = settings.cameras;
        stack.rate_hz = settings.rate_hz;
        stack.width = 64;
        stack.height = 48;
        stack.camera_scenario = "exposure_us = 2000\nreadout_us = 500\n";
        stack.camera_extra = "exposure_us = 2000\n";
        stack.scenarios = {"exposure_swing = 0.3\nexposure_swing_s = 3"};  // auto exposure
        stack.extras = {"", "on_unproved = \"flag\""};
        stack.faults = "[board]\ngnss = true\n";
        stack.link = "unix:" + proxy_path(directory);
        return stack;
    }

    void start_service() {
        liar_.forget();
        stack_.start_service();
        stack_.wait_for_status(test::healthy);
        judge_ = make_judge();
    }

    std::unique_ptr<LiveJudge> make_judge() const {
        return std::make_unique<LiveJudge>(
            JudgedSystem{stack_.scenario(), stack_.instance(), stack_.truth_path(), magnetic_lsb_t,
                         Duration{static_cast<std::int64_t>(settings_.floor_us * 1e3)}},
            liar_);
    }

    /// Pairing and hint of each camera, for a stream that does not come back.
    std::string condition() {
        std::string text = "not back;";
        const auto status = stack_.wait_for_status([](const auto&) { return true; });
        for (const auto& camera : status["cameras"])
            text += fmt::format(" {}: {}, {} {}", camera["name"].get<std::string>(),
                                camera["state"].get<std::string>(),
                                camera["pairing"].get<std::string>(),
                                camera["hint"].get<std::string>());
        write_log("status " + status.dump());
        return text;
    }

    void restart_service(Row& row) {
        liar_.obey({});
        if (!row.recovery && stack_.service().wait({}) < 0) row.complaints.push_back(condition());
        const int code = stack_.service().terminate();
        if (code != 0) {
            const std::string output = stack_.service().output();
            row.complaints.push_back(fmt::format(
                "the service ended with {}: {}", code,
                output.substr(output.size() - std::min<std::size_t>(2000, output.size()))));
        }
        start_service();
    }

    /// Judges what is published for some time.
    void watch(Duration time) {
        const HostTime end = host_now() + time;
        while (host_now() < end) {
            const std::vector<Wrong> wrongs = judge_->poll();
            for (const Damage& damage : liar_.damages_since(logged_)) {
                write_log(to_text(damage));
                ++logged_;
            }
            for (const Wrong& wrong : wrongs) blame(wrong);
            const timespec pause{0, 5'000'000};
            nanosleep(&pause, nullptr);
        }
    }

    template <class Lies>
    void phase(Row& row, Lies lies, bool until_whole) {
        row_ = &row;
        const HostTime begin = host_now();
        const std::uint64_t damaged_before = liar_.damaged();
        damages_before_ = liar_.damages_since(0).size();
        judge_->take_worst();
        lies();
        liar_.obey({});
        if (until_whole) {
            const HostTime last = std::max(begin, liar_.last_lie());
            watch(longest_recovery + milliseconds(700) + in_flight);
            row.recovery = judge_->recovery(last, host_now() - in_flight);
            while (!row.recovery && host_now() - last < patience) {
                watch(milliseconds(500));
                row.recovery = judge_->recovery(last, host_now() - in_flight);
            }
        }
        row.damaged = liar_.damaged() - damaged_before;
        row.tally = judge_->tally(begin - in_flight, host_now() - in_flight);
        row.worst = judge_->take_worst();
        if (!row.recovery || stack_.service().wait({}) >= 0) restart_service(row);
        print(row);
        rows_.push_back(row);
        row_ = nullptr;
    }

    /// One at a time, then at rates that leave the service less and less of the truth.
    void inject(const Kind& kind, const Row&) {
        if (kind.way == Way::regular) {
            liar_.obey({{&kind}});
            return watch(settings_.brief ? milliseconds(1000) : seconds(4));
        }
        const bool steps = kind.way == Way::step;
        const std::uint32_t epoch = judge_->epoch();
        const int singles = steps ? 1 : settings_.brief ? 2 : 5;  // two steps may cancel out
        for (int i = 0; i < singles; ++i) {
            const std::uint64_t before = liar_.damaged();
            liar_.obey({{&kind}, 1, 1});
            for (int waited = 0; waited < 12 && liar_.damaged() == before; ++waited)
                watch(milliseconds(100));
            watch(milliseconds(settings_.brief ? 100 : 200));
        }
        if (steps) {
            watch(longest_recovery);
            if (judge_->epoch() == epoch) row_->complaints.emplace_back("no new epoch");
            return;
        }
        if (settings_.brief) return;
        for (const double rate : {0.02, 0.5}) {
            liar_.obey({{&kind}, rate});
            watch(milliseconds(1500));
        }
    }

    /// The service hears no word of truth before the first lie. What is off by the same amount from
    /// its first word on, for as long as a start takes, is another truth: of clock and exposures no
    /// such lies. Samples of an IMU must agree for longer than they last.
    void tell_from_the_start(std::vector<const Kind*> chosen) {
        Row row{"from the start"};
        std::erase_if(chosen, [](const Kind* kind) {
            return kind->way == Way::late && kind->victims.front().type != Type::imu_sample;
        });
        if (chosen.empty()) return;
        const auto lies = [&] {
            stack_.service().terminate();
            liar_.forget();
            liar_.obey({chosen, 0.1});
            stack_.start_service();
            judge_ = make_judge();
            watch(seconds(5));
        };
        phase(row, lies, true);
    }

    void tell_at_random(const std::vector<const Kind*>& chosen) {
        constexpr double rates[] = {0.5, 0.1, 0.5, 0.01};
        for (std::size_t i = 0; liar_.damaged() < settings_.messages; ++i) {
            const double rate = rates[i % std::size(rates)];
            Row row{fmt::format("at random, {}", rate)};
            const auto lies = [&] {
                liar_.obey({chosen, rate});
                const HostTime end = host_now() + milliseconds(settings_.brief ? 1000 : 5000);
                while (host_now() < end && liar_.damaged() < settings_.messages)
                    watch(milliseconds(100));
            };
            phase(row, lies, true);
        }
    }

    /// The lie about the same exposure or sample, else the last one; and the last about the clock.
    std::string suspects(const Wrong& wrong) const {
        const std::vector<Damage> damages = liar_.damages_since(damages_before_);
        const auto last = [&](auto condition) {
            const auto found = std::find_if(damages.rbegin(), damages.rend(), condition);
            return found == damages.rend() ? "" : "; " + to_text(*found);
        };
        const std::string about = last([&](const Damage& t) {
            return t.number == wrong.number && t.camera == wrong.camera &&
                   (t.type == Type::exposure || t.type == Type::imu_sample);
        });
        const std::string any = last([](const Damage&) { return true; });
        const std::string clock = last([](const Damage& t) {
            return t.type == Type::clock_answer || t.type == Type::clock_follow_up;
        });
        return (about.empty() ? any : about) + (clock == any ? "" : clock);
    }

    void blame(const Wrong& wrong) {
        const std::string text = wrong.what + suspects(wrong);
        write_log("WRONG " + text);
        ++(wrong.is_stamp ? row_->wrong : row_->mislabelled);
        constexpr std::size_t shown = 4;
        if (row_->complaints.size() < shown) row_->complaints.push_back(text);
    }

    void write_log(const std::string& line) {
        if (log_.is_open()) log_ << row_->name << ": " << line << std::endl;
    }

    static void print_heading() {
        fmt::print("{:<16} {:>8} {:>8} {:>8} {:>8} {:>7} {:>7} {:>9} {:>11}\n", "kind", "damaged",
                   "good", "withheld", "flagged", "wrong", "label", "worst/us", "recovery/ms");
    }

    static void print(const Row& row) {
        const Tally& t = row.tally;
        fmt::print("{:<16} {:>8} {:>8} {:>8} {:>8} {:>7} {:>7} {:>9.1f} {:>11}\n", row.name,
                   row.damaged, t.good, t.items - t.good - t.flagged, t.flagged, row.wrong,
                   row.mislabelled, static_cast<double>(row.worst.ns) * 1e-3,
                   row.recovery ? std::to_string(row.recovery->ns / 1'000'000) : "never");
        for (const std::string& complaint : row.complaints) fmt::print("    {}\n", complaint);
        std::fflush(stdout);
    }

    int finish() {
        Row sum{"all"};
        bool slow = false;
        for (const Row& row : rows_) {
            sum.damaged += row.damaged;
            sum.tally += row.tally;
            sum.wrong += row.wrong;
            sum.mislabelled += row.mislabelled;
            sum.worst = std::max(sum.worst, row.worst);
            if (!row.recovery) sum.recovery.reset();
            slow = slow || !row.recovery;
            if (row.damaged == 0 || !row.recovery) continue;  // the first start is no recovery
            slow = slow || (!settings_.brief && *row.recovery > longest_recovery);
            if (sum.recovery) sum.recovery = std::max(*sum.recovery, *row.recovery);
        }
        print(sum);
        const int code = stack_.service().terminate();
        if (code != 0)
            fmt::print("the service ended with {}:\n{}\n", code, stack_.service().output());
        for (const Row& row : rows_)
            if (row.wrong + row.mislabelled > 0)
                fmt::print("{}: {} wrong, first: {}\n", row.name, row.wrong + row.mislabelled,
                           row.complaints.front());
        const bool ok = sum.wrong == 0 && sum.mislabelled == 0 && !slow && code == 0;
        fmt::print(
            "{}: seed {}, {} messages damaged, {} wrong stamps and {} wrong labels were "
            "published as good\n",
            ok ? "ok" : "FAILED", settings_.seed, sum.damaged, sum.wrong, sum.mislabelled);
        return ok ? EXIT_SUCCESS : EXIT_FAILURE;
    }

    Settings settings_;
    test::TemporaryDirectory socket_directory_;
    test::Stack stack_;
    Liar liar_;
    std::unique_ptr<Proxy> proxy_;
    std::unique_ptr<LiveJudge> judge_;
    std::ofstream log_;
    std::vector<Row> rows_;
    Row* row_ = nullptr;
    std::size_t damages_before_ = 0;
    std::size_t logged_ = 0;
};

}  // namespace
}  // namespace versavis::liar

int main(int argc, char** argv) {
    using namespace versavis::liar;
    CLI::App app{
        "A liar between the rig's board and the service damages messages, with a right CRC; exit "
        "code 1: a wrong stamp was published as good, a stream did not come back, or the service "
        "did not live"};
    Settings settings;
    bool list = false;
    app.add_option("--messages", settings.messages, "How many to damage")->capture_default_str();
    app.add_option("--seed", settings.seed, "Of the liar's choices")->capture_default_str();
    app.add_option("--kind", settings.kinds, "Only this kind of lie; may be repeated");
    app.add_flag("--brief", settings.brief, "Each kind twice, one after the other, then at random");
    app.add_option("--starts", settings.starts, "How often the service starts while it is lied to")
        ->capture_default_str();
    app.add_option("--rate-hz", settings.rate_hz, "Of each camera")->capture_default_str();
    app.add_option("--cameras", settings.cameras, "How many")
        ->check(CLI::Range(1, 4))
        ->capture_default_str();
    app.add_option("--subnet", settings.subnet, "Cameras are at 127.0.SUBNET.2 and up")
        ->check(CLI::Range(1, 254))
        ->capture_default_str();
    app.add_option("--floor-us", settings.floor_us,
                   "Errors below it are not held against a stamp; above, six sigma are its own")
        ->capture_default_str();
    app.add_option("--log", settings.log, "File for every lie and every wrong item");
    app.add_flag("--list", list, "List the kinds");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? EX_OK : EX_USAGE;
    }
    for (const std::string& name : settings.kinds)
        if (find_kind(name) == nullptr) {
            fmt::print(stderr, "versavis-liar: no kind '{}'; see --list\n", name);
            return EX_USAGE;
        }
    if (list) {
        for (const Kind& kind : kinds()) fmt::print("{}\n", kind.name);
        return EX_OK;
    }
    try {
        return Run(settings).run();
    } catch (const std::exception& error) {
        fmt::print(stderr, "versavis-liar: {}\n", error.what());
        return EX_UNAVAILABLE;
    }
}
