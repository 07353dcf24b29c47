// SPDX-License-Identifier: BSD-3-Clause
// What a look at a ring found, item or none, as one value that a test can compare in a line.
#pragma once

#include "versavis/ring_reader.hpp"

namespace versavis::test {

enum class Found { item, nothing, lost, restarted, gone };

template <class T>
struct Looked : T {
    Looked() : T(ring::Item{}), found(Found::nothing) {}
    explicit Looked(const Expected<T, ring::NoItem>& received) : T(ring::Item{}) {
        if (received) {
            static_cast<T&>(*this) = *received;
        } else {
            found = static_cast<Found>(received.error().why);
            lost = received.error().lost;
        }
    }

    Found found = Found::item;
    std::uint64_t lost = 0;
};

template <class T>
Looked<T> look(const Expected<T, ring::NoItem>& received) {
    return Looked<T>(received);
}

}  // namespace versavis::test
