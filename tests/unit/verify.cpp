// SPDX-License-Identifier: BSD-3-Clause
// A drive whose stamps are right, and the same drive with one thing wrong: `versavis verify` must
// say what, and where, and nothing of the rest.
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <random>

#include "engine/pairing/recording.hpp"
#include "verify/even_line.hpp"
#include "verify/verification.hpp"

using namespace versavis;
using namespace versavis::client;

namespace {

constexpr std::int64_t millisecond = 1'000'000;
constexpr std::int64_t microsecond = 1'000;

/// A board, two cameras and an IMU, whose crystals differ, on a link that delays messages.
class Drive {
 public:
    explicit Drive(std::int64_t seconds = 20) : seconds_(seconds) {
        evidence_.output_clock = "realtime";
        add_clock();
        for (const char* name : {"cam0", "cam1"}) add_camera(name);
        add_imu();
    }

    RecordedEvidence& evidence() { return evidence_; }
    CameraEvidence& camera(std::size_t i) { return evidence_.cameras[i]; }
    std::vector<StampedFrame>& frames(std::size_t i) { return evidence_.cameras[i].frames; }
    std::vector<StampedSample>& samples() { return evidence_.imus[0].samples; }

    static HostTime host_of(BoardTime board) {
        return {board.ns + 3'000'000'000 + std::llround(static_cast<double>(board.ns) * 12e-6)};
    }
    static OutputTime output_of(HostTime host) { return {host.ns + 1'764'000'000'000'000'000}; }

 private:
    std::int64_t delay(std::int64_t least, std::int64_t most) {
        return std::uniform_int_distribution<std::int64_t>(least, most)(random_);
    }

    void add_clock() {
        for (std::int64_t at = 0; at < seconds_ * 1000; at += 100) {
            const BoardTime received{at * millisecond + delay(0, 5 * millisecond)};
            const BoardTime answered{received.ns + 20 * microsecond};
            evidence_.clock.exchanges.push_back(
                {7, host_of(received) - Duration{delay(60 * microsecond, 300 * microsecond)},
                 received, answered,
                 host_of(answered) + Duration{delay(50 * microsecond, 250 * microsecond)}});
        }
        for (std::int64_t second = -1; second <= seconds_ + 1; ++second) {
            const HostTime host = host_of({second * 1000 * millisecond + 300 * millisecond});
            evidence_.clock.outputs.push_back(
                {1, host, output_of(host) - OutputTime{host.ns}, {200}});
        }
    }

    StampedItem item(std::uint64_t number, HostTime host) const {
        return {number, 99, output_of(host)};
    }

    /// The first gaps are of one and two periods, in no regular order.
    void add_camera(const char* name) {
        CameraEvidence& camera = evidence_.cameras.emplace_back();
        camera.name = name;
        CameraRun& run = camera.runs.emplace_back();
        run.period = {50 * millisecond};
        run.latest_arrival = {200 * millisecond};
        constexpr int pattern[] = {1, 2, 1, 1, 2, 2, 1, 2, 1, 1};
        BoardTime start{200 * millisecond};
        for (std::uint64_t i = 0; start.ns < seconds_ * 1000 * millisecond; ++i) {
            const std::uint64_t trigger = 40 + i;
            const BoardTime end{start.ns + 5 * millisecond};
            run.exposures.push_back({trigger, start, end, {30 * microsecond}, true});
            run.records.push_back({trigger, start + Duration{30 * microsecond},
                                   end + Duration{30 * microsecond}, true});
            const HostTime arrived =
                host_of(end) + Duration{8 * millisecond + delay(0, 2 * millisecond)};
            const CameraTime stamp{500'000'000'000 + start.ns +
                                   std::llround(static_cast<double>(start.ns) * 37e-6) +
                                   delay(0, 2 * microsecond)};
            run.arrivals.push_back({1000 + i, stamp, arrived, {5 * millisecond}});
            add_frame(camera, run, i, arrived, stamp);
            start.ns += 50 * millisecond * (i < std::size(pattern) ? pattern[i] : 1);
        }
    }

    void add_frame(CameraEvidence& camera, const CameraRun& run, std::uint64_t i, HostTime arrived,
                   CameraTime stamp) const {
        if (i < 5) return;  // not proved yet when they came
        const ExposureEvidence& exposure = run.exposures.back();
        FrameMetadata frame{};
        frame.trigger = exposure.trigger;
        frame.block_id = 1000 + i;
        frame.board_time = middle(exposure.start, exposure.end);
        frame.host_time = host_of(frame.board_time) + Duration{5 * microsecond};
        frame.arrival = arrived;
        frame.exposure = exposure.end - exposure.start;
        frame.camera_time = stamp;
        frame.sigma_ns = 10'000;
        frame.epoch = 1;
        frame.set_tick(i);
        frame.delay_ns = 30 * microsecond;
        camera.frames.push_back({item(camera.frames.size(), frame.host_time), frame});
    }

    void add_imu() {
        ImuEvidence& imu = evidence_.imus.emplace_back();
        imu.name = "imu0";
        for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(seconds_) * 200; ++i) {
            const BoardTime board{static_cast<std::int64_t>(i) * 5 * millisecond +
                                  delay(-microsecond, microsecond)};
            const HostTime host =
                host_of(board - Duration{2 * millisecond}) + Duration{5 * microsecond};
            imu.samples.push_back(
                {item(i, host), board, host, 7000 + i, {2 * millisecond}, 10'000, 1, 0});
            const BoardTime departed{board.ns + 400 * microsecond};
            evidence_.clock.messages.push_back(
                {7, departed,
                 host_of(departed) + Duration{delay(100 * microsecond, 900 * microsecond)}});
        }
    }

    std::mt19937 random_{20};
    std::int64_t seconds_;
    RecordedEvidence evidence_;
};

const StreamVerdict& verdict_of(const Verification& verification, const std::string& name) {
    for (const StreamVerdict& each : verification.streams)
        if (each.name == name) return each;
    FAIL("no stream " << name);
    return verification.streams.front();
}

const FindingSpan* find_span(const StreamVerdict& verdict, Finding finding) {
    for (const FindingSpan& span : verdict.findings)
        if (span.finding == finding) return &span;
    return nullptr;
}

std::uint64_t untrusted_items(const StreamVerdict& verdict) {
    return verdict.graded[static_cast<std::size_t>(Grade::untrusted)];
}

/// The stamp as if the instant had been another one, on all clocks.
void move_stamp(StampedFrame& each, std::int64_t by_ns) {
    each.frame.board_time.ns += by_ns;
    each.frame.host_time.ns += by_ns;
    each.time.ns += by_ns;
}

struct WrongDrive {
    const char* what;
    std::function<void(Drive&)> make;
    const char* name;
    Finding finding;
    std::int64_t from_s;
    std::int64_t to_s;
    std::uint64_t least_items;
    std::uint64_t most_items;
};

void of_other_exposure(StampedFrame& each, const CameraRun& run, int later) {
    const std::uint64_t trigger = each.frame.trigger + static_cast<std::uint64_t>(later);
    for (const ExposureEvidence& exposure : run.exposures) {
        if (exposure.trigger != trigger) continue;
        each.frame.trigger = trigger;
        move_stamp(each, (middle(exposure.start, exposure.end) - each.frame.board_time).ns);
        return;
    }
}

const WrongDrive wrong_drives[] = {
    {"all output times of a camera are 1 ms late",
     [](Drive& drive) {
         for (StampedFrame& each : drive.frames(1)) each.time.ns += millisecond;
     },
     "cam1", Finding::output_time, 0, 19, 380, 400},
    {"for a second, host and output times are 1 ms early",
     [](Drive& drive) {
         for (std::size_t i = 200; i < 220; ++i) {
             drive.frames(0)[i].frame.host_time.ns -= millisecond;
             drive.frames(0)[i].time.ns -= millisecond;
         }
     },
     "cam0", Finding::host_time, 9, 12, 20, 20},
    {"one stamp is 0.1 ms late on all clocks",
     [](Drive& drive) { move_stamp(drive.frames(0)[100], 100 * microsecond); }, "cam0",
     Finding::other_middle, 5, 6, 1, 1},
    {"one host time is 0.1 ms off those beside it",
     [](Drive& drive) {
         drive.frames(0)[100].frame.host_time.ns += 60 * microsecond;
         drive.frames(0)[100].time.ns += 60 * microsecond;
     },
     "cam0", Finding::uneven, 5, 6, 1, 1},
    {"frames are missing",
     [](Drive& drive) {
         auto& frames = drive.frames(0);
         frames.erase(frames.begin() + 150, frames.begin() + 160);
     },
     "cam0", Finding::missing, 8, 10, 1, 1},
    {"two frames have each other's stamps",
     [](Drive& drive) {
         auto& frames = drive.frames(0);
         for (auto [a, b] : {std::pair(100, 101)}) {
             std::swap(frames[a].frame.trigger, frames[b].frame.trigger);
             std::swap(frames[a].frame.board_time, frames[b].frame.board_time);
             std::swap(frames[a].frame.host_time, frames[b].frame.host_time);
             std::swap(frames[a].time, frames[b].time);
         }
     },
     "cam0", Finding::camera_clock, 5, 6, 2, 2},
    {"from a frame on, each has the stamp of the next trigger",
     [](Drive& drive) {
         for (std::size_t i = 200; i + 1 < drive.frames(0).size(); ++i)
             of_other_exposure(drive.frames(0)[i], drive.camera(0).runs[0], 1);
     },
     "cam0", Finding::camera_clock, 10, 19, 180, 200},
    {"an exposure is too long",
     [](Drive& drive) { drive.frames(0)[60].frame.exposure.ns += 100 * microsecond; }, "cam0",
     Finding::other_length, 3, 4, 1, 1},
    {"an exposure of another length than the camera states",
     [](Drive& drive) {
         auto& run = drive.camera(0).runs[0];
         run.exposures[65].end.ns += millisecond;
         run.records[65].end.ns += millisecond;
         drive.frames(0)[60].frame.exposure.ns += millisecond;
         move_stamp(drive.frames(0)[60], millisecond / 2);
     },
     "cam0", Finding::stated_length, 3, 4, 1, 1},
    {"an exposure was edited, and the frame with it",
     [](Drive& drive) {
         auto& exposure = drive.camera(0).runs[0].exposures[65];
         exposure.start.ns += 300 * microsecond;
         exposure.end.ns += 300 * microsecond;
         move_stamp(drive.frames(0)[60], 300 * microsecond);
     },
     "cam0", Finding::record_differs, 3, 4, 1, 1},
    {"a frame that never arrived",
     [](Drive& drive) { drive.frames(0)[60].frame.block_id += 100'000; }, "cam0",
     Finding::no_arrival, 3, 4, 1, 1},
    {"a stream drifts by 10 us/s",
     [](Drive& drive) {
         for (StampedSample& each : drive.samples()) {
             const std::int64_t by = each.board.ns / 100'000;
             each.host.ns += by;
             each.time.ns += by;
         }
     },
     "imu0", Finding::host_time, 8, 19, 1000, 2400},
    {"for 5 s, the second is wrong",
     [](Drive& drive) {
         for (std::size_t i = 100; i < 200; ++i) drive.frames(1)[i].time.ns += 1000 * millisecond;
     },
     "cam1", Finding::other_second, 5, 11, 100, 101},  // the one after it goes back
    {"a sample is 0.3 ms late on all clocks",
     [](Drive& drive) {
         StampedSample& each = drive.samples()[1000];
         each.board.ns += 300 * microsecond;
         each.host.ns += 300 * microsecond;
         each.time.ns += 300 * microsecond;
     },
     "imu0", Finding::sample_clock, 5, 5, 1, 1},
    {"a ROS message has another stamp than its item",
     [](Drive& drive) {
         drive.evidence().message_stamps["cam1"][drive.frames(1)[70].time.ns] = {25};
     },
     "cam1", Finding::message_stamp, 3, 5, 1, 1},
    {"samples are spliced in from before",
     [](Drive& drive) {
         auto& samples = drive.samples();
         samples.insert(samples.begin() + 2000, samples.begin() + 500, samples.begin() + 510);
     },
     "imu0", Finding::repeated, 9, 10, 1, 12},
};

}  // namespace

TEST_CASE("verify: all stamps of a drive are proved") {
    Drive drive;
    const Verification verification = verify(drive.evidence());
    INFO(to_text(verification));
    CHECK(verification.grade() == Grade::proved);
    CHECK(verification.streams.size() == 3);
    CHECK(verification.refused_exchanges == 0);
    CHECK_THAT(verification.sentence(), Catch::StartsWith("Synchronised: all 4"));
}

TEST_CASE("verify: what is wrong is found, where it is, and nowhere else") {
    for (const WrongDrive& wrong : wrong_drives) {
        Drive drive;
        wrong.make(drive);
        const Verification verification = verify(drive.evidence());
        INFO(wrong.what << "\n" << to_text(verification));
        const StreamVerdict& verdict = verdict_of(verification, wrong.name);
        const FindingSpan* span = find_span(verdict, wrong.finding);
        REQUIRE(span != nullptr);
        CHECK(span->from_s >= wrong.from_s);
        CHECK(span->to_s <= wrong.to_s);
        CHECK(untrusted_items(verdict) >= wrong.least_items);
        CHECK(untrusted_items(verdict) <= wrong.most_items);
        for (const StreamVerdict& other : verification.streams)
            if (other.name != wrong.name) CHECK(other.grade() == Grade::proved);
    }
}

TEST_CASE("verify: stamps by the camera's clock or by arrival are held against the output clock") {
    Drive drive;
    const StampKind kind = GENERATE(StampKind::camera_ptp, StampKind::arrival);
    for (StampedFrame& each : drive.frames(0)) {
        each.frame.flags = static_cast<std::uint32_t>(kind);
        each.frame.board_time = {};
    }
    const Verification plausible = verify(drive.evidence());
    CHECK(verdict_of(plausible, "cam0").grade() == Grade::plausible);
    CHECK_FALSE(verdict_of(plausible, "cam0").worst_second);
    for (std::size_t i = 100; i < 200; ++i) drive.frames(0)[i].time.ns += 37'000 * millisecond;
    drive.frames(0)[300].time.ns -= millisecond;
    const Verification verification = verify(drive.evidence());
    const StreamVerdict& verdict = verdict_of(verification, "cam0");
    INFO(to_text(verification));
    CHECK(find_span(verdict, Finding::other_second) != nullptr);
    CHECK(find_span(verdict, Finding::output_time) != nullptr);
    CHECK(untrusted_items(verdict) >= 101);
    CHECK(untrusted_items(verdict) <= 102);  // the one after the jump goes back
}

TEST_CASE("verify: the worst second is that with the most untrusted items") {
    Drive drive;
    drive.frames(0)[10].time.ns += 5 * millisecond;
    for (std::size_t i = 200; i < 230; ++i) drive.frames(0)[i].time.ns += millisecond;
    drive.frames(0)[214].time.ns += millisecond;
    const Verification verification = verify(drive.evidence());
    const auto worst = verdict_of(verification, "cam0").worst_second;
    REQUIRE(worst);
    CHECK(worst->finding == Finding::output_time);
    CHECK(worst->second == 11);
    CHECK(worst->items == 20);
    CHECK(worst->worst.ns > 1'500'000);
    CHECK_THAT(verification.sentence(), Catch::StartsWith("Not to be trusted: cam0, seconds 1"));
    CHECK(to_json(verification)["streams"][0]["worst_second"]["items"] == 20);
    CHECK(to_json(verification)["streams"][2]["worst_second"].is_null());
    CHECK_THAT(to_text(verification),
               Catch::Contains("cam0, worst second: 11, 20 frames: its time"));
}

TEST_CASE("verify: without a witness a stamp is plausible, not proved") {
    Drive drive;
    const auto check = [&](const char* name, Finding finding) {
        const Verification verification = verify(drive.evidence());
        INFO(to_text(verification));
        const StreamVerdict& verdict = verdict_of(verification, name);
        CHECK(verdict.grade() == Grade::plausible);
        CHECK(find_span(verdict, finding) != nullptr);
        CHECK(untrusted_items(verdict) == 0);
    };
    SECTION("no exchanges") {
        drive.evidence().clock.exchanges.clear();
        check("imu0", Finding::no_exchange);
    }
    SECTION("no evidence of the pairing") {
        drive.camera(0).runs.clear();
        check("cam0", Finding::no_record);
    }
    SECTION("the start is not in the recording, and frames may come late") {
        auto& run = drive.camera(0).runs[0];
        run.exposures.erase(run.exposures.begin(), run.exposures.begin() + 30);
        run.arrivals.erase(run.arrivals.begin(), run.arrivals.begin() + 30);
        drive.frames(0).erase(drive.frames(0).begin(), drive.frames(0).begin() + 40);
        check("cam0", Finding::no_start);
    }
    SECTION("a camera without a clock") {
        for (auto& arrival : drive.camera(0).runs[0].arrivals) arrival.camera = {};
        for (auto& each : drive.frames(0)) each.frame.camera_time = {};
        check("cam0", Finding::no_camera_clock);
    }
    SECTION("the output clock was not recorded") {
        drive.evidence().clock.outputs.clear();
        check("cam1", Finding::no_output_reading);
    }
    SECTION("a predicted middle") {
        drive.frames(0)[50].frame.flags = 1;
        check("cam0", Finding::no_edges);
    }
    SECTION("the receiver's second is doubted") {
        for (auto& each : drive.frames(0)) each.frame.flags = flag_second_doubted;
        check("cam0", Finding::second_doubted);
    }
}

TEST_CASE("verify: a run that is off by a trigger from its first frame on is not proved") {
    Drive drive;
    const int later = GENERATE(-2, -1, 1, 2);
    for (StampedFrame& each : drive.frames(0))
        of_other_exposure(each, drive.camera(0).runs[0], later);
    const Verification verification = verify(drive.evidence());
    INFO(to_text(verification));
    CHECK(verdict_of(verification, "cam0").grade() != Grade::proved);
    CHECK(verdict_of(verification, "cam0").graded[static_cast<std::size_t>(Grade::proved)] == 0);
}

TEST_CASE("verify: an exchange with impossible stamps moves no bound") {
    Drive drive;
    auto& exchanges = drive.evidence().clock.exchanges;
    for (std::size_t i = 10; i < exchanges.size(); i += 4) {
        exchanges[i].received.ns += 700 * microsecond;
        exchanges[i].answered.ns += 700 * microsecond;
    }
    const Verification verification = verify(drive.evidence());
    INFO(to_text(verification));
    CHECK(verification.grade() == Grade::proved);
    CHECK(verification.refused_exchanges >= 45);
}

TEST_CASE("verify: a camera whose clock is set still proves its frames") {
    Drive drive;
    const std::int64_t by = GENERATE(33, 5000, -5000) * millisecond;
    auto& run = drive.camera(0).runs[0];
    for (std::size_t i = 200; i < run.arrivals.size(); ++i) run.arrivals[i].camera.ns += by;
    for (auto& each : drive.frames(0))
        if (each.frame.block_id >= 1200) each.frame.camera_time.ns += by;
    const Verification verification = verify(drive.evidence());
    INFO(to_text(verification));
    CHECK(untrusted_items(verdict_of(verification, "cam0")) == 0);
}

TEST_CASE("verify: a camera that takes a frame of its own still proves the others") {
    Drive drive;
    for (auto& arrival : drive.camera(0).runs[0].arrivals)
        if (arrival.block_id >= 1200) ++arrival.block_id;
    for (auto& each : drive.frames(0))
        if (each.frame.block_id >= 1200) ++each.frame.block_id;
    const Verification verification = verify(drive.evidence());
    INFO(to_text(verification));
    CHECK(verdict_of(verification, "cam0").grade() == Grade::proved);
}

TEST_CASE("verify: a camera that begins to count anew still proves its frames") {
    Drive drive;
    auto& arrivals = drive.camera(0).runs[0].arrivals;
    const std::uint64_t count = 200;
    for (std::size_t k = count; k < arrivals.size(); ++k) arrivals[k].block_id -= 1000 + count - 1;
    for (StampedFrame& each : drive.frames(0))
        if (each.frame.block_id >= 1000 + count) each.frame.block_id -= 1000 + count - 1;
    CHECK(verdict_of(verify(drive.evidence()), "cam0").grade() == Grade::proved);
    // Without a clock of its own, nothing says which trigger a frame is of then.
    for (auto& arrival : arrivals) arrival.camera = {};
    CHECK(verdict_of(verify(drive.evidence()), "cam0").grade() == Grade::untrusted);
}

TEST_CASE("verify: triggers of two boots of the board are of two runs") {
    CameraEvidence camera;
    const auto add = [&](const pairing::Evidence& evidence) {
        add_camera_evidence(pack(pairing::to_metadata(evidence)), camera);
    };
    pairing::Limits limits;
    limits.period = milliseconds(50);
    pairing::Exposure exposure;
    exposure.trigger = 1;
    add(limits);
    add(exposure);
    add(pairing::Reset{});  // of the camera: the board counts on
    CHECK(camera.runs.size() == 1);
    add(pairing::Reset{true});
    add(exposure);
    REQUIRE(camera.runs.size() == 2);
    for (const CameraRun& run : camera.runs) {
        CHECK(run.exposures.size() == 1);
        CHECK(run.period == milliseconds(50));
    }
}

TEST_CASE("verify: a recording that begins and ends between a frame and its evidence") {
    Drive drive;
    CameraRun& run = drive.camera(0).runs[0];
    const std::uint64_t first = drive.frames(0)[3].frame.trigger;
    const std::uint64_t last = drive.frames(0)[drive.frames(0).size() - 4].frame.block_id;
    std::erase_if(run.exposures, [&](const auto& each) { return each.trigger < first; });
    std::erase_if(run.arrivals, [&](const auto& each) { return each.block_id > last; });
    const Verification verification = verify(drive.evidence());
    INFO(to_text(verification));
    const StreamVerdict& verdict = verdict_of(verification, "cam0");
    CHECK(untrusted_items(verdict) == 0);
    std::uint64_t without = 0;
    for (const FindingSpan& span : verdict.findings)
        if (span.finding == Finding::no_record) without += span.items;
    CHECK(without == 6);
}

TEST_CASE("verify: an IMU that was set up anew samples at other instants") {
    Drive drive;
    auto& samples = drive.samples();
    const std::size_t anew = samples.size() / 2 + 7;
    // Numbers go on after what was lost.
    samples.erase(samples.begin() + static_cast<std::ptrdiff_t>(anew),
                  samples.begin() + static_cast<std::ptrdiff_t>(anew) + 60);
    for (std::size_t i = anew; i < samples.size(); ++i) samples[i].sample -= 60;
    for (std::size_t i = anew; i < samples.size(); ++i) samples[i].number -= 60;
    const bool reported = GENERATE(true, false);
    if (reported) drive.evidence().set_up["imu0"] = {samples[anew].board - Duration{millisecond}};
    const Verification verification = verify(drive.evidence());
    INFO(to_text(verification));
    const StreamVerdict& verdict = verdict_of(verification, "imu0");
    CHECK((untrusted_items(verdict) == 0) == reported);
}

TEST_CASE("verify: suspect items are withheld, and are not judged") {
    Drive drive;
    for (std::size_t i = 0; i < 10; ++i) {
        drive.frames(0)[i].frame.flags = flag_suspect;
        drive.frames(0)[i].frame.sigma_ns = sigma_unknown;
        drive.frames(0)[i].frame.trigger += 3;
    }
    const Verification verification = verify(drive.evidence());
    INFO(to_text(verification));
    CHECK(verification.grade() == Grade::proved);
    CHECK(verdict_of(verification, "cam0").withheld == 10);
}

TEST_CASE("verify: times that no clock can have are named") {
    Drive drive;
    drive.camera(0).impossible = 2;
    const Verification verification = verify(drive.evidence());
    CHECK(verification.grade() == Grade::untrusted);
    CHECK(untrusted_items(verdict_of(verification, "cam0")) == 2);
}

TEST_CASE("verify: the report names each stream, in text, JSON and as a page") {
    Drive drive;
    for (std::size_t i = 200; i < 220; ++i) drive.frames(0)[i].frame.host_time.ns -= millisecond;
    Verification verification = verify(drive.evidence());
    verification.file = "a<b>.mcap";
    const nlohmann::json json = to_json(verification);
    CHECK(json["verdict"] == "not to be trusted");
    CHECK(json["streams"].size() == 3);
    CHECK(json["streams"][0]["findings"][0]["finding"] == "host_time");
    const std::string page = to_html(verification);
    CHECK_THAT(page, Catch::Contains("a&lt;b&gt;.mcap") &&
                         Catch::Contains("Not to be trusted: cam0") &&
                         Catch::Contains("class=\"untrusted\"") && Catch::Contains("imu0"));
    CHECK(page.find("a<b>") == std::string::npos);
}

TEST_CASE("verify: points off their line") {
    std::vector<LinePoint> points;
    for (std::int64_t i = 0; i < 70; ++i) points.push_back({i * 1000, i * 37});
    points[40].y += 500;
    points[69].y -= 300;
    const auto off = off_line(points);
    CHECK(off[40] == 500);
    CHECK(off[69] == -300);
    CHECK(usual_amount(off) == 0);
    CHECK(off_line({{0, 0}, {1, 5}}) == std::vector<std::int64_t>{0, 0});
    CHECK(usual_amount({}) == 0);
}
