// SPDX-License-Identifier: BSD-3-Clause
#include "board/asymmetry_keeper.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <future>

#include "pipelines.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

clock::ClockReport by_pps(Duration offset, Duration sigma) {
    clock::ClockReport report;
    report.asymmetry_source = clock::AsymmetrySource::pps;
    report.asymmetry = {offset, sigma};
    return report;
}

}  // namespace

TEST_CASE("asymmetry_keeper: what PPS measured at a port is used there another time") {
    test::Pipelines bench;
    const std::string directory = bench.directory.path();
    {
        AsymmetryKeeper first(directory, bench.translator);
        first.keep(by_pps(microseconds(40), microseconds(2)));  // of no port yet
        first.use("usb:1-2");
        CHECK(bench.translator.report().asymmetry_source == clock::AsymmetrySource::none);
        first.keep(by_pps(microseconds(30), microseconds(2)));
        first.keep(by_pps(microseconds(31), microseconds(2)));  // no more than its sigma
    }
    AsymmetryKeeper second(directory, bench.translator);
    second.use("usb:1-2");
    const auto report = bench.translator.report();
    CHECK(report.asymmetry_source == clock::AsymmetrySource::stored);
    CHECK(report.asymmetry.offset == microseconds(30));
    second.use("usb:1-3");
    CHECK(bench.translator.report().asymmetry_source == clock::AsymmetrySource::none);
}

TEST_CASE("asymmetry_keeper: a reconnect at the same port keeps what could not be stored") {
    test::Pipelines bench;
    AsymmetryKeeper keeper("/nowhere", bench.translator);
    keeper.use("usb:1-2");
    const clock::Asymmetry measured{microseconds(30), microseconds(2)};
    bench.translator.use_asymmetry(measured);
    keeper.keep(by_pps(measured.offset, measured.sigma));
    keeper.use("usb:1-2");
    CHECK(bench.translator.report().asymmetry.offset == measured.offset);
    keeper.use("usb:1-3");
    CHECK(bench.translator.report().asymmetry.offset.ns == 0);
}

TEST_CASE("asymmetry_keeper: only what PPS measured is stored") {
    test::Pipelines bench;
    {
        AsymmetryKeeper keeper(bench.directory.path(), bench.translator);
        keeper.use("usb:1-2");
        auto report = by_pps(microseconds(30), microseconds(2));
        report.asymmetry_source = clock::AsymmetrySource::stored;
        keeper.keep(report);
    }
    CHECK_FALSE(std::filesystem::exists(bench.directory.path() / "asymmetry.json"));
}

TEST_CASE("asymmetry_keeper: a disk that does not answer holds nobody up") {
    test::Pipelines bench;
    const std::string pipe = bench.directory.path() / "asymmetry.json.part";
    REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);  // to open it waits until somebody reads
    int reader = -1;
    {
        AsymmetryKeeper keeper(bench.directory.path(), bench.translator);
        keeper.use("usb:1-2");
        auto kept = std::async(std::launch::async, [&] {
            keeper.keep(by_pps(microseconds(30), microseconds(2)));
            keeper.keep(by_pps(microseconds(40), microseconds(2)));
        });
        const bool at_once = kept.wait_for(std::chrono::seconds(5)) == std::future_status::ready;
        reader = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK);  // whoever waits goes on
        CHECK(at_once);
    }
    ::close(reader);
}
