// SPDX-License-Identifier: BSD-3-Clause
// Reads a camera's frames in place and prints the mean brightness with the time of the middle of
// the exposure.
#include <versavis/stream.hpp>

#include <cstdint>
#include <cstdio>
#include <numeric>

int main(int argc, char** argv) {
    auto stream = versavis::FrameStream::open(argc > 1 ? argv[1] : "cam0");
    if (!stream) {
        std::fprintf(stderr, "%s\n", stream.error().message().c_str());
        return 1;
    }
    for (;;) {
        const auto frame = stream->next(versavis::seconds(1));
        if (!frame) {
            std::fprintf(stderr, "%s\n", frame.error().message().c_str());
            continue;
        }
        const auto* pixels = reinterpret_cast<const std::uint8_t*>(frame->payload.data());
        const double sum = std::accumulate(pixels, pixels + frame->payload.size(), 0.0);
        if (!frame->valid()) continue;  // the writer needed the slot: forget what was read
        std::printf("%lld ns +- %u ns: mean brightness %.1f\n",
                    static_cast<long long>(frame->time.ns), frame->data.sigma_ns,
                    sum / static_cast<double>(frame->payload.size()));
    }
}
