// SPDX-License-Identifier: BSD-3-Clause
// A line of text, built without a C library.
#pragma once

#include <cstddef>
#include <cstdint>

namespace versavis::firmware {

class TextLine {
 public:
    TextLine& operator<<(const char* text) {
        while (*text != '\0') put(*text++);
        return *this;
    }
    TextLine& operator<<(const TextLine& line) {
        for (std::size_t i = 0; i < line.size_; ++i) put(line.text_[i]);
        return *this;
    }
    TextLine& operator<<(std::uint32_t number) {
        char digits[10];
        std::size_t count = 0;
        do {
            digits[count++] = static_cast<char>('0' + number % 10);
            number /= 10;
        } while (number != 0);
        while (count > 0) put(digits[--count]);
        return *this;
    }
    TextLine& hex(std::uint8_t byte) {
        constexpr char digits[] = "0123456789ABCDEF";
        put(digits[byte >> 4U]);
        put(digits[byte & 0xFU]);
        return *this;
    }

    const char* data() const { return text_; }
    std::size_t size() const { return size_; }

 private:
    void put(char c) {
        if (size_ < sizeof text_) text_[size_++] = c;
    }

    char text_[64] = {};
    std::size_t size_ = 0;
};

}  // namespace versavis::firmware
