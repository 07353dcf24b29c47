// SPDX-License-Identifier: BSD-3-Clause
// Settings in flash, in two places by turns: what was stored before remains until the new is whole.
#pragma once

#include "base/hal.hpp"
#include "flash_chip.hpp"

namespace versavis::rp2040 {

/// Stores the configuration step by step, so that nothing else waits for the flash. Called from the
/// main loop only.
class SettingsStore final : public firmware::Persist {
 public:
    static constexpr std::size_t capacity = 1024;

    explicit SettingsStore(FlashChip& flash) : flash_(flash) {}

    std::size_t load(std::uint8_t* data, std::size_t capacity) override;
    bool store(const std::uint8_t* data, std::size_t size) override;
    Outcome take_outcome() override;

    /// One step of what is under way, if the flash is ready for it.
    void work();
    bool is_storing() const { return step_ != Step::idle; }

 private:
    struct Head {
        std::uint32_t magic;
        std::uint32_t number;  ///< one more than of what was stored before
        std::uint32_t size;
        std::uint32_t check;  ///< of number, size and data
    };
    struct Record {
        Head head;
        std::uint8_t data[capacity];
    };
    enum class Step : std::uint8_t { idle, erase, write, verify };

    bool read_place(unsigned place);
    static std::uint32_t check_of(const Record& record);
    void begin(Step step);
    void end(Outcome outcome);

    FlashChip& flash_;
    Step step_ = Step::idle;
    Outcome outcome_ = Outcome::none;
    unsigned next_place_ = 0;
    std::uint32_t number_ = 0;
    std::size_t done_ = 0;  ///< bytes of the step
    Record record_ = {};
};

}  // namespace versavis::rp2040
