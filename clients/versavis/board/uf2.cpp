// SPDX-License-Identifier: BSD-3-Clause
#include "board/uf2.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>
#include <system_error>

#include "wire/crc32.hpp"

namespace versavis::client {

namespace {

constexpr std::size_t block_size = 512;
constexpr std::size_t payload_at = 32;
constexpr std::uint32_t magic_first = 0x0A324655;  // "UF2\n"
constexpr std::uint32_t magic_second = 0x9E5D5157;
constexpr std::uint32_t magic_last = 0x0AB16F30;
constexpr std::uint32_t flag_not_flash = 0x00000001;
constexpr std::uint32_t flag_family = 0x00002000;
constexpr std::uint32_t family_rp2040 = 0xE48BFF56;
constexpr std::uint32_t first_rp2350 = 0xE48BFF59;  // secure ARM, RISC-V, ARM
constexpr std::uint32_t last_rp2350 = 0xE48BFF5B;

/// Bytes of the boot stage that its check covers; the check follows them.
constexpr std::size_t boot_stage_size = 252;

/// The largest file that is read: twice the flash, as half of each block is payload.
constexpr std::size_t largest_file = 2 * std::size_t{wire::flash_size};

const char* const cure = "take the versavis.uf2 of this release, or copy it again";

std::uint32_t word(std::span<const std::uint8_t> bytes, std::size_t at) {
    return std::uint32_t{bytes[at]} | std::uint32_t{bytes[at + 1]} << 8U |
           std::uint32_t{bytes[at + 2]} << 16U | std::uint32_t{bytes[at + 3]} << 24U;
}

struct Block {
    std::uint32_t flags;
    std::uint32_t address;
    std::uint32_t payload;
    std::uint32_t number;
    std::uint32_t count;
    std::uint32_t family;
};

bool has_magic(std::span<const std::uint8_t> block) {
    return word(block, 0) == magic_first && word(block, 4) == magic_second &&
           word(block, block_size - 4) == magic_last;
}

Block header(std::span<const std::uint8_t> block) {
    return {word(block, 8),  word(block, 12), word(block, 16),
            word(block, 20), word(block, 24), word(block, 28)};
}

struct Problem {
    std::string what;
    const char* cure;
};

/// What is wrong with a block by itself, and as the one of this number among so many.
std::optional<Problem> problem(const Block& block, std::size_t number, std::size_t count) {
    if ((block.flags & flag_family) == 0)
        return Problem{"names no chip family", "take a file that is made for the RP2040"};
    if (block.family != family_rp2040)
        return Problem{
            fmt::format("is for chips of family {:#010x}{}, the RP2040 is {:#010x}", block.family,
                        block.family >= first_rp2350 && block.family <= last_rp2350
                            ? " (RP2350, of a Pico 2)"
                            : "",
                        family_rp2040),
            "take the file for the board's chip"};
    if ((block.flags & flag_not_flash) != 0)
        return Problem{"is not for the flash", "take a file with nothing but the flash"};
    if (block.number != number)
        return Problem{fmt::format("has the number {}", block.number), cure};
    if (block.count != count)
        return Problem{
            fmt::format("says that there are {} blocks, the file has {}", block.count, count),
            cure};
    if (block.payload != flash_page)
        return Problem{fmt::format("has {} bytes, not {}", block.payload, flash_page), cure};
    if (block.address % flash_page != 0)
        return Problem{fmt::format("begins within a page, at {:#010x}", block.address), cure};
    if (block.address < flash_begin || block.address - flash_begin >= wire::flash_size)
        return Problem{fmt::format("is for {:#010x}, outside of the flash, which is {} KiB from "
                                   "{:#010x}",
                                   block.address, wire::flash_size / 1024, flash_begin),
                       "take the versavis.uf2 of a release"};
    if (block.address >= wire::settings_begin)
        return Problem{fmt::format("is for {:#010x}, where the board keeps its settings, from "
                                   "{:#010x}",
                                   block.address, wire::settings_begin),
                       "take the versavis.uf2 of a release"};
    return std::nullopt;
}

std::vector<std::uint8_t>& sector_of(FlashImage& image, std::uint32_t address) {
    auto& sector = image.sectors[address / flash_sector * flash_sector];
    if (sector.empty()) sector.assign(flash_sector, 0xFF);
    return sector;
}

/// False: the boot ROM would not start it and stay in the boot loader.
bool starts(const FlashImage& image) {
    const auto first = image.sectors.find(flash_begin);
    if (first == image.sectors.end()) return false;
    const std::span<const std::uint8_t> stage(first->second);
    return word(stage, boot_stage_size) == boot_stage_crc(stage.first(boot_stage_size));
}

/// False: it does not end with the seal of our firmware, or was changed since it got that.
bool is_sealed(const FlashImage& image) {
    std::vector<std::uint8_t> bytes;
    for (const auto& [address, sector] : image.sectors)
        bytes.insert(bytes.end(), sector.begin(), sector.end());
    // Less, or more, if pages are missing between: then the check does not fit.
    bytes.resize(image.pages * flash_page);
    const std::size_t check_at = bytes.size() - sizeof(std::uint32_t);
    return word(bytes, check_at - sizeof(std::uint32_t)) == wire::firmware_seal &&
           word(bytes, check_at) == wire::crc32(bytes.data(), check_at);
}

}  // namespace

std::uint32_t boot_stage_crc(std::span<const std::uint8_t> bytes) {
    std::uint32_t crc = 0xFFFFFFFF;
    for (const std::uint8_t byte : bytes) {
        crc ^= std::uint32_t{byte} << 24U;
        for (int bit = 0; bit < 8; ++bit)
            crc = crc << 1U ^ ((crc & 0x80000000U) != 0 ? 0x04C11DB7U : 0U);
    }
    return crc;
}

Expected<FlashImage> parse_uf2(std::span<const std::uint8_t> bytes, const std::string& file) {
    if (bytes.size() < block_size || word(bytes, 0) != magic_first)
        return failure(file, "is no UF2 file", "take the versavis.uf2 of a release");
    const std::size_t count = bytes.size() / block_size;
    FlashImage image;
    std::map<std::uint32_t, std::size_t> writers;  // of each page
    for (std::size_t number = 0; number < count; ++number) {
        const auto raw = bytes.subspan(number * block_size, block_size);
        const std::string where = fmt::format("{}, block {}", file, number);
        if (!has_magic(raw)) return failure(where, "is no block of a UF2 file", cure);
        const Block block = header(raw);
        if (const auto found = problem(block, number, count))
            return failure(where, found->what, found->cure);
        const auto [earlier, fresh] = writers.emplace(block.address, number);
        if (!fresh)
            return failure(
                where,
                fmt::format("is for {:#010x}, as block {} is", block.address, earlier->second),
                cure);
        std::copy_n(raw.begin() + payload_at, flash_page,
                    sector_of(image, block.address).begin() + block.address % flash_sector);
    }
    if (bytes.size() % block_size != 0)
        return failure(fmt::format("{}, block {}", file, count), "is cut off", cure);
    image.pages = count;
    if (!starts(image))
        return failure(fmt::format("{}, block 0", file),
                       "the chip would not start this: its boot stage is missing or damaged", cure);
    if (!is_sealed(image))
        return failure(file, "is damaged, or is not VersaVIS firmware: its checksum is wrong",
                       cure);
    return image;
}

Expected<FlashImage> read_uf2(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    const int error = errno;
    if (!in)
        return failure(file,
                       fmt::format("cannot be read: {}", std::generic_category().message(error)),
                       "check its name and permissions");
    std::vector<std::uint8_t> bytes(largest_file + 1);
    in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    bytes.resize(static_cast<std::size_t>(in.gcount()));
    if (bytes.size() > largest_file)
        return failure(file, "is larger than any flash of the RP2040",
                       "take the versavis.uf2 of a release");
    return parse_uf2(bytes, file);
}

}  // namespace versavis::client
