// SPDX-License-Identifier: BSD-3-Clause
// versavis-liar: a liar between the rig's board and the service, and the judge of what the service
// makes of it.
#include <fmt/format.h>
#include <fnmatch.h>
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
#include "judge_process.hpp"
#include "proxy.hpp"

namespace versavis::liar {
namespace {

using nlohmann::json;

/// Within it the service must name a stream that lies suddenly, s.
constexpr double named_within = 2;

/// Stamps on their way: what happened later than this is not judged yet. At half, frames that a
/// loaded machine delivers late count as missing; at twice the run only takes longer.
constexpr Duration in_flight = milliseconds(300);

/// A stream must be back after this, where the machine has nothing else to do: a brief run, which
/// is one of many tests of a busy machine, shows how long it took and fails only if it is never
/// back.
constexpr Duration longest_recovery = seconds(1);

/// A stream that is not back after this does not come back.
constexpr Duration patience = seconds(8);

/// Samples of a rig that come so late were taken afterwards: rig or host stood still, which no
/// hardware does, and a row that failed is run once more. At half, a loaded machine comes close to
/// it.
constexpr double standstill_s = 0.5;

struct Settings {
    std::uint64_t messages = 100'000;
    std::uint64_t seed = 1;
    std::vector<std::string> kinds;
    bool brief = false;
    unsigned starts = 1;
    double rate_hz = 100;
    unsigned cameras = 3;
    unsigned subnet = 90;
    double floor_us = 100;
    double sigmas = 4;
    double falsify_truth_us = 0;
    bool data_ready = true;
    bool all = false;
    bool lengthy = false;
    std::string log;
    std::string json;
};

struct Row {
    std::string name;
    std::uint64_t damaged = 0;
    std::uint64_t items = 0;
    std::uint64_t clean = 0;
    std::uint64_t flagged = 0;
    std::uint64_t not_good = 0;
    std::uint64_t wrong = 0;
    std::uint64_t mislabelled = 0;
    double worst_us = 0;            ///< of the clean stamps that are right
    std::optional<double> named{};  ///< s, the first of the streams that lied
    std::string named_by{};
    std::string accused{};                     ///< honest streams that were named
    double hurt = 0;                           ///< s, of the honest stream that was hurt longest
    std::optional<double> recovery = 0;        ///< s after the lie, of the last stream
    std::uint64_t epochs = 0, own_epochs = 0;  ///< of honest streams, and of those that lied
    std::vector<std::string> complaints{};
    std::vector<std::string> failures{};
    json report{};
};

std::vector<std::string> names_of(unsigned mask) {
    std::vector<std::string> names;
    for (unsigned i = 0; i < 4; ++i)
        if ((mask & 1U << i) != 0) names.push_back(fmt::format("cam{}", i));
    if ((mask & streams::imu) != 0) names.emplace_back("imu0");
    if ((mask & (streams::exchanges | streams::other)) != 0) names.emplace_back("clock");
    return names;
}

std::vector<std::string> names_of(const Kind& kind) {
    unsigned mask = 0;
    for (const Victim& victim : kind.victims) {
        if (victim.type == Type::exposure)
            mask |= kind.way == Way::regular ? streams::cam0 : streams::cameras;
        else if (victim.type == Type::imu_sample)
            mask |= streams::imu;
        else
            mask |= streams::exchanges;
    }
    return names_of(mask);
}

class Run {
 public:
    explicit Run(const Settings& settings)
        : settings_(settings),
          stack_(stack_settings(settings, socket_directory_)),
          liar_(settings.seed, Duration{static_cast<std::int64_t>(1e9 / settings.rate_hz)}) {
        std::ifstream base(stack_.configuration_path());
        configuration_.assign(std::istreambuf_iterator<char>(base), {});
        configure(Setting::running);
        if (!settings.log.empty()) log_.open(settings.log);
        stack_.start_rig();
        auto proxy = Proxy::start(proxy_path(socket_directory_), stack_.socket_path(), liar_);
        if (!proxy) throw std::runtime_error(proxy.error().message());
        proxy_ = std::move(*proxy);
        std::vector<std::string> arguments{"--instance",
                                           stack_.instance(),
                                           "--truth",
                                           stack_.truth_path(),
                                           "--rate-hz",
                                           fmt::to_string(settings.rate_hz),
                                           "--floor-us",
                                           fmt::to_string(settings.floor_us),
                                           "--sigmas",
                                           fmt::to_string(settings.sigmas),
                                           "--falsify-truth-us",
                                           fmt::to_string(settings.falsify_truth_us)};
        for (const auto& camera : stack_.scenario().cameras)
            arguments.insert(arguments.end(), {"--camera", camera.name});
        if (!settings.data_ready) arguments.emplace_back("--no-data-ready");
        if (!settings.log.empty())
            arguments.insert(arguments.end(), {"--log", settings.log + ".judge"});
        judge_ = std::make_unique<JudgeProcess>(arguments);
        start_service();
    }

