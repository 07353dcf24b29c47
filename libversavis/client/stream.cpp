// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/stream.hpp"

#include <algorithm>
#include <system_error>

#include "client/error_code.hpp"

namespace versavis {

std::optional<ImageView> image_of(const FrameMetadata& frame, const ring::Payload& payload) {
    const PixelLayout layout = pixel_layout(frame.pixel_format);
    const std::uint64_t row =
        std::uint64_t{frame.width} * layout.channels * layout.bytes_per_channel;
    if (frame.width == 0 || frame.height == 0 || frame.stride == 0 || row > frame.stride ||
        std::uint64_t{frame.stride} * frame.height > payload.size())
        return std::nullopt;
    return ImageView{payload.data(), frame.width,        frame.height,
                     frame.stride,   frame.pixel_format, layout};
}

namespace {

StreamInfo info_of(const std::filesystem::path& path, const StreamOptions& options) {
    StreamInfo info;
    info.name = path.filename().string();
    auto reader = ring::Reader::open(path, options);
    if (!reader) {
        info.error = reader.error();
        return info;
    }
    info.kind = reader->kind();
    info.published = reader->head();
    info.retained = reader->retained();
    info.alive = reader->writer_alive();
    return info;
}

}  // namespace

Expected<std::vector<StreamInfo>> list_streams(const StreamOptions& options) {
    const auto directory = instance_directory(options.instance);
    std::error_code error;
    std::vector<std::filesystem::path> paths;
    for (std::filesystem::directory_iterator entry(directory, error), end; entry != end && !error;
         entry.increment(error))
        if (is_stream_name(entry->path().filename().string())) paths.push_back(entry->path());
    if (error)
        return failure(ring::code_of(error.value()), directory.string(), error.message(),
                       "is versavisd running, and is this its instance?");
    std::sort(paths.begin(), paths.end());
    StreamOptions at_once = options;
    at_once.wait = {};
    std::vector<StreamInfo> streams;
    for (const auto& path : paths) streams.push_back(info_of(path, at_once));
    return streams;
}

}  // namespace versavis
