// SPDX-License-Identifier: BSD-3-Clause
#include "imu/icm42688p.hpp"

#include <catch2/catch.hpp>
#include <vector>

#include "imu_setup.hpp"

using namespace versavis;
using namespace versavis::firmware;

namespace {

const ImuPart& icm42688p_part = *find_part(wire::ImuKind::icm42688p);

struct IcmRate {
    std::uint32_t millihertz;
    unsigned code;
};
const std::vector<IcmRate> icm42688p_rates{
    {8'000'000, 3}, {4'000'000, 4}, {2'000'000, 5}, {1'000'000, 6}, {500'000, 15},
    {200'000, 7},   {100'000, 8},   {50'000, 9},    {25'000, 10},   {12'500, 11}};

/// The replies of a reading with these data bytes, 17 of them, and this power register.
wire::ImuSample read_reply(const std::vector<int>& read_data, int power) {
    ImuReply replies[2];
    replies[0].bytes[0] = replies[1].bytes[0] = 0xEE;  // while the address goes out
    for (std::size_t i = 0; i < read_data.size(); ++i)
        replies[0].bytes[1 + i] = static_cast<std::uint8_t>(read_data[i]);
    replies[1].bytes[1] = static_cast<std::uint8_t>(power);
    wire::ImuSample sample{};
    CHECK(icm42688p_part.parse(replies, 2, sample) == Verdict::taken);
    return sample;
}

const std::vector<int> read_data{0xFF, 0x38, 0x00, 0x01, 0xFF, 0xFE, 0x01, 0x03, 0x80,
                                 0x00, 0x7F, 0xFF, 0x00, 0x06, 0xAA, 0xAA, 0x08};

}  // namespace

TEST_CASE("icm42688p: rates are those of the data sheet, never slower than asked") {
    for (std::size_t i = 0; i < icm42688p_rates.size(); ++i) {
        const std::uint32_t rate = icm42688p_rates[i].millihertz;
        CHECK(icm42688p_part.rate(rate) == rate);
        CHECK(icm42688p_part.rate(rate - 1) == rate);
        CHECK(icm42688p_part.rate(rate + 1) == (i == 0 ? rate : icm42688p_rates[i - 1].millihertz));
    }
    CHECK(icm42688p_part.rate(1) == 12'500);
}

TEST_CASE("icm42688p: set up by the registers of the data sheet, at each rate and filter") {
    for (const IcmRate& rate : icm42688p_rates)
        for (const unsigned filter : {0U, 1U, 7U}) {
            const std::vector<std::string> expected{
                "0:11=1, 2000",  // reset
                "0:75?47, 0",
                "0:14=3, 0",
                rate.millihertz >= 4'000'000 ? "0:64=60, 0" : "0:64=0, 0",  // short pulses
                "0:65=8, 0",
                fmt::format("0:52={:X}, 0", filter * 0x11),
                fmt::format("0:4F={:X}, 0", rate.code),
                fmt::format("0:50={:X}, 0", rate.code),
                "0:4E=F, 50000",
                "0:4E?F, 0"};
            CHECK(setup_of(icm42688p_part.kind(),
                           {rate.millihertz, static_cast<std::uint8_t>(filter), false}) ==
                  expected);
        }
}

TEST_CASE("icm42688p: a sample is a burst of all registers, and the one that shows the power") {
    ImuTransfer burst;
    icm42688p_part.reading(0, burst);
    CHECK(burst.chip == 0);
    CHECK(burst.clock_hz == 20'000'000);
    CHECK(burst.size == 18);
    CHECK(burst.bytes[0] == (0x80 | 0x1D));
    ImuTransfer power;
    icm42688p_part.reading(1, power);
    CHECK(power.chip == 0);
    CHECK(power.clock_hz == 20'000'000);
    CHECK(power.size == 2);
    CHECK(power.bytes[0] == (0x80 | 0x4E));
}

TEST_CASE("icm42688p: what the registers hold") {
    const wire::ImuSample sample = read_reply(read_data, 0x0F);
    CHECK(sample.temperature == -200);
    CHECK(std::vector(sample.accel, sample.accel + 3) == std::vector{1, -2, 259});
    CHECK(std::vector(sample.gyro, sample.gyro + 3) == std::vector{-32768, 32767, 6});
    CHECK(sample.flags == 0);
}

TEST_CASE("icm42688p: old data is reported, and a part that is off or gone") {
    std::vector<int> old = read_data;
    old[16] = 0xF7;  // every bit but data-ready
    CHECK(read_reply(old, 0x0F).flags == wire::imu_repeated);
    for (const int power : {0x00, 0x0E, 0x07, 0x1F, 0xFF}) {
        CHECK(read_reply(read_data, power).flags == wire::imu_check_failed);
        CHECK(read_reply(old, power).flags == wire::imu_check_failed);
    }
}
