// SPDX-License-Identifier: BSD-3-Clause
// The memory functions that the compiler expects of every platform, by words where they can be.
#include <cstddef>
#include <cstdint>

namespace {

using Word = std::uint32_t;

std::uintptr_t misaligned(const void* pointer) {
    return reinterpret_cast<std::uintptr_t>(pointer) % sizeof(Word);
}

/// Copies whole words, four at a time, then one. Leaves pointers and size at what remains. The
/// compiler does not use the instructions that go on to the next word for this.
inline void copy_words(unsigned char*& to, const unsigned char*& from, std::size_t& size) {
    __asm__ volatile(
        "  b 2f\n"
        "1: ldmia %1!, {r3-r6}\n"
        "  stmia %0!, {r3-r6}\n"
        "2: sub %2, #16\n"
        "  bcs 1b\n"
        "  add %2, #16\n"
        "  b 4f\n"
        "3: ldmia %1!, {r3}\n"
        "  stmia %0!, {r3}\n"
        "4: sub %2, #4\n"
        "  bcs 3b\n"
        "  add %2, #4\n"
        : "+l"(to), "+l"(from), "+l"(size)::"r3", "r4", "r5", "r6", "cc", "memory");
}

}  // namespace

extern "C" {

void* memcpy(void* to, const void* from, std::size_t size) {
    auto* out = static_cast<unsigned char*>(to);
    const auto* in = static_cast<const unsigned char*>(from);
    if (misaligned(out) == misaligned(in)) {
        for (; size > 0 && misaligned(out) != 0; --size) *out++ = *in++;
        copy_words(out, in, size);
    }
    for (; size > 0; --size) *out++ = *in++;
    return to;
}

void* memmove(void* to, const void* from, std::size_t size) {
    if (to <= from) return memcpy(to, from, size);
    auto* out = static_cast<unsigned char*>(to) + size;
    const auto* in = static_cast<const unsigned char*>(from) + size;
    for (; size > 0; --size) *--out = *--in;
    return to;
}

void* memset(void* to, int value, std::size_t size) {
    auto* out = static_cast<unsigned char*>(to);
    const auto byte = static_cast<unsigned char>(value);
    const Word word = byte * 0x01010101U;
    for (; size > 0 && misaligned(out) != 0; --size) *out++ = byte;
    for (; size >= sizeof(Word); size -= sizeof(Word), out += sizeof(Word))
        *reinterpret_cast<Word*>(out) = word;
    for (; size > 0; --size) *out++ = byte;
    return to;
}

int memcmp(const void* a, const void* b, std::size_t size) {
    const auto* left = static_cast<const unsigned char*>(a);
    const auto* right = static_cast<const unsigned char*>(b);
    for (; size > 0; --size, ++left, ++right)
        if (*left != *right) return *left - *right;
    return 0;
}
}
