// SPDX-License-Identifier: BSD-3-Clause
// Everything a pairing got, in order, as items of a ring: so that it can be done again,
// elsewhere.
#pragma once

#include <cstdint>
#include <optional>
#include <variant>

#include "engine/pairing/pairing.hpp"
#include "engine/pairing/record_filter.hpp"
#include "versavis/error.hpp"
#include "versavis/stream.hpp"

namespace versavis::pairing {

/// Time passed, and something had waited too long.
struct Advance {
    HostTime now;
};

struct Reset {
    bool records_too = false;  ///< the next record may belong anywhere
};

/// The board left out so many grid points, and said so.
struct TriggersSkipped {
    std::uint64_t count = 0;
};

struct StartRequest {
    Start start{};
    HostTime now;
};

/// What the pairing of a camera and the filter of its records can get. Limits of both come first,
/// and again with each new stream of the camera: a new pairing begins. An exposure follows the
/// record that it is of, if that is believed.
using Evidence = std::variant<Limits, Exposure, Arrival, Shortfall, Advance, Reset, StartRequest,
                              RecordLimits, ReceivedRecord, TriggersSkipped>;

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

/// Errors: a kind that this version does not know; as for checked().
Expected<Evidence> from_metadata(const EvidenceMetadata& metadata);

/// What a file says, as long as a pairing can calculate with it. Error: a field that no service can
/// have recorded.
Expected<Evidence> checked(const Evidence& evidence);

/// Applies one item of evidence to the pairing; Limits are left to the caller.
void apply(Pairing& pairing, const Evidence& evidence);

/// The same for the filter of records.
void apply(RecordFilter& filter, const Evidence& evidence);

/// Pairs the evidence of a camera again, and believes the records that the service believed: the
/// same evidence leads to the same decisions. Not thread-safe.
class Replay {
 public:
    explicit Replay(Outcome& outcome) : outcome_(outcome) {}

    /// What comes before the first Limits is left out.
    void apply(const Evidence& evidence);

    /// Limits came.
    bool begun() const { return pairing_.has_value(); }

    /// The verdict on the newest record; null: none came, as before ring ABI 1.7.
    const RecordVerdict* record_verdict() const;

    /// Gives back everything that is not decided.
    void finish();

 private:
    Outcome& outcome_;
    std::optional<Pairing> pairing_;
    std::optional<RecordFilter> filter_;
    std::optional<std::uint64_t> refused_;  ///< trigger of the newest record, if it is doubted
};

}  // namespace versavis::pairing
