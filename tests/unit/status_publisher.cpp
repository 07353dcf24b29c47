// SPDX-License-Identifier: BSD-3-Clause
#include "health/status_publisher.hpp"
#include "../support/look.hpp"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "pipelines.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

nlohmann::json newest(ring::Reader& reader) {
    const auto item = test::look(reader.next());
    REQUIRE(item.found == test::Found::item);
    const auto* text = reinterpret_cast<const char*>(item.payload.data());
    return nlohmann::json::parse(text, text + item.payload.size());
}

}  // namespace

TEST_CASE("status_publisher: rates are those since the document before, its own stream included") {
    test::Pipelines bench;
    auto publisher = StatusPublisher::create(bench.directory.path());
    REQUIRE(publisher);
    auto reader = bench.reader("status");
    Status status;
    status.now = HostTime{100'000'000'000};
    status.streams = {{"imu0", "imu", 1000}};
    CHECK(publisher->due(status.now));
    publisher->publish(status, bench.translator);
    CHECK_FALSE(publisher->due(status.now + milliseconds(499)));
    CHECK(publisher->due(status.now + milliseconds(500)));
    auto document = newest(reader);
    CHECK(document["streams"].size() == 2);
    CHECK(document["streams"][0]["rate_hz"] == 0.0);
    status.now = status.now + milliseconds(500);
    status.streams = {{"imu0", "imu", 1100}};
    publisher->publish(status, bench.translator);
    document = newest(reader);
    CHECK(document["streams"][0]["rate_hz"] == 200.0);
    CHECK(document["streams"][1]["name"] == "status");
    CHECK(document["streams"][1]["rate_hz"] == 2.0);
    CHECK(document["streams"][1]["items"] == 1);
}

TEST_CASE("status_publisher: a count that begins anew has no negative rate") {
    test::Pipelines bench;
    auto publisher = StatusPublisher::create(bench.directory.path());
    REQUIRE(publisher);
    auto reader = bench.reader("status");
    Status status;
    for (const std::uint64_t items : {1000U, 10U}) {
        status.now = status.now + seconds(1);
        status.streams = {{"imu0", "imu", items}};
        publisher->publish(status, bench.translator);
    }
    newest(reader);
    CHECK(newest(reader)["streams"][0]["rate_hz"] == 0.0);
}

TEST_CASE("status_publisher: health is that of the newest document") {
    test::Pipelines bench;
    auto publisher = StatusPublisher::create(bench.directory.path());
    REQUIRE(publisher);
    CHECK(publisher->summary().health == Health::starting);
    Status status;
    status.now = HostTime{100'000'000'000};
    publisher->publish(status, bench.translator);  // the board is needed, and not there
    CHECK(publisher->summary().health == Health::degraded);
    status.board_needed = false;
    publisher->publish(status, bench.translator);
    CHECK(publisher->summary().health == Health::ok);
}

TEST_CASE("status_publisher: a large document is whole, in a larger ring") {
    test::Pipelines bench;
    auto publisher = StatusPublisher::create(bench.directory.path());
    REQUIRE(publisher);
    auto reader = bench.reader("status");
    Status status;
    status.now = HostTime{100'000'000'000};
    status.cameras.resize(200);
    publisher->publish(status, bench.translator);
    CHECK(test::look(reader.next()).found == test::Found::restarted);
    CHECK(newest(reader)["cameras"].size() == 200);
    publisher->publish(status, bench.translator);
    CHECK(newest(reader)["cameras"].size() == 200);  // in the same ring
}
