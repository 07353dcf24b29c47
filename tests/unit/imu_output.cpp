// SPDX-License-Identifier: BSD-3-Clause
#include "imu/imu_output.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <iterator>
#include <random>
#include <vector>

#include "imu/adis.hpp"
#include "wire/imu_scale.hpp"

using namespace versavis;
using namespace versavis::firmware;
using wire::ImuKind;

namespace {

const wire::ImuScale adis16448 = wire::imu_scale(ImuKind::adis16448b);

ImuImage image_of(const wire::ImuSample& sample) {
    ImuImage image;
    REQUIRE(adis16448_image(sample, image));
    return image;
}

wire::ImuSample sample_of(ImuKind kind) {
    wire::ImuSample sample{};
    sample.kind = kind;
    return sample;
}

int as_signed(std::uint16_t word) { return static_cast<std::int16_t>(word); }

/// Twelve bits.
int temperature(const ImuImage& image) {
    CHECK((image.burst[11] & 0xF000U) == 0);
    return static_cast<std::int16_t>(image.burst[11] << 4U) / 16;
}

/// A word says what the sample did, as well as it can: off by half a unit, and by the rounding of
/// the ratio.
void check_word(double word, double wanted, double lowest, double highest, double off = 0.51) {
    const double nearest = std::clamp(wanted, lowest, highest);
    CHECK(word == Approx(nearest).margin(off));
}

}  // namespace

