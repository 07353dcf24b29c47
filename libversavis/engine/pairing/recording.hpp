// SPDX-License-Identifier: BSD-3-Clause
// Everything a pairing got, in order, as items of a ring: so that it can be done again,
// elsewhere.
#pragma once

#include <cstdint>
#include <variant>

#include "engine/pairing/pairing.hpp"
#include "versavis/error.hpp"
#include "versavis/stream.hpp"

namespace versavis::pairing {

/// Time passed, and something had waited too long.
struct Advance {
    HostTime now;
};

struct Reset {};

struct StartRequest {
    Start start{};
    HostTime now;
};

/// What a pairing can get. Limits come first, and again with each new stream of the camera: a
/// new pairing begins.
using Evidence = std::variant<Limits, Exposure, Arrival, Shortfall, Advance, Reset, StartRequest>;

/// The 96 bytes of an item of kind `evidence` (docs/contracts/shm-layout.md).
struct EvidenceMetadata {
    std::uint32_t kind;  ///< 1 + index in Evidence
    std::uint32_t reserved;
    std::uint64_t words[11];
};
static_assert(sizeof(EvidenceMetadata) == ring::metadata_size, "96 bytes of inline metadata");

using EvidenceItem = Typed<EvidenceMetadata>;
using EvidenceStream = Stream<EvidenceItem, ring::StreamKind::evidence>;

EvidenceMetadata to_metadata(const Evidence& evidence);

/// Errors: a kind that this version does not know.
Expected<Evidence> from_metadata(const EvidenceMetadata& metadata);

/// Applies one item of evidence to the pairing; Limits are left to the caller.
void apply(Pairing& pairing, const Evidence& evidence);

}  // namespace versavis::pairing
