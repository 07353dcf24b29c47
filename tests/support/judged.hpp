// SPDX-License-Identifier: BSD-3-Clause
// Judges a stack, and again when the machine's processors were taken away meanwhile.
#pragma once

#include "stack.hpp"

namespace versavis::test {

/// What a virtual machine loses to others delays rig and service alike, so frames are late or lost
/// for no fault of theirs. Nothing else is excused. Throws when the stack cannot be judged.
rig::Verdict judged(const Stack& stack, double seconds);

}  // namespace versavis::test
