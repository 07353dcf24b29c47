// SPDX-License-Identifier: BSD-3-Clause
// Analog Devices' ADIS164xx family: 16-bit registers behind a pipelined SPI, samples in one burst;
// from the data sheets of ADIS16448 (rev E) and ADIS16470 (rev A), and the register maps that the
// maker publishes for the others.
#pragma once

#include "imu/imu_part.hpp"

namespace versavis::firmware {

/// CRC of an ADIS16448B's burst: over the 11 words from angular rate to temperature.
/// A right-shifting register with the polynomial 0x1021 not reversed, low byte of each word first,
/// inverted and its bytes swapped at the end.
std::uint16_t adis16448_crc(const std::uint16_t* words);

/// What differs between the members of the family.
struct AdisFacts {
    enum class Check : std::uint8_t { twice, crc, byte_sum };

    wire::ImuKind kind;
    std::uint16_t product;
    std::uint8_t product_register;
    std::uint8_t command_register;  ///< GLOB_CMD: bit 7 resets, reading it bursts
    std::uint8_t control_register;  ///< MSC_CTRL
    std::uint8_t rate_register;
    std::uint8_t filter_register;
    std::uint16_t control;  ///< data-ready active high
    std::uint16_t filter_base;
    std::uint32_t fastest_millihertz;
    bool octaves;            ///< rates are fractions by powers of two, else by whole numbers
    std::uint8_t words;      ///< of a burst, the check included
    bool magnetic;           ///< has magnetometer and barometer
    std::uint16_t failures;  ///< bits of DIAG_STAT that report one
    Check check;
    std::uint32_t word_gap_ns;
    std::uint32_t reset_us;
};

class Adis final : public ImuPart {
 public:
    explicit constexpr Adis(const AdisFacts& facts) : facts_(facts) {}

    wire::ImuKind kind() const override { return facts_.kind; }
    std::uint16_t identity() const override { return facts_.product; }
    std::uint32_t fastest_millihertz() const override { return facts_.fastest_millihertz; }
    std::uint8_t strongest_filter() const override { return 6; }
    std::uint32_t rate(std::uint32_t wanted_millihertz) const override;
    void setup(const PartSettings& settings, Setup& setup) const override;
    void access(const SetupStep& step, ImuTransfer& transfer) const override;
    std::uint16_t answer(const ImuTransfer& asked, const ImuReply& reply) const override;
    Nanoseconds pause() const override { return facts_.word_gap_ns; }
    unsigned readings() const override { return facts_.check == AdisFacts::Check::twice ? 2 : 1; }
    void reading(unsigned index, ImuTransfer& transfer) const override;
    Verdict parse(const ImuReply* replies, unsigned count, wire::ImuSample& sample) const override;

 private:
    std::uint16_t rate_code(std::uint32_t millihertz) const;
    bool check(const std::uint16_t* words, const std::uint8_t* bytes) const;
    void fill(const std::uint16_t* words, wire::ImuSample& sample) const;

    AdisFacts facts_;
};

}  // namespace versavis::firmware
