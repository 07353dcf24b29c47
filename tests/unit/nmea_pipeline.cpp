// SPDX-License-Identifier: BSD-3-Clause
#include "pipeline/nmea_pipeline.hpp"

#include <catch2/catch.hpp>
#include <string>

#include "pipelines.hpp"
#include "versavis/metadata.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr HostTime start{100'000'000'000};
constexpr const char* good = "$GPZDA,201530.00,04,07,2002,00,00*60";
constexpr std::uint32_t baud = 9'600;
constexpr Duration two_characters = microseconds(2'083);

wire::Sentence sentence(const std::string& text, std::uint32_t sequence, BoardTime at) {
    wire::Sentence message{};
    message.time_ns = at.ns;
    message.sequence = sequence;
    message.size = static_cast<std::uint8_t>(text.size());
    text.copy(message.text, sizeof message.text);
    return message;
}

struct NmeaBench : test::Pipelines {
    NmeaPipeline pipeline{translator};
    std::optional<ring::Reader> nmea;

    NmeaBench() { configure(baud); }
    void configure(std::uint32_t rate) {
        REQUIRE(pipeline.configure(directory.path(), rate));
        if (!nmea) nmea = reader(nmea_stream);
    }

    /// Its first bit at `at`, here a second later.
    void add(const std::string& text, std::uint32_t sequence, HostTime at) {
        pipeline.add(sentence(text, sequence, to_board(at)), at + seconds(1));
    }

    std::pair<std::string, ring::Item> next() {
        auto item = nmea->next();
        REQUIRE(item);
        std::string text(item->payload.size(), '\0');
        REQUIRE(item->payload.copy_to(reinterpret_cast<std::byte*>(text.data())));
        return {text, std::move(*item)};
    }
};

}  // namespace

TEST_CASE("nmea_pipeline: a line is published with the time of its first bit") {
    NmeaBench bench;
    bench.synchronise(start);
    bench.add(good, 7, start + seconds(1));
    const auto [text, item] = bench.next();
    const auto data = unpack<NmeaMetadata>(item.metadata);
    CHECK(text == good);
    CHECK(data.board_time == bench.to_board(start + seconds(1)));
    CHECK(absolute(data.host_time - (start + seconds(1))) < microseconds(20));
    CHECK(item.time.ns == data.host_time.ns);  // the output clock is the host's
    CHECK(item.time.epoch == data.epoch);
    CHECK(data.number == 7);
    CHECK(data.flags == 0);
    CHECK(data.sigma_ns >= two_characters.ns);
    CHECK(data.sigma_ns < 2 * two_characters.ns);
}

TEST_CASE("nmea_pipeline: without a clock, and where its time cannot be, its arrival is stamped") {
    NmeaBench bench;
    bench.add(good, 1, start);
    bench.synchronise(start + seconds(2));
    bench.pipeline.add(sentence(good, 2, bench.to_board(start + seconds(9))), start + seconds(3));
    bench.add(good, 3, start + seconds(4));
    for (const Duration arrived : {seconds(1), seconds(3)}) {
        const auto [text, item] = bench.next();
        const auto data = unpack<NmeaMetadata>(item.metadata);
        CHECK(text == good);
        CHECK(data.flags == flag_suspect);
        CHECK(data.sigma_ns == sigma_unknown);
        CHECK(data.host_time == start + arrived);
    }
    CHECK(unpack<NmeaMetadata>(bench.next().second.metadata).flags == 0);
    CHECK(bench.pipeline.report()->suspect == 2);
}

TEST_CASE("nmea_pipeline: damage and losses are counted, and a board that restarts loses nothing") {
    NmeaBench bench;
    bench.synchronise(start);
    bench.add(good, 0xFFFFFFFF, start + seconds(1));
    bench.add("$GPZDA,201530.00,04,07,2002,00,00*61", 2, start + seconds(2));  // 0 and 1 are lost
    bench.pipeline.board_restarted();
    bench.add("!AIVDM", 5, start + seconds(3));
    CHECK(bench.pipeline.report()->sentences == 3);
    CHECK(bench.pipeline.report()->damaged == 2);
    CHECK(bench.pipeline.report()->lost == 2);
    CHECK(bench.pipeline.report()->suspect == 0);
    CHECK(unpack<NmeaMetadata>(bench.next().second.metadata).flags == 0);
    CHECK(unpack<NmeaMetadata>(bench.next().second.metadata).flags == flag_sensor_error);
    CHECK(unpack<NmeaMetadata>(bench.next().second.metadata).flags == flag_sensor_error);
}

TEST_CASE("nmea_pipeline: checksums of sentences as receivers send them") {
    CHECK(has_right_checksum("$GPRMC,225446,A,4916.45,N,12311.12,W,000.5,054.7,191194,020.3,E*68"));
    CHECK(has_right_checksum("!AIVDM,1,1,,A,14eG;o@034o8sd<L9i:a;WF>062D,0*7D"));
    CHECK(has_right_checksum("$PUBX,40,GGA,0,1,0,0*5b"));
    for (const char* bad : {"", "$", "$*", "$*0", "*00", "$GP", "$GPZDA*60 ", "$PUBX,40*5B"})
        CHECK_FALSE(has_right_checksum(bad));
    CHECK(has_right_checksum("$*00"));
}

TEST_CASE("nmea_pipeline: without a configuration nothing is published, and a new one goes on") {
    test::Pipelines none;
    NmeaPipeline idle{none.translator};
    idle.add(sentence(good, 1, {}), start);
    idle.heartbeat(start);
    CHECK_FALSE(idle.report());
    NmeaBench bench;
    bench.synchronise(start);
    bench.add(good, 1, start + seconds(1));
    bench.configure(115'200);
    bench.add(good, 2, start + seconds(2));
    CHECK(unpack<NmeaMetadata>(bench.next().second.metadata).sigma_ns >= two_characters.ns);
    const auto second = unpack<NmeaMetadata>(bench.next().second.metadata);
    CHECK(second.number == 2);
    CHECK(second.sigma_ns < two_characters.ns / 4);
}
