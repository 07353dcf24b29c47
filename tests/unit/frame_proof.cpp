// SPDX-License-Identifier: BSD-3-Clause
#include "process/frame_proof.hpp"

#include <catch2/catch.hpp>

#include "../pairing/pairing_bench.hpp"

using namespace versavis;
using namespace versavis::client;
using namespace versavis::test;

namespace {

/// Evidence of a camera that was triggered before its start pattern, too.
struct ProvedCamera {
    explicit ProvedCamera(bool camera_clock = true) {
        Limits limits = Bench::made();
        limits.camera_clock = camera_clock;
        evidence.emplace_back(limits);
    }

    void take(std::uint64_t steps = 1, std::uint64_t ids = 1) {
        tick += steps;
        const Exposure one = Bench::exposure(trigger++, tick);
        id += ids;
        const Arrival arrival = bench.frame(id, one);
        evidence.emplace_back(one);
        evidence.emplace_back(arrival);
        evidence.emplace_back(Advance{arrival.arrived});
    }

    void pattern_and(int more) {
        const std::uint64_t base = tick;
        for (const std::uint64_t at : pattern) take(base + at - tick);
        for (int i = 0; i < more; ++i) take();
    }

    FrameProof proof() const {
        FrameProof proof;
        for (const Evidence& item : evidence) proof.add(item);
        return proof;
    }

    Bench bench;
    std::vector<Evidence> evidence;
    std::uint64_t trigger = 1;
    std::uint64_t id = 0;
    std::uint64_t tick = 0;
};

bool all_right(const std::vector<ProvedFrame>& proved) {
    for (const ProvedFrame& frame : proved)
        if (frame.arrival.arrived != frame.exposure.end_on_host + milliseconds(20)) return false;
    return true;
}

}  // namespace

TEST_CASE("frame_proof: frames before the lock are proved by those after it") {
    ProvedCamera stream;
    for (int i = 0; i < 15; ++i) stream.take();
    stream.pattern_and(40);
    const auto proved = stream.proof().finish();
    CHECK(proved.size() == 67);
    CHECK(all_right(proved));
    const auto late = std::count_if(proved.begin(), proved.end(),
                                    [](const auto& frame) { return frame.afterwards; });
    CHECK(late >= 5);
    CHECK(late <= 25);
}

TEST_CASE("frame_proof: without a camera's clock, only what lies between proved frames is proved") {
    ProvedCamera stream(false);
    for (int i = 0; i < 15; ++i) stream.take();
    stream.pattern_and(40);
    const auto proved = stream.proof().finish();
    CHECK(all_right(proved));
    CHECK(proved.size() < 67);
}

TEST_CASE("frame_proof: a frame whose exposure another contradicts stays unproved") {
    ProvedCamera stream;
    for (int i = 0; i < 5; ++i) stream.take();
    auto& wrong = std::get<Arrival>(stream.evidence[5]);
    wrong.camera_time = wrong.camera_time + period / 2;
    const std::uint64_t wrong_id = wrong.block_id;
    stream.pattern_and(40);
    const auto proved = stream.proof().finish();
    CHECK(all_right(proved));
    for (const ProvedFrame& frame : proved) CHECK(frame.arrival.block_id != wrong_id);
}

TEST_CASE("frame_proof: nothing without the begin of a stream") {
    ProvedCamera stream;
    stream.evidence.erase(stream.evidence.begin());
    stream.pattern_and(5);
    FrameProof proof = stream.proof();
    CHECK_FALSE(proof.begun());
    CHECK(proof.finish().empty());
    CHECK(FrameProof().finish().empty());
}

TEST_CASE("frame_proof: streams are not mixed") {
    ProvedCamera stream;
    stream.pattern_and(20);
    stream.evidence.emplace_back(Reset{});
    stream.evidence.emplace_back(Bench::made());
    stream.id = 500;
    stream.take(40);
    stream.pattern_and(20);
    const auto proved = stream.proof().finish();
    CHECK(all_right(proved));
    CHECK(proved.size() >= 60);
}
