// SPDX-License-Identifier: BSD-3-Clause
// Marks what libversavis.so exports; all else in it is hidden.
#pragma once

#define VERSAVIS_API __attribute__((visibility("default")))
