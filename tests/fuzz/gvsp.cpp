// SPDX-License-Identifier: BSD-3-Clause
// Any packets of a camera's stream: nothing is written beside a frame's own memory.
#include "camera/gvsp.hpp"

#include <cstdlib>
#include <map>
#include <memory>

#include "camera/frame_assembler.hpp"
#include "fuzz.hpp"

using namespace versavis;
using namespace versavis::daemon;

namespace {

constexpr std::size_t payload = 200;
constexpr std::size_t packet_size = 28 + 8 + 20;
constexpr std::uint32_t slots = 4;

class Frames final : public FrameAssembler::Owner {
 public:
    std::optional<FrameAssembler::Memory> begin_frame() override {
        if (memory_.size() == slots) return std::nullopt;
        auto bytes = std::make_unique<std::uint8_t[]>(payload);
        std::uint8_t* place = bytes.get();
        memory_.emplace(next_, std::move(bytes));
        return FrameAssembler::Memory{next_++, place};
    }
    void end_frame(const FrameAssembler::Frame& frame) override { give_back(frame.memory.slot); }
    void ask(const gvsp::PacketRange& range) override {
        if (range.first > range.last) std::abort();
        static_cast<void>(gvsp::resend_request(range, 1));
    }
    void give_back(std::uint32_t slot) {
        if (memory_.erase(slot) != 1) std::abort();  // of no frame that is open
    }
    bool all_are_back() const { return memory_.empty(); }

 private:
    std::map<std::uint32_t, std::unique_ptr<std::uint8_t[]>> memory_;
    std::uint32_t next_ = 0;
};

}  // namespace

/// Each message: how long after the one before it, in ms, and a packet. The first byte of all says
/// whether the camera sends again.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static_cast<void>(gvsp::udp_body({data, size}));
    fuzz::Messages messages({data, size});
    Frames frames;
    FrameAssembler assembler({payload, packet_size, (messages.byte() & 1U) != 0, milliseconds(100)},
                             frames);
    HostTime now{1};
    while (!messages.empty()) {
        now = now + milliseconds(messages.byte());
        assembler.take(messages.next(), now);
        assembler.advance(now);
        static_cast<void>(assembler.deadline(now));
        static_cast<void>(assembler.time_left(now));
    }
    for (const std::uint32_t slot : assembler.close()) frames.give_back(slot);
    if (!frames.all_are_back()) std::abort();
    return 0;
}
