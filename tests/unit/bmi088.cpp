// SPDX-License-Identifier: BSD-3-Clause
#include "imu/bmi088.hpp"

#include <catch2/catch.hpp>
#include <vector>

#include "imu_setup.hpp"

using namespace versavis;
using namespace versavis::firmware;

namespace {

const ImuPart& bmi088_part = *find_part(wire::ImuKind::bmi088);

struct BmiRate {
    std::uint32_t millihertz;
    unsigned code;
};
const std::vector<BmiRate> bmi088_rates{
    {2'000'000, 0}, {1'000'000, 2}, {400'000, 3}, {200'000, 6}, {100'000, 7}};

/// Replies of a part that is well; a test changes single bytes of them.
struct Replies {
    Replies() {
        // A gyro's register n comes in byte 1 + n; an accelerometer's after a dummy, in 2 + n.
        replies[0].bytes[0] = replies[1].bytes[0] = replies[1].bytes[1] = 0xEE;
        replies[2].bytes[0] = replies[2].bytes[1] = 0xEE;
        set(0, 1 + 0x00, {0x0F, 0xEE, 0x01, 0x00, 0xFE, 0xFF, 0x03, 0x01});
        set(1, 2 + 0x00, {0x1E, 0xEE, 0x00});
        set(1, 2 + 0x12, {0x00, 0x80, 0xFF, 0x7F, 0x06, 0x00});
        set(1, 2 + 0x22, {0x01, 0x60});
        set(2, 2, {0x00, 0x04});
    }
    void set(std::size_t reply, std::size_t at, const std::vector<int>& bytes) {
        for (const int byte : bytes) replies[reply].bytes[at++] = static_cast<std::uint8_t>(byte);
    }
    wire::ImuSample read() const {
        wire::ImuSample sample{};
        CHECK(bmi088_part.parse(replies, 3, sample) == Verdict::taken);
        return sample;
    }
    ImuReply replies[3];
};

}  // namespace

TEST_CASE("bmi088: rates are those of the gyro, never slower than asked") {
    for (std::size_t i = 0; i < bmi088_rates.size(); ++i) {
        const std::uint32_t rate = bmi088_rates[i].millihertz;
        CHECK(bmi088_part.rate(rate) == rate);
        CHECK(bmi088_part.rate(rate - 1) == rate);
        CHECK(bmi088_part.rate(rate + 1) == (i == 0 ? rate : bmi088_rates[i - 1].millihertz));
    }
    CHECK(bmi088_part.rate(1'000) == 100'000);
}

TEST_CASE("bmi088: set up by the registers of the data sheet, at each rate and filter") {
    for (const BmiRate& rate : bmi088_rates)
        for (const unsigned filter : {0U, 1U, 2U})
            for (const bool accel_ready : {false, true}) {
                std::vector<std::string> expected{
                    "1:00=0, 1000",  // to SPI
                    "1:7E=B6, 5000", "1:00=0, 1000",
                    "1:00?1E, 0",    "1:7C=0, 5000",
                    "1:7D=4, 50000", fmt::format("1:40={:X}, 1000", (0xAU - filter) << 4U | 0xCU),
                    "1:41=3, 1000"};
                // Its data-ready is shown only when that is wired.
                if (accel_ready) expected.insert(expected.end(), {"1:53=A, 1000", "1:58=4, 1000"});
                expected.insert(expected.end(), {"0:14=B6, 50000", "0:00?F, 0", "0:0F=0, 1000",
                                                 fmt::format("0:10={:X}, 1000", rate.code),
                                                 fmt::format("0:10?{:X}, 0", rate.code | 0x80U),
                                                 "0:16=D, 1000", "0:18=1, 1000", "0:15=80, 1000"});
                CHECK(setup_of(bmi088_part.kind(),
                               {rate.millihertz, static_cast<std::uint8_t>(filter), accel_ready}) ==
                      expected);
            }
}

TEST_CASE("bmi088: a sample is three transfers: both chips' data, and the accelerometer's power") {
    struct Expected {
        int chip, size, first;
    };
    const Expected expected[] = {{0, 9, 0x80}, {1, 2 + 0x24, 0x80}, {1, 4, 0xFC}};
    for (unsigned index = 0; index < 3; ++index) {
        ImuTransfer transfer;
        bmi088_part.reading(index, transfer);
        CHECK(transfer.chip == expected[index].chip);
        CHECK(transfer.clock_hz == 10'000'000);
        CHECK(transfer.size == expected[index].size);
        CHECK(transfer.bytes[0] == expected[index].first);
    }
}

TEST_CASE("bmi088: what the registers hold") {
    const Replies part_replies;
    const wire::ImuSample sample = part_replies.read();
    CHECK(std::vector(sample.gyro, sample.gyro + 3) == std::vector{1, -2, 259});
    CHECK(std::vector(sample.accel, sample.accel + 3) == std::vector{-32768, 32767, 6});
    CHECK(sample.temperature == 0x0B);
    CHECK(sample.flags == 0);
    Replies cold;
    cold.set(1, 2 + 0x22, {0xFF, 0xE0});
    CHECK(cold.read().temperature == -1);
    // The accelerometer's values are where accel_bytes() says.
    CHECK(bmi088_part.accel_bytes().reading == 1);
    CHECK(bmi088_part.accel_bytes().first == 2 + 0x12);
    CHECK(bmi088_part.accel_bytes().end == 2 + 0x12 + 6);
}

TEST_CASE("bmi088: a chip that is not there, or has lost its settings, fails the check") {
    struct Change {
        std::size_t reply, at;
        int byte;
    };
    const auto change = GENERATE(values<Change>({{0, 1, 0x0E},
                                                 {0, 1, 0x00},
                                                 {1, 2, 0x1F},
                                                 {1, 2, 0x00},
                                                 {2, 2, 0x03},
                                                 {2, 2, 0x01},
                                                 {2, 3, 0x00},
                                                 {2, 3, 0x05}}));
    Replies replies;
    replies.set(change.reply, change.at, {change.byte});
    CHECK(replies.read().flags == wire::imu_check_failed);
}

TEST_CASE("bmi088: the accelerometer's own diagnosis is reported") {
    for (unsigned bit = 0; bit < 8; ++bit) {
        Replies replies;
        replies.set(1, 2 + 0x02, {1 << bit});
        const bool reserved = (0x1DU >> bit & 1U) == 0;
        CHECK(replies.read().flags == (reserved ? 0 : wire::imu_self_test_failed));
    }
}
