// SPDX-License-Identifier: BSD-3-Clause
// Looks at a camera's newest frame in place: its mean brightness, and the time of the middle of its
// exposure.
#include <versavis/stream.hpp>

#include <cstddef>
#include <cstdio>

int main(int argc, char** argv) {
    auto stream = versavis::FrameStream::open(argc > 1 ? argv[1] : "cam0");
    if (!stream) {
        std::fprintf(stderr, "%s\n", stream.error().message().c_str());
        return 1;
    }
    for (;;) {
        const auto frame = stream->latest(versavis::seconds(1));
        if (!frame) {
            std::fprintf(stderr, "%s\n", frame.error().message().c_str());
            continue;
        }
        const auto image = frame->image();
        if (!image || image->layout.bytes_per_channel != 1) continue;  // not 8 bits
        const std::size_t width = std::size_t{image->width} * image->layout.channels;
        double sum = 0;
        for (std::size_t y = 0; y < image->height; ++y)
            for (std::size_t x = 0; x < width; ++x)
                sum += static_cast<double>(image->data[y * image->stride + x]);
        if (!frame->valid()) continue;  // the writer needed the slot: forget what was read
        std::printf("%lld ns +- %u ns: mean brightness %.1f\n",
                    static_cast<long long>(frame->time.ns), frame->data.sigma_ns,
                    sum / static_cast<double>(width * image->height));
    }
}
