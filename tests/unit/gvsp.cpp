// SPDX-License-Identifier: BSD-3-Clause
#include "camera/gvsp.hpp"

#include <catch2/catch.hpp>

using namespace versavis::daemon::gvsp;
using Datagram = std::vector<std::uint8_t>;

namespace {

const Datagram plain_header{0, 0, 0x12, 0x34, 3, 0, 1, 2};
const Datagram extended_header{1, 0, 0, 0, 0x83, 0, 0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 0, 1, 0, 9};

Datagram image_leader(std::uint8_t payload_type) {
    return {0, 0, 0, payload_type, 0, 0, 0, 1, 0, 0, 0, 5, 1, 8, 0, 1, 0, 0, 7, 0x80,
            0, 0, 4, 0xB0,         0, 0, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0};
}

Datagram with_byte(Datagram bytes, std::size_t at, std::uint8_t value) {
    bytes[at] = value;
    return bytes;
}

}  // namespace

TEST_CASE("gvsp: headers with block ids of 16 and of 64 bits") {
    const auto plain = parse_packet(plain_header);
    REQUIRE(plain);
    CHECK(plain->block_id == 0x1234);
    CHECK(plain->id == 0x102);
    CHECK(plain->format == Format::payload);
    CHECK_FALSE(plain->extended);
    CHECK(plain->body.empty());

    Datagram datagram = extended_header;  // with the status of a packet that was sent again
    datagram.push_back(0xAA);
    const auto extended = parse_packet(datagram);
    REQUIRE(extended);
    CHECK(extended->block_id == 0x102030405);
    CHECK(extended->id == 0x10009);
    CHECK(extended->extended);
    REQUIRE(extended->body.size() == 1);
    CHECK(extended->body[0] == 0xAA);
}

TEST_CASE("gvsp: packets that are none are refused") {
    for (const Datagram& whole : {plain_header, extended_header})
        for (std::size_t size = 0; size < whole.size(); ++size)
            CHECK_FALSE(parse_packet(Bytes(whole).first(size)));
    CHECK_FALSE(parse_packet(with_byte(plain_header, 0, 0x80)));  // "I do not have it"
    CHECK_FALSE(parse_packet(with_byte(plain_header, 4, 4)));     // all in one
    CHECK_FALSE(parse_packet(with_byte(plain_header, 4, 7)));     // multipart
    CHECK_FALSE(parse_packet(with_byte(plain_header, 4, 1)));     // a leader that is not the first
    CHECK_FALSE(parse_packet({{0, 0, 0, 1, 3, 0, 0, 0}}));        // data that is the first
    CHECK_FALSE(parse_packet({{0, 0, 0, 0, 3, 0, 0, 1}}));        // of block 0
}

TEST_CASE("gvsp: the leader of a plain image, and of all else") {
    const auto leader = parse_leader(image_leader(1));
    REQUIRE(leader);
    CHECK(leader->image);
    CHECK(leader->ticks == 0x100000005);
    CHECK(leader->pixel_format == 0x01080001);
    CHECK(leader->width == 1920);
    CHECK(leader->height == 1200);
    CHECK(leader->padding_x == 3);
    const Datagram whole = image_leader(1);
    for (std::size_t size = 0; size < whole.size(); ++size)
        CHECK_FALSE(parse_leader(Bytes(whole).first(size)));
    CHECK_FALSE(parse_leader(with_byte(image_leader(1), 2, 0x40))->image);  // with chunks
    CHECK_FALSE(parse_leader(Bytes(image_leader(10)).first(4))->image);
}

TEST_CASE("gvsp: what an IP packet carries, by the lengths of its headers") {
    Datagram packet(20, 0);
    packet[0] = 0x45;
    const Datagram udp{0, 1, 0, 2, 0, 10, 0, 0, 0xAA, 0xBB, 0xFF};
    packet.insert(packet.end(), udp.begin(), udp.end());
    const Bytes body = udp_body(packet);
    REQUIRE(body.size() == 2);
    CHECK(body[0] == 0xAA);
    CHECK(udp_body(with_byte(packet, 0, 0x46)).empty());  // options where there are none
    CHECK(udp_body(with_byte(packet, 25, 12)).empty());   // cut
    CHECK(udp_body(with_byte(packet, 25, 7)).empty());
    for (std::size_t size = 0; size < 30; ++size)
        CHECK(udp_body(Bytes(packet).first(size)).empty());
    packet.insert(packet.begin() + 20, 4, 0);
    CHECK(udp_body(with_byte(packet, 0, 0x46)).size() == 2);
}

TEST_CASE("gvsp: data that packets of a size carry") {
    CHECK(data_per_packet(1500, false) == 1464);
    CHECK(data_per_packet(1500, true) == 1452);
    CHECK(data_per_packet(36, false) == 0);
    CHECK(data_per_packet(0, true) == 0);
}

TEST_CASE("gvsp: requests for packets") {
    CHECK(resend_request({0x1234, false, 0x10203, 0x10204}, 7) ==
          Datagram{0x42, 0, 0, 0x40, 0, 12, 0, 7, 0, 0, 0x12, 0x34, 0, 1, 2, 3, 0, 1, 2, 4});
    CHECK(resend_request({0x102030405, true, 1, 2}, 0x0809) ==
          Datagram{0x42, 0x10, 0, 0x40, 0, 20, 8, 9, 0, 0, 0, 0, 0, 0,
                   0,    1,    0, 0,    0, 2,  0, 0, 0, 1, 2, 3, 4, 5});
}
