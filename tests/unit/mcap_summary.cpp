// SPDX-License-Identifier: BSD-3-Clause
#include "recording/mcap_summary.hpp"

#include <catch2/catch.hpp>
#include <set>

#include "base/byte_cursor.hpp"
#include "recording_file.hpp"

using namespace versavis;
using client::ByteCursor;

TEST_CASE("mcap_summary: footer and offsets name the places where their groups begin and end") {
    const std::string bytes = test::sample_recording(1, false, false, 0x01080001);
    const auto all = std::as_bytes(std::span(bytes.data(), bytes.size()));
    constexpr std::size_t footer = 9 + 20 + 8;
    ByteCursor end(all.last(footer));
    CHECK(end.number<std::uint8_t>() == 2);
    CHECK(end.number<std::uint64_t>() == 20);
    const auto summary = end.number<std::uint64_t>();
    const auto offsets = end.number<std::uint64_t>();
    CHECK(all[summary] == std::byte{3});
    CHECK(all[summary - 13] == std::byte{0x0F});  // the end of the data, with its checksum
    ByteCursor list(all.subspan(offsets, all.size() - footer - offsets));
    std::uint64_t next = summary;
    std::set<int> groups;
    while (list.left() > 0) {
        REQUIRE(list.number<std::uint8_t>() == 0x0E);
        CHECK(list.number<std::uint64_t>() == 17);
        const auto opcode = list.number<std::uint8_t>();
        const auto begin = list.number<std::uint64_t>();
        const auto length = list.number<std::uint64_t>();
        CHECK(begin == next);
        CHECK(all[begin] == std::byte{opcode});
        CHECK(groups.insert(opcode).second);
        next = begin + length;
    }
    CHECK(next == offsets);
    CHECK(groups == std::set<int>{3, 4, 0x0B, 8, 0x0A, 0x0D});
}