    int run(const std::vector<const Kind*>& chosen, const std::vector<const SteadyLie*>& steady) {
        print_heading();
        Row truth{"the truth"};
        phase(
            truth, {}, [&] { watch(milliseconds(settings_.brief ? 500 : 2000)); }, true);
        for (const Kind* kind : chosen) {
            Row row{std::string(kind->name)};
            const bool last = kind == chosen.back();
            phase(
                row, names_of(*kind), [&] { inject(*kind, row); }, !settings_.brief || last);
            if (kind->way == Way::step && row.epochs + row.own_epochs == 0)
                fail(row, "no new epoch");
        }
        for (const Setting setting :
             {Setting::running, Setting::from_start, Setting::nmea, Setting::nmea_from_start})
            run_steady(steady, setting);
        std::vector<const Kind*> random = chosen;
        std::erase_if(random, [](const Kind* kind) {
            return kind->way == Way::step || kind->way == Way::regular;
        });
        if (!random.empty() && damaged_at_random() < settings_.messages) {
            for (unsigned i = 0; i < settings_.starts; ++i) lie_from_the_start(random);
            lie_at_random(random);
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

    /// A receiver names seconds of UTC, so that is then the output clock.
    void configure(Setting setting) {
        const bool nmea = by_nmea(setting);
        std::ofstream(stack_.configuration_path())
            << configuration_ << "rate_hz = 819.2\n"
            << (settings_.data_ready ? "data_ready = true\n" : "")
            << "[ports]\ninputs = [\"pps\"]\n"
            << (nmea ? "nmea = true\n[clock]\noutput = \"realtime\"\npps = \"nmea\"\n"
                     : "[clock]\noutput = \"monotonic_raw\"\n");
        if (judge_)
            judge_->command({{"do", "output"}, {"clock", nmea ? "realtime" : "monotonic_raw"}});
    }

    void start_service() {
        liar_.forget();
        stack_.start_service();
        stack_.wait_for_status(test::healthy);
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
            fail(row, fmt::format("the service ended with {}: {}", code,
                                  output.substr(output.size() -
                                                std::min<std::size_t>(2000, output.size()))));
        }
        start_service();
    }

    /// Lets the judge read for some time.
    void watch(Duration time) {
        const HostTime end = host_now() + time;
        while (host_now() < end) {
            const timespec pause{0, 20'000'000};
            nanosleep(&pause, nullptr);
            if (!log_.is_open()) continue;
            for (const Damage& damage : liar_.damages_since(logged_)) {
                write_log(to_text(damage));
                ++logged_;
            }
        }
    }

    /// `liars`: the streams whose messages are false. `fresh`: a new service hears them from its
    /// start.
    template <class Lies>
    void phase(Row& row, const std::vector<std::string>& liars, Lies lies, bool until_whole,
               bool fresh = false) {
        try_phase(row, liars, lies, until_whole, fresh);
        const double still_s = row.report.value("rig_late_s", 0.0);
        if (row.failures.empty() || still_s < standstill_s) return;
        fmt::print("    the rig stood still for {:.2f} s: once more\n", still_s);
        rows_.pop_back();
        row = Row{row.name};
        row_ = &row;
        if (fresh)
            stack_.service().terminate();
        else
            restart_service(row);
        try_phase(row, liars, lies, until_whole, fresh);
    }

    template <class Lies>
    void try_phase(Row& row, const std::vector<std::string>& liars, Lies lies, bool until_whole,
                   bool fresh) {
        row_ = &row;
        const std::uint64_t damaged_before = liar_.damaged();
        damages_before_ = liar_.damages_since(0).size();
        judge_->command({{"do", "phase"}, {"name", row.name}});
        if (!liars.empty()) judge_->command({{"do", "lie"}, {"streams", liars}, {"fresh", fresh}});
        const HostTime begin = host_now();
        lies();
        liar_.obey({});
        const HostTime last = std::max(begin, liar_.last_lie());
        judge_->command({{"do", "truth"}, {"at_ns", last.ns}});
        if (until_whole) {
            watch(longest_recovery + milliseconds(700) + in_flight);
            take_report(row);
            while (!row.recovery && host_now() - last < patience) {
                watch(milliseconds(500));
                take_report(row);
            }
        } else {
            take_report(row);
            row.recovery = 0;
        }
        row.damaged = liar_.damaged() - damaged_before;
        if (!row.recovery || stack_.service().wait({}) >= 0) restart_service(row);
        if (!row.recovery) fail(row, "not back");
        if (row.wrong > 0) fail(row, fmt::format("{} wrong stamps", row.wrong));
        if (row.mislabelled > 0) fail(row, fmt::format("{} wrong labels", row.mislabelled));
        if (steady_ != nullptr) judge_steady(row);
        row_ = nullptr;
        rows_.push_back(row);
        print(rows_.back());
    }

    void take_report(Row& row) {
        const json report = judge_->report();
        Row fresh{row.name};
        for (const auto& [name, stream] : report["streams"].items()) {
            fresh.items += stream["items"].get<std::uint64_t>();
            fresh.clean += stream["clean"].get<std::uint64_t>();
            fresh.flagged += stream["flagged"].get<std::uint64_t>();
            fresh.not_good += stream["not_good"].get<std::uint64_t>();
            fresh.wrong += stream["wrong"].get<std::uint64_t>();
            fresh.mislabelled += stream["labels"].get<std::uint64_t>();
            fresh.worst_us = std::max(fresh.worst_us, stream["worst_ns"].get<double>() * 1e-3);
            const bool lied = stream["lied"].get<bool>();
            std::uint64_t& epochs = lied ? fresh.own_epochs : fresh.epochs;
            epochs = std::max(epochs, stream["epochs"].get<std::uint64_t>());
            if (!lied) fresh.hurt = std::max(fresh.hurt, stream["hurt_s"].get<double>());
            if (stream["recovery_s"].is_null())
                fresh.recovery.reset();
            else if (fresh.recovery)
                fresh.recovery = std::max(*fresh.recovery, stream["recovery_s"].get<double>());
            if (stream["worst_wrong"].is_object()) {
                const json& wrong = stream["worst_wrong"];
                fresh.complaints.push_back(fmt::format(
                    "{}: {} wrong, worst {:+.3f} ms at {}, sigma {} ns, flags {}, epoch {}", name,
                    stream["wrong"].get<std::uint64_t>(), wrong["error_ns"].get<double>() * 1e-6,
                    wrong["number"].get<std::uint64_t>(), wrong["sigma_ns"].get<std::uint64_t>(),
                    wrong["flags"].get<unsigned>(), wrong["epoch"].get<std::uint64_t>()));
            }
        }
        fresh.mislabelled += report["pps_wrong"].get<std::uint64_t>();
        constexpr std::size_t shown = 3;
        std::size_t labels = 0;
        for (const json& wrong : report["wrongs"]) {
            const std::string what = wrong["what"].get<std::string>();
            if (what != "stamp" && ++labels <= shown)
                fresh.complaints.push_back(fmt::format("{} {}: {}, {:+.3f} ms",
                                                       wrong["stream"].get<std::string>(),
                                                       wrong["number"].get<std::uint64_t>(), what,
                                                       wrong["error_ns"].get<double>() * 1e-6));
        }
        if (report["wrongs"].size() > 0) {
            const json& first = report["wrongs"].front();
            const std::string about = suspects(first);
            if (!about.empty()) fresh.complaints.push_back("after " + about);
        }
        for (const auto& [name, word] : report["named"].items()) {
            const bool lied =
                name == "clock" ? names_clock(row) : report["streams"][name]["lied"].get<bool>();
            const double after = word[0].get<double>();
            if (!lied && name != "clock")
                fresh.accused +=
                    (fresh.accused.empty() ? "" : "; ") +
                    fmt::format("{} {:.2f} s {}", name, after, word[1].get<std::string>());
            if (!lied || (fresh.named && *fresh.named <= after)) continue;
            fresh.named = after;
            fresh.named_by = name + " " + word[1].get<std::string>();
        }
        fresh.report = report;
        fresh.failures = row.failures;
        row = fresh;
    }

    std::uint64_t damaged_at_random() const { return liar_.damaged() - damaged_steadily_; }

    /// Which streams the judge was said to lie includes the clock.
    bool names_clock(const Row& row) const {
        for (const SteadyLie& lie : steady_lies())
            if (lie.name == row.name)
                return (lie.streams & (streams::exchanges | streams::other)) != 0;
        return true;
    }

    static void fail(Row& row, std::string why) { row.failures.push_back(std::move(why)); }

    /// One at a time, then at rates that leave the service less and less of the truth.
    void inject(const Kind& kind, const Row&) {
        if (kind.way == Way::regular) {
            liar_.obey({{&kind}});
            return watch(settings_.brief ? milliseconds(1000) : seconds(4));
        }
        const bool steps = kind.way == Way::step;
        const int singles = steps ? 1 : settings_.brief ? 2 : 5;  // two steps may cancel out
        for (int i = 0; i < singles; ++i) {
            const std::uint64_t before = liar_.damaged();
            liar_.obey({{&kind}, 1, 1});
            for (int waited = 0; waited < 12 && liar_.damaged() == before; ++waited)
                watch(milliseconds(100));
            watch(milliseconds(settings_.brief ? 100 : 200));
        }
        if (steps) return watch(longest_recovery);
        if (settings_.brief) return;
        for (const double rate : {0.02, 0.5}) {
            liar_.obey({{&kind}, rate});
            watch(milliseconds(1500));
        }
    }

    void run_steady(const std::vector<const SteadyLie*>& chosen, Setting setting) {
        const auto is_meant = [&](const SteadyLie* lie) { return lie->setting == setting; };
        if (std::none_of(chosen.begin(), chosen.end(), is_meant)) return;
        if (by_nmea(setting)) {
            stack_.service().terminate();
            configure(setting);
            start_service();
            stack_.wait_for_status(
                [](const json& status) { return status["clock"]["pps"] == "used"; });
        }
        for (const SteadyLie* lie : chosen)
            if (is_meant(lie)) run_steady(*lie, !settings_.brief || lie == chosen.back());
        if (!by_nmea(setting)) return;
        stack_.service().terminate();
        configure(Setting::running);
        start_service();
    }

    void run_steady(const SteadyLie& lie, bool until_whole) {
        Row row{lie.name};
        const bool fresh = from_start(lie.setting);
        const auto lies = [&] {
            if (fresh) {
                liar_.forget();
                liar_.begin(lie);
                stack_.start_service();
            } else {
                liar_.begin(lie);
            }
            watch(settings_.brief ? std::min(lie.lasts, seconds(1)) : lie.lasts);
            if (settings_.brief && steps_clock(lie)) watch(seconds(1));
        };
        if (fresh) stack_.service().terminate();
        steady_ = &lie;
        phase(row, names_of(lie.streams), lies, until_whole, fresh);
        steady_ = nullptr;
        damaged_steadily_ += rows_.back().damaged;
    }

    /// What a steady lie must not do beyond wrong stamps.
    void judge_steady(Row& row) const {
        if (steps_clock(*steady_)) {
            if (row.epochs + row.own_epochs == 0 && steady_->per_second == 0)
                fail(row, "no new epoch");
            return;
        }
        if (settings_.brief) return;
        if (row.epochs > 0) fail(row, fmt::format("{} needless epochs", row.epochs));
        if (from_start(steady_->setting)) return;  // a start takes its time
        if (row.hurt > longest_recovery.ns * 1e-9)
            fail(row, fmt::format("an honest stream suffers {:.1f} s", row.hurt));
        bool missed = false;
        for (const auto& [name, stream] : row.report["streams"].items())
            missed = missed || (stream["lied"].get<bool>() && stream["hurt_s"].get<double>() > 0);
        const bool sudden = steady_->per_second == 0;
        if (missed && (!row.named || (sudden && *row.named > named_within)))
            fail(row, "not named in time");
    }

    /// The service hears no word of truth before the first lie. What is off by the same amount from
    /// its first word on, for as long as a start takes, is another truth: of clock and exposures no
    /// such lies. Samples of an IMU must agree for longer than they last.
    void lie_from_the_start(std::vector<const Kind*> chosen) {
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
            watch(seconds(5));
        };
        phase(row, names_of(streams::all), lies, true, true);
    }

