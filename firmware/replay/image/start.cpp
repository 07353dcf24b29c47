// SPDX-License-Identifier: BSD-3-Clause
// What runs before and beside the core: variables are set, and there is nothing to return to. The
// emulator loads the image, sets the stack pointer, and begins here.
#include <cstddef>
#include <cstdint>

extern "C" {

extern std::uint32_t bss_begin[];
extern std::uint32_t bss_end[];
using Constructor = void (*)();
extern const Constructor constructors_begin[];
extern const Constructor constructors_end[];
void replay_main();

[[gnu::used]] void replay_start() {
    for (std::uint32_t* word = bss_begin; word != bss_end; ++word) *word = 0;
    for (const Constructor* call = constructors_begin; call != constructors_end; ++call) (*call)();
    replay_main();
}

/// The compiler fills what an abstract class leaves open with it.
[[noreturn]] void pure_virtual() __asm__("__cxa_pure_virtual");
void pure_virtual() { __builtin_trap(); }
}