TEST_CASE("imu_output: every kind's words are those of an ADIS16448 that feels the same") {
    const auto kind =
        GENERATE(ImuKind::adis16448a, ImuKind::adis16448b, ImuKind::adis16445, ImuKind::adis16460,
                 ImuKind::adis16470, ImuKind::icm42688p, ImuKind::bmi088, ImuKind::vn100);
    const wire::ImuScale scale = wire::imu_scale(kind);
    // A VN-100's words have 32 bits, all others 16.
    const auto [widest, step] = GENERATE(table<std::int32_t, int>(
        {{50, 1}, {2'048, 37}, {32'767, 911}, {8'000'000, 123'457}, {INT32_MAX - 9, 77'777'777}}));
    if (kind != ImuKind::vn100 && widest > INT16_MAX) return;
    for (std::int64_t raw = -widest; raw <= widest; raw += step) {
        wire::ImuSample sample = sample_of(kind);
        const auto narrow =
            static_cast<std::int16_t>(std::clamp<std::int64_t>(raw, INT16_MIN, INT16_MAX));
        for (std::size_t axis = 0; axis < 3; ++axis) {
            sample.gyro[axis] = static_cast<std::int32_t>(raw + static_cast<int>(axis));
            sample.accel[axis] = static_cast<std::int32_t>(raw + 3 + static_cast<int>(axis));
            sample.magnetic[axis] = static_cast<std::int16_t>(axis == 1 ? -narrow / 2 : narrow);
        }
        sample.pressure = static_cast<std::uint16_t>(std::clamp<std::int64_t>(raw, 0, UINT16_MAX));
        sample.temperature = narrow;
        const ImuImage image = image_of(sample);
        for (std::size_t axis = 0; axis < 3; ++axis) {
            CAPTURE(raw, axis);
            check_word(as_signed(image.burst[1 + axis]),
                       sample.gyro[axis] * scale.gyro_rad_s / adis16448.gyro_rad_s, INT16_MIN,
                       INT16_MAX);
            check_word(as_signed(image.burst[4 + axis]),
                       sample.accel[axis] * scale.accel_m_s2 / adis16448.accel_m_s2, INT16_MIN,
                       INT16_MAX);
            check_word(as_signed(image.burst[7 + axis]),
                       sample.magnetic[axis] * scale.magnetic_t / adis16448.magnetic_t, INT16_MIN,
                       INT16_MAX);
        }
        check_word(image.burst[10], sample.pressure * scale.pressure_pa / adis16448.pressure_pa, 0,
                   UINT16_MAX);
        const double celsius = narrow * scale.temperature_c + scale.temperature_at_zero_c;
        // Slope and offset are rounded each.
        check_word(temperature(image),
                   (celsius - adis16448.temperature_at_zero_c) / adis16448.temperature_c, -2048,
                   2047, 1.01);
    }
}

TEST_CASE("imu_output: an ADIS16448's own words stay as they are") {
    wire::ImuSample sample = sample_of(GENERATE(ImuKind::adis16448a, ImuKind::adis16448b));
    const std::int16_t words[] = {0, 1, -1, 5, INT16_MAX, INT16_MIN};
    for (const std::int16_t word : words) {
        sample.gyro[2] = sample.accel[0] = sample.magnetic[1] = word;
        sample.pressure = static_cast<std::uint16_t>(word);
        sample.temperature = static_cast<std::int16_t>(word % 2048);
        const ImuImage image = image_of(sample);
        CHECK(as_signed(image.burst[3]) == word);
        CHECK(as_signed(image.burst[4]) == word);
        CHECK(as_signed(image.burst[8]) == word);
        CHECK(image.burst[10] == static_cast<std::uint16_t>(word));
        CHECK(temperature(image) == word % 2048);
    }
}

TEST_CASE("imu_output: what is beyond an ADIS16448's words stays at their ends") {
    wire::ImuSample sample = sample_of(ImuKind::adis16470);  // 2.5 times as coarse
    for (const auto& [raw, word] : {std::pair{13'106, 32'765},
                                    {13'107, 32'767},  // 32767.5
                                    {13'108, 32'767},
                                    {32'767, 32'767},
                                    {-13'107, -32'767},  // -32767.5
                                    {-13'108, -32'768},
                                    {-32'768, -32'768}}) {
        sample.gyro[0] = raw;
        CHECK(as_signed(image_of(sample).burst[1]) == word);
    }
    sample = sample_of(ImuKind::adis16448b);
    for (const auto& [raw, word] : {std::pair{2'046, 2'046},
                                    {2'047, 2'047},
                                    {2'048, 2'047},
                                    {32'767, 2'047},
                                    {-2'047, -2'047},
                                    {-2'048, -2'048},
                                    {-2'049, -2'048},
                                    {-32'768, -2'048}}) {
        sample.temperature = static_cast<std::int16_t>(raw);
        CHECK(temperature(image_of(sample)) == word);
    }
}

TEST_CASE("imu_output: the product, and a CRC over what follows the status") {
    std::mt19937 random(1);  // NOLINT(cert-msc51-cpp): the same samples each time
    for (int i = 0; i < 100; ++i) {
        wire::ImuSample sample = sample_of(ImuKind::icm42688p);
        for (std::int32_t& word : sample.gyro) word = static_cast<std::int16_t>(random());
        for (std::int32_t& word : sample.accel) word = static_cast<std::int16_t>(random());
        const ImuImage image = image_of(sample);
        CHECK(image.product == 16448);
        REQUIRE(image.burst[12] == adis16448_crc(image.burst + 1));
    }
}

TEST_CASE(
    "imu_output: a sample that failed its check is not shown, a part's own failure is reported") {
    wire::ImuSample sample = sample_of(ImuKind::bmi088);
    CHECK(image_of(sample).burst[0] == 0);
    sample.flags =
        wire::imu_overrun | wire::imu_stamped | wire::imu_repeated | wire::imu_accel_stamped;
    CHECK(image_of(sample).burst[0] == 0);
    sample.flags = wire::imu_self_test_failed;
    CHECK(image_of(sample).burst[0] == 0x20);
    ImuImage image;
    sample.flags = wire::imu_check_failed;
    CHECK_FALSE(adis16448_image(sample, image));
    sample.flags = wire::imu_check_failed | wire::imu_self_test_failed;
    CHECK_FALSE(adis16448_image(sample, image));
    CHECK(image.product == 0);
}