    void lie_at_random(const std::vector<const Kind*>& chosen) {
        constexpr double rates[] = {0.5, 0.1, 0.5, 0.01};
        for (std::size_t i = 0; damaged_at_random() < settings_.messages; ++i) {
            const double rate = rates[i % std::size(rates)];
            Row row{fmt::format("at random, {}", rate)};
            const auto lies = [&] {
                liar_.obey({chosen, rate});
                const HostTime end = host_now() + milliseconds(settings_.brief ? 1000 : 5000);
                while (host_now() < end && damaged_at_random() < settings_.messages)
                    watch(milliseconds(100));
            };
            phase(row, names_of(streams::all), lies, true);
        }
    }

    /// The lie about the same exposure or sample, else the last one; and the last about the clock.
    std::string suspects(const json& wrong) const {
        const std::vector<Damage> damages = liar_.damages_since(damages_before_);
        const HostTime at{wrong["at_ns"].get<std::int64_t>() + in_flight.ns};
        const auto last = [&](auto condition) {
            const auto found = std::find_if(
                damages.rbegin(), damages.rend(),
                [&](const Damage& damage) { return damage.at < at && condition(damage); });
            return found == damages.rend() ? "" : to_text(*found);
        };
        const std::string stream = wrong["stream"].get<std::string>();
        const std::string about = last([&](const Damage& t) {
            return t.number == wrong["number"].get<std::uint64_t>() &&
                   (t.type == Type::imu_sample || stream == fmt::format("cam{}", t.camera)) &&
                   (t.type == Type::exposure || t.type == Type::imu_sample);
        });
        const std::string any = last([](const Damage&) { return true; });
        const std::string clock = last([](const Damage& t) {
            return t.type == Type::clock_answer || t.type == Type::clock_follow_up;
        });
        const std::string first = about.empty() ? any : about;
        return first + (clock == any || clock.empty() ? "" : "; " + clock);
    }

