// SPDX-License-Identifier: BSD-3-Clause
// Register access of parts with 8-bit registers: bit 7 of the address reads.
#pragma once

#include "imu/imu_part.hpp"

namespace versavis::firmware {

class ByteRegisterPart : public ImuPart {
 public:
    void access(const SetupStep& step, ImuTransfer& transfer) const final {
        const bool reads = step.action == SetupStep::Action::expect;
        const std::size_t value_at = 1 + dummies(step.chip);
        transfer.chip = step.chip;
        transfer.clock_hz = clock_hz();
        transfer.size = static_cast<std::uint8_t>(reads ? value_at + 1 : 2);
        transfer.bytes[0] =
            static_cast<std::uint8_t>(reads ? step.address | read_bit : step.address);
        if (!reads) transfer.bytes[1] = static_cast<std::uint8_t>(step.value);
    }

    Nanoseconds pause() const final { return 0; }

    std::uint16_t answer(const ImuTransfer& asked, const ImuReply& reply) const final {
        return reply.bytes[asked.size - 1];
    }

 protected:
    ~ByteRegisterPart() = default;

    static constexpr std::uint8_t read_bit = 0x80;

    virtual std::uint32_t clock_hz() const = 0;
    /// Meaningless bytes between the address and the data of a read.
    virtual std::size_t dummies(std::uint8_t chip) const = 0;

    void burst(std::uint8_t chip, std::uint8_t first, std::size_t registers,
               ImuTransfer& transfer) const {
        transfer.chip = chip;
        transfer.clock_hz = clock_hz();
        transfer.size = static_cast<std::uint8_t>(1 + dummies(chip) + registers);
        transfer.bytes[0] = static_cast<std::uint8_t>(first | read_bit);
    }
};

}  // namespace versavis::firmware
