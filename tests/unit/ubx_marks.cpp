// SPDX-License-Identifier: BSD-3-Clause
#include "gnss/ubx_marks.hpp"

#include <rapidcheck.h>

#include <catch2/catch.hpp>
#include <string>
#include <vector>

using namespace versavis::client;

namespace {

using Bytes = std::vector<std::uint8_t>;

/// UBX-TIM-TM2 of EXTINT 0: rising edge 515 in week 2385 at 123456.789 s and 321 ns, falling edge
/// 1 ms later, in GNSS time, both new, accuracy 21 ns. Bytes of another program.
const Bytes time_mark{0xB5, 0x62, 0x0D, 0x03, 28,   0,    0,    0xCC, 0x03, 0x02, 0x51, 0x09,
                      0x51, 0x09, 0x15, 0xCD, 0x5B, 0x07, 0x41, 0x01, 0,    0,    0x16, 0xCD,
                      0x5B, 0x07, 0x41, 0x01, 0,    0,    21,   0,    0,    0,    0xD3, 0x41};

UbxMarks read(const Bytes& bytes, MarkEdge edge = MarkEdge::rising) {
    return read_time_marks(std::as_bytes(std::span(bytes)), edge);
}

Bytes with_flags(std::uint8_t flags) {
    Bytes message = time_mark;
    message[7] = flags;
    unsigned a = 0;
    unsigned b = 0;
    for (std::size_t i = 2; i + 2 < message.size(); ++i) {
        a += message[i];
        b += a;
    }
    message[message.size() - 2] = static_cast<std::uint8_t>(a);
    message[message.size() - 1] = static_cast<std::uint8_t>(b);
    return message;
}

}  // namespace

TEST_CASE("ubx_marks: a time mark, field by field") {
    const auto found = read(time_mark);
    REQUIRE(found.marks.size() == 1);
    CHECK(found.messages == 1);
    CHECK(found.damaged == 0);
    const TimeMark& mark = found.marks[0];
    CHECK(mark.time_ns == 2385 * 604'800'000'000'000 + 123'456'789'000'321);
    CHECK(mark.count == 515);
    CHECK(mark.channel == 0);
    CHECK(mark.accuracy_ns == 21);
    CHECK(mark.base == TimeBase::gnss);
    CHECK(mark.valid);
    CHECK(read(time_mark, MarkEdge::falling).marks.at(0).time_ns == mark.time_ns + 1'000'000);
}

TEST_CASE("ubx_marks: only new edges, and times that the receiver knows") {
    CHECK(read(with_flags(0x48), MarkEdge::rising).marks.empty());
    CHECK(read(with_flags(0xC8), MarkEdge::falling).marks.empty());
    CHECK_FALSE(read(with_flags(0x88)).marks.at(0).valid);
    CHECK(read(with_flags(0xD0)).marks.at(0).base == TimeBase::utc);
    CHECK(read(with_flags(0xC0)).marks.at(0).base == TimeBase::receiver);
    CHECK_FALSE(read(with_flags(0xD8)).marks.at(0).valid);  // a base that there is not
}

TEST_CASE("ubx_marks: other messages, text and damage between them") {
    const std::string nmea = "$GPRMC,225446,A*00\r\n";
    const Bytes ack{0xB5, 0x62, 0x05, 0x01, 2, 0, 6, 1, 0x0F, 0x38};
    Bytes bytes(nmea.begin(), nmea.end());
    const auto add = [&](const Bytes& more) {
        bytes.insert(bytes.end(), more.begin(), more.end());
    };
    add(time_mark);
    add(ack);
    Bytes damaged = time_mark;
    damaged[20] ^= 1;
    add(damaged);
    add({0xB5, 0x62, 0x0D, 0x03, 0xFF, 0xFF});  // its length reaches beyond the end
    add(time_mark);
    add({0xB5});
    const auto found = read(bytes);
    CHECK(found.marks.size() == 2);
    CHECK(found.messages == 3);
    CHECK(found.damaged == 2);
}

TEST_CASE("ubx_marks: any bytes do no harm") {
    CHECK(rc::check([](const Bytes& junk) {
        Bytes bytes = junk;
        bytes.insert(bytes.end(), time_mark.begin(), time_mark.end());
        RC_ASSERT(read(bytes).marks.size() <= 1U + junk.size() / 36);
    }));
    for (std::size_t size = 0; size < time_mark.size(); ++size)
        CHECK(read({time_mark.begin(), time_mark.begin() + static_cast<std::ptrdiff_t>(size)})
                  .marks.empty());
}