    void write_log(const std::string& line) {
        if (log_.is_open()) log_ << row_->name << ": " << line << std::endl;
    }

    static void print_heading() {
        fmt::print("{:<32} {:>7} {:>7} {:>8} {:>7} {:>6} {:>6} {:>7} {:>7} {:>6} {:>6} {:>7}\n",
                   "kind", "damaged", "clean", "withheld", "flagged", "wrong", "label", "worst/us",
                   "named/s", "hurt/s", "back/s", "epochs");
    }

    static void print(const Row& row) {
        const auto time = [](std::optional<double> s, const char* none) {
            return s ? fmt::format("{:.2f}", *s) : std::string(none);
        };
        const std::uint64_t unpublished =
            row.not_good - std::min(row.not_good, row.flagged + row.wrong);
        fmt::print(
            "{:<32} {:>7} {:>7} {:>8} {:>7} {:>6} {:>6} {:>8.1f} {:>7} {:>6.2f} {:>6} {:>3}/{}{}\n",
            row.name, row.damaged, row.clean, unpublished, row.flagged, row.wrong, row.mislabelled,
            row.worst_us, time(row.named, "-"), row.hurt, time(row.recovery, "never"), row.epochs,
            row.own_epochs, row.failures.empty() ? "" : "  FAILED");
        if (!row.named_by.empty()) fmt::print("    named: {}\n", row.named_by);
        if (!row.accused.empty()) fmt::print("    named though honest: {}\n", row.accused);
        for (const std::string& complaint : row.complaints) fmt::print("    {}\n", complaint);
        for (const std::string& failure : row.failures) fmt::print("    FAILED: {}\n", failure);
        std::fflush(stdout);
    }

