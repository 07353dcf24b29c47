// SPDX-License-Identifier: BSD-3-Clause
#include "imu/byte_register_part.hpp"

#include <catch2/catch.hpp>

#include "imu_setup.hpp"

using namespace versavis;
using namespace versavis::firmware;
using Action = SetupStep::Action;

TEST_CASE("byte_register_part: a write is an address and a value") {
    ImuTransfer write = access_of(wire::ImuKind::icm42688p, {Action::write, 0, 0x4F, 0x06, 0});
    CHECK(write.bus == ImuTransfer::Bus::spi);
    CHECK(write.chip == 0);
    CHECK(write.clock_hz == 20'000'000);
    CHECK(write.word_gap_ns == 0);
    CHECK(write.size == 2);
    CHECK(write.bytes[0] == 0x4F);
    CHECK(write.bytes[1] == 0x06);
    write = access_of(wire::ImuKind::bmi088, {Action::write, 1, 0x7E, 0xB6, 0});
    CHECK(write.chip == 1);
    CHECK(write.clock_hz == 10'000'000);
    CHECK(write.size == 2);
    CHECK(write.bytes[0] == 0x7E);
    CHECK(write.bytes[1] == 0xB6);
}

TEST_CASE("byte_register_part: a read is an address with bit 7, and its last byte is the answer") {
    struct Chip {
        wire::ImuKind kind;
        std::uint8_t chip, size;
    };
    // The accelerometer of a BMI088 sends a dummy byte first.
    const auto chip = GENERATE(values<Chip>({{wire::ImuKind::icm42688p, 0, 2},
                                             {wire::ImuKind::bmi088, 0, 2},
                                             {wire::ImuKind::bmi088, 1, 3}}));
    const ImuTransfer read = access_of(chip.kind, {Action::expect, chip.chip, 0x75, 0x47, 0});
    CHECK(read.chip == chip.chip);
    CHECK(read.size == chip.size);
    CHECK(read.bytes[0] == 0xF5);
    CHECK(read.bytes[1] == 0);  // what must be answered is not sent
    ImuReply reply;
    for (std::uint8_t i = 0; i < chip.size + 1; ++i)
        reply.bytes[i] = static_cast<std::uint8_t>(0x10 + i);
    CHECK(find_part(chip.kind)->answer(read, reply) == 0x10 + chip.size - 1);
}
