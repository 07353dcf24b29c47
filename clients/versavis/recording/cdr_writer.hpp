// SPDX-License-Identifier: BSD-3-Clause
// Messages of ROS 2 as bytes: CDR (XCDR1), little-endian.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>

#include "versavis/time.hpp"

namespace versavis::client {

/// Fields in the order of the message. Each number is aligned to its size, counted from behind the
/// four bytes that say how the message is encoded. Source: OMG, DDS-XTYPES 1.3, 7.4.3.
class CdrWriter {
 public:
    template <class T>
    CdrWriter& number(T value) {
        static_assert(std::is_arithmetic_v<T>);
        while ((bytes_.size() - encapsulation) % sizeof value != 0) bytes_ += '\0';
        bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
        return *this;
    }

    template <class Numbers>
    CdrWriter& numbers(const Numbers& values) {
        for (const auto value : values) number(value);
        return *this;
    }

    CdrWriter& text(std::string_view value) {
        number(static_cast<std::uint32_t>(value.size() + 1));
        bytes_.append(value);
        bytes_ += '\0';
        return *this;
    }

    /// std_msgs/msg/Header.
    CdrWriter& header(OutputTime time, std::string_view frame_id) {
        return this->time(time).text(frame_id);
    }

    /// builtin_interfaces/msg/Time. Seconds beyond 2^31 wrap, as they do in ROS.
    CdrWriter& time(OutputTime time) {
        constexpr std::int64_t second = 1'000'000'000;
        const std::int64_t ns = (time.ns % second + second) % second;
        number(static_cast<std::int32_t>((time.ns - ns) / second));
        return number(static_cast<std::uint32_t>(ns));
    }

    const std::string& bytes() const { return bytes_; }

 private:
    static constexpr std::size_t encapsulation = 4;
    std::string bytes_{'\0', '\1', '\0', '\0'};
};

}  // namespace versavis::client
