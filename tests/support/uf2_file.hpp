// SPDX-License-Identifier: BSD-3-Clause
// Makes UF2 files of an image, for tests that then damage them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "board/uf2.hpp"
#include "wire/crc32.hpp"

namespace versavis::test {

inline void put_word(std::vector<std::uint8_t>& bytes, std::size_t at, std::uint32_t value) {
    for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::uint8_t>(value >> 8 * i);
}

/// Puts the seal of our firmware on an image, which is then what it says.
inline void seal(std::vector<std::uint8_t>& image) {
    put_word(image, image.size() - 8, wire::firmware_seal);
    put_word(image, image.size() - 4, wire::crc32(image.data(), image.size() - 4));
}

/// `pages` of an image from the begin of the flash; its first page is one that the chip starts.
/// `seed`: images of different ones differ in each page.
inline std::vector<std::uint8_t> flash_image(std::size_t pages, std::uint8_t seed = 1) {
    std::vector<std::uint8_t> image(pages * client::flash_page);
    for (std::size_t i = 0; i < image.size(); ++i)
        image[i] = static_cast<std::uint8_t>(seed + i + i / client::flash_page * 7);
    put_word(image, 252, client::boot_stage_crc({image.data(), 252}));
    seal(image);
    return image;
}

/// One block of 512 bytes for each page.
inline std::vector<std::uint8_t> uf2_file(const std::vector<std::uint8_t>& image) {
    const std::size_t pages = image.size() / client::flash_page;
    std::vector<std::uint8_t> file(pages * 512);
    for (std::size_t page = 0; page < pages; ++page) {
        const std::size_t block = page * 512;
        put_word(file, block, 0x0A324655);
        put_word(file, block + 4, 0x9E5D5157);
        put_word(file, block + 8, 0x2000);
        put_word(file, block + 12,
                 static_cast<std::uint32_t>(client::flash_begin + page * client::flash_page));
        put_word(file, block + 16, client::flash_page);
        put_word(file, block + 20, static_cast<std::uint32_t>(page));
        put_word(file, block + 24, static_cast<std::uint32_t>(pages));
        put_word(file, block + 28, 0xE48BFF56);
        std::copy_n(image.begin() + static_cast<std::ptrdiff_t>(page * client::flash_page),
                    client::flash_page, file.begin() + static_cast<std::ptrdiff_t>(block + 32));
        put_word(file, block + 508, 0x0AB16F30);
    }
    return file;
}

inline std::string as_text(const std::vector<std::uint8_t>& bytes) {
    return {bytes.begin(), bytes.end()};
}

}  // namespace versavis::test
