// SPDX-License-Identifier: BSD-3-Clause
#include "publish/evidence_recorder.hpp"
#include "../support/look.hpp"

#include <catch2/catch.hpp>

#include "pipelines.hpp"

using namespace versavis;
using namespace versavis::daemon;

TEST_CASE("evidence_recorder: what was recorded is read back, in order, from its ring on") {
    test::Pipelines bench;
    EvidenceRecorder recorder(bench.translator);
    recorder.record(pairing::Reset{});  // no ring yet
    CHECK(recorder.items() == 0);
    auto ring = EvidenceRecorder::make_ring(bench.directory.path(), "cam0");
    REQUIRE(ring);
    recorder.use(std::move(*ring));
    recorder.record(pairing::Shortfall{42, EventReason::frame_incomplete});
    recorder.record(pairing::Advance{HostTime{7}});
    auto reader = bench.reader("cam0-evidence");
    const auto evidence = [&] {
        return *pairing::from_metadata(
            unpack<pairing::EvidenceMetadata>(test::look(reader.next()).metadata));
    };
    CHECK(std::get<pairing::Shortfall>(evidence()).block_id == 42);
    CHECK(std::get<pairing::Advance>(evidence()).now.ns == 7);
    CHECK(test::look(reader.next()).found == test::Found::nothing);
    CHECK(recorder.items() == 2);
}