    int finish() {
        const int code = stack_.service().terminate();
        if (code != 0)
            fmt::print("the service ended with {}:\n{}\n", code, stack_.service().output());
        std::uint64_t wrong = 0;
        std::uint64_t mislabelled = 0;
        std::uint64_t damaged = 0;
        std::size_t failed = 0;
        json all = json::array();
        for (const Row& row : rows_) {
            damaged += row.damaged;
            wrong += row.wrong;
            mislabelled += row.mislabelled;
            failed += row.failures.empty() ? 0 : 1;
            json one = row.report;
            one["kind"] = row.name;
            one["damaged"] = row.damaged;
            one["failures"] = row.failures;
            all.push_back(one);
            for (const std::string& why : row.failures) fmt::print("{}: {}\n", row.name, why);
        }
        if (!settings_.json.empty()) std::ofstream(settings_.json) << all.dump(1) << '\n';
        const bool ok = failed == 0 && code == 0;
        fmt::print(
            "{}: seed {}, {} kinds, {} failed; {} messages damaged, {} wrong stamps and {} wrong "
            "labels were published as good\n",
            ok ? "ok" : "FAILED", settings_.seed, rows_.size(), failed, damaged, wrong,
            mislabelled);
        return ok ? EXIT_SUCCESS : EXIT_FAILURE;
    }

