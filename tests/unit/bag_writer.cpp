// SPDX-License-Identifier: BSD-3-Clause
#include "export/bag_writer.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>

#include "export/metadata_csv.hpp"
#include "temporary_directory.hpp"

using namespace versavis;
using namespace versavis::client;

TEST_CASE("bag_writer: the header takes 4096 bytes, and times that ROS cannot hold are reported") {
    const test::TemporaryDirectory directory;
    const std::string path = directory.path() / "a.bag";
    auto bag = BagWriter::create(path, BagCompression::none);
    REQUIRE(bag);
    CHECK(bag->bytes() == 4109);
    CHECK_FALSE(BagWriter::create(path, BagCompression::none));
    const auto topic = bag->add_connection("/a", {"t", "m", "d"});
    const std::vector<std::byte> message(10);
    CHECK_FALSE(bag->write(topic, -1, message));
    CHECK_FALSE(bag->write(topic, 4'294'967'296'000'000'000, message));
    CHECK(bag->write(topic, 4'294'967'295'999'999'999, message));
    CHECK(bag->finish());
    std::ifstream file(path, std::ios::binary);
    const std::string all{std::istreambuf_iterator<char>(file), {}};
    CHECK(all.starts_with("#ROSBAG V2.0\n"));
    CHECK(all.size() == bag->bytes());
}

TEST_CASE("metadata_csv: rows have as many fields as there are columns") {
    const std::string stream = "a";
    for (const auto kind :
         {ring::StreamKind::frames, ring::StreamKind::imu, ring::StreamKind::events}) {
        const RecordedItem item{stream, kind, 1, 2, {3}, {}, {}, 0, ring::no_attributes, {}, {}};
        const auto fields = [](const std::string& line) {
            return std::count(line.begin(), line.end(), ',');
        };
        CHECK(fields(csv_row(item)) == fields(csv_columns(kind)));
    }
    CHECK(csv_columns(ring::StreamKind::status).empty());
}
