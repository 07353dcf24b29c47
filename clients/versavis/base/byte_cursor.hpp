// SPDX-License-Identifier: BSD-3-Clause
// Takes little-endian fields off bytes that nobody has checked: never reads beyond their end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

namespace versavis::client {

/// The same bytes, as long as they are there.
inline std::string_view as_text(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// After a field that is not wholly there, all that follow are zero or empty, and good() is false.
class ByteCursor {
 public:
    explicit ByteCursor(std::span<const std::byte> bytes) : bytes_(bytes) {}

    template <class T>
    T number() {
        static_assert(std::is_arithmetic_v<T>);
        T value{};
        const auto field = bytes(sizeof value);
        if (!field.empty()) std::memcpy(&value, field.data(), sizeof value);
        return value;
    }

    std::span<const std::byte> bytes(std::uint64_t count) {
        if (count > left()) good_ = false;
        if (!good_) return {};
        const auto field = bytes_.subspan(at_, count);
        at_ += count;
        return field;
    }

    /// Text behind its length, a u32.
    std::string_view text() {
        const auto field = bytes(number<std::uint32_t>());
        return {reinterpret_cast<const char*>(field.data()), field.size()};
    }

    /// Passes over what fills the place up to a multiple of `size`, counted from `origin`.
    void align(std::size_t size, std::size_t origin) {
        const std::size_t over = (at_ - origin) % size;
        if (over != 0) bytes(size - over);
    }

    bool good() const { return good_; }
    std::size_t at() const { return at_; }
    std::size_t left() const { return bytes_.size() - at_; }

 private:
    std::span<const std::byte> bytes_;
    std::size_t at_ = 0;
    bool good_ = true;
};

}  // namespace versavis::client
