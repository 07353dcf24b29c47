// SPDX-License-Identifier: BSD-3-Clause
// Looks at a camera's newest frame in place: its mean brightness, and the time of the middle of its
// exposure.
#include <versavis/stream.hpp>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>

namespace {

std::string sigma_text(std::uint32_t sigma_ns) {
    return sigma_ns == versavis::sigma_unknown ? "unknown" : std::to_string(sigma_ns) + " ns";
}

}  // namespace

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
        if ((frame->data.flags & versavis::flag_suspect) != 0) continue;  // its time is a guess
        const auto image = frame->image();
        if (!image || image->layout.bytes_per_channel != 1) continue;  // not 8 bits
        const std::size_t width = std::size_t{image->width} * image->layout.channels;
        double sum = 0;
        for (std::size_t y = 0; y < image->height; ++y)
            for (std::size_t x = 0; x < width; ++x)
                sum += static_cast<double>(image->data[y * image->stride + x]);
        if (!frame->valid()) continue;  // the writer needed the slot: forget what was read
        std::printf("%lld ns +- %s: mean brightness %.1f\n", static_cast<long long>(frame->time.ns),
                    sigma_text(frame->data.sigma_ns).c_str(),
                    sum / static_cast<double>(width * image->height));
        if (std::fflush(stdout) != 0) return 1;  // nobody reads on, or the disk is full
    }
}