    Settings settings_;
    test::TemporaryDirectory socket_directory_;
    test::Stack stack_;
    Liar liar_;
    std::string configuration_;
    std::unique_ptr<Proxy> proxy_;
    std::unique_ptr<JudgeProcess> judge_;
    std::ofstream log_;
    std::vector<Row> rows_;
    Row* row_ = nullptr;
    const SteadyLie* steady_ = nullptr;
    std::size_t damages_before_ = 0;
    std::size_t logged_ = 0;
    std::uint64_t damaged_steadily_ = 0;
};

bool is_chosen(const Settings& settings, const std::string& name, bool by_default) {
    if (settings.kinds.empty()) return by_default;
    return std::any_of(settings.kinds.begin(), settings.kinds.end(), [&](const std::string& glob) {
        return ::fnmatch(glob.c_str(), name.c_str(), 0) == 0;
    });
}

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
    app.add_option("--kinds,--kind", settings.kinds,
                   "Only these kinds of lies, with * and ?, separated by commas")
        ->delimiter(',');
    app.add_flag("--all", settings.all, "Also kinds that the service is known to fail");
    app.add_flag("--long", settings.lengthy, "Also kinds that last a minute or more");
    app.add_flag("--brief", settings.brief, "Each kind twice, one after the other, then at random");
    app.add_option("--starts", settings.starts, "How often the service starts while it is lied to")
        ->capture_default_str();
    app.add_option("--rate-hz", settings.rate_hz, "Of each camera")->capture_default_str();
    app.add_option("--cameras", settings.cameras, "How many")
        ->check(CLI::Range(1, 4))
        ->capture_default_str();
    app.add_flag("!--no-data-ready", settings.data_ready,
                 "The IMU's data-ready line is not wired, so that sigma of its stamps is 0.4 ms");
    app.add_option("--subnet", settings.subnet, "Cameras are at 127.0.SUBNET.2 and up")
        ->check(CLI::Range(1, 254))
        ->capture_default_str();
    app.add_option("--floor-us", settings.floor_us, "Errors below it are not held against a stamp")
        ->capture_default_str();
    app.add_option("--sigmas", settings.sigmas, "Nor are errors below so many sigma")
        ->capture_default_str();
    app.add_option("--falsify-truth-us", settings.falsify_truth_us,
                   "Show the judge a truth that is off, to see that it notices");
    app.add_option("--log", settings.log, "File for every lie; FILE.judge: every wrong item");
    app.add_option("--json", settings.json, "File for the judge's report of each kind");
    app.add_flag("--list", list, "List the kinds");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? EX_OK : EX_USAGE;
    }
    std::vector<const Kind*> chosen;
    for (const Kind& kind : kinds())
        if (is_chosen(settings, std::string(kind.name), true)) chosen.push_back(&kind);
    std::vector<const SteadyLie*> steady;
    for (const SteadyLie& lie : steady_lies())
        if (is_chosen(settings, lie.name,
                      (!settings.brief || lie.brief) && (settings.all || lie.gate) &&
                          (settings.lengthy || !lie.lengthy)))
            steady.push_back(&lie);
    if (chosen.empty() && steady.empty()) {
        fmt::print(stderr, "versavis-liar: no such kind; see --list\n");
        return EX_USAGE;
    }
    if (list) {
        for (const Kind* kind : chosen) fmt::print("{}\n", kind->name);
        for (const SteadyLie* lie : steady) fmt::print("{}\n", lie->name);
        return EX_OK;
    }
    try {
        return Run(settings).run(chosen, steady);
    } catch (const std::exception& error) {
        fmt::print(stderr, "versavis-liar: {}\n", error.what());
        return EX_UNAVAILABLE;
    }
}
