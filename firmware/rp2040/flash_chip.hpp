// SPDX-License-Identifier: BSD-3-Clause
// The flash chip, command by command: nothing else runs from it, and nothing waits for it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace versavis::rp2040 {

class FlashChip {
 public:
    static constexpr std::size_t id_size = 8;

    /// From now on the chip gets its commands from here.
    void begin();

    void read_id(std::uint8_t* id);
    void read(std::uint32_t address, std::uint8_t* data, std::size_t size);
    bool busy();
    /// These begin what goes on while busy().
    void erase_sector(std::uint32_t address);
    void write_page(std::uint32_t address, const std::uint8_t* data, std::size_t size);

 private:
    void command(const std::uint8_t* head, std::size_t head_size, const std::uint8_t* out,
                 std::uint8_t* in, std::size_t size);
    void allow_write();
};

}  // namespace versavis::rp2040
