// SPDX-License-Identifier: BSD-3-Clause
#include "engine/clock/recording.hpp"

#include <catch2/catch.hpp>

#include "clock/clock_json.hpp"
#include "versavis/metadata.hpp"

using namespace versavis;
using namespace versavis::clock;

namespace {

template <class Item>
Item there_and_back(const Item& item) {
    const auto read = from_metadata(unpack<ClockMetadata>(pack(to_metadata(item))));
    REQUIRE(read);
    REQUIRE(std::holds_alternative<Item>(*read));
    return std::get<Item>(*read);
}

template <class T>
T metadata_at(const ring::Metadata& bytes, std::size_t offset) {
    T value;
    std::memcpy(&value, reinterpret_cast<const char*>(bytes.data()) + offset, sizeof value);
    return value;
}

const RecordedExchange recorded_exchange{0x11223344, 7, 5, {-1}, {0x7000000000000002}, {3}, {4}};

}  // namespace

TEST_CASE("clock_recording: items come back from the ring as they were") {
    const RecordedExchange same = there_and_back(recorded_exchange);
    CHECK(same.nonce == 0x11223344);
    CHECK(same.request == 7);
    CHECK(same.flags == 5);
    CHECK(same.sent.ns == -1);
    CHECK(same.received.ns == 0x7000000000000002);
    CHECK(same.answered.ns == 3);
    CHECK(same.arrived.ns == 4);
    const RecordedMessage one_way = there_and_back(RecordedMessage{9, {10}, {11}});
    CHECK(one_way.nonce == 9);
    CHECK(one_way.departed.ns == 10);
    CHECK(one_way.arrived.ns == 11);
    CHECK(there_and_back(RecordedRestart{12}).nonce == 12);
    const RecordedOutput output = there_and_back(RecordedOutput{13, {14}, {-15}, {16}});
    CHECK(output.epoch == 13);
    CHECK(output.host.ns == 14);
    CHECK(output.minus_host.ns == -15);
    CHECK(output.uncertainty.ns == 16);
    CHECK(there_and_back(RecordedOutput{0, {}, {}, seconds(60)}).uncertainty.ns == UINT32_MAX);
}

TEST_CASE("clock_recording: layout by the document, and kinds that nobody knows") {
    const ring::Metadata bytes = pack(to_metadata(recorded_exchange));
    CHECK(metadata_at<std::uint32_t>(bytes, 0) == 1);
    CHECK(metadata_at<std::uint32_t>(bytes, 4) == 0x11223344);
    CHECK(metadata_at<std::uint32_t>(bytes, 8) == 7);
    CHECK(metadata_at<std::uint32_t>(bytes, 12) == 5);
    CHECK(metadata_at<std::int64_t>(bytes, 16) == -1);
    CHECK(metadata_at<std::int64_t>(bytes, 24) == 0x7000000000000002);
    CHECK(metadata_at<std::int64_t>(bytes, 32) == 3);
    CHECK(metadata_at<std::int64_t>(bytes, 40) == 4);
    const ring::Metadata output = pack(to_metadata(RecordedOutput{13, {14}, {-15}, {16}}));
    CHECK(metadata_at<std::uint32_t>(output, 0) == 4);
    CHECK(metadata_at<std::uint32_t>(output, 4) == 13);
    CHECK(metadata_at<std::int64_t>(output, 8) == 14);
    CHECK(metadata_at<std::int64_t>(output, 16) == -15);
    CHECK(metadata_at<std::uint32_t>(output, 24) == 16);
    CHECK(to_metadata(RecordedMessage{}).kind == 2);
    CHECK(to_metadata(RecordedRestart{}).kind == 3);
    ClockMetadata unknown = to_metadata(recorded_exchange);
    unknown.kind = GENERATE(0U, 5U, 0xFFFFFFFFU);
    CHECK_FALSE(from_metadata(unknown));
}

TEST_CASE("clock_recording: as JSON") {
    const auto line = client::to_json(ClockItem{recorded_exchange});
    CHECK(line["clock"] == "exchange");
    CHECK(line["nonce"] == 0x11223344);
    CHECK(line["sent_ns"] == -1);
    CHECK(line["answered_ns"] == 3);
    CHECK(client::to_json(ClockItem{RecordedMessage{9, {10}, {11}}})["departed_ns"] == 10);
    CHECK(client::to_json(ClockItem{RecordedRestart{12}})["clock"] == "board_restarted");
    CHECK(client::to_json(
              ClockItem{RecordedOutput{13, {14}, {-15}, {16}}})["output_minus_host_ns"] == -15);
}
