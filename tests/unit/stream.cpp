// SPDX-License-Identifier: BSD-3-Clause
#include "versavis/stream.hpp"

#include <catch2/catch.hpp>
#include <memory>

#include "../support/temporary_directory.hpp"
#include "client/segment.hpp"
#include "engine/ring/writer.hpp"
#include "pixel_formats.hpp"

using namespace versavis;
using namespace versavis::ring;
using namespace versavis::test;

namespace {

constexpr std::uint32_t mono16 = 0x01100007;

struct Images {
    test::TemporaryDirectory directory{"/dev/shm"};
    Writer writer =
        *Writer::create(directory.path(), {"frames", StreamKind::frames, 8, 1, page_size});
    std::shared_ptr<const Mapping> mapping = std::make_shared<const Mapping>(
        *Mapping::open(directory.path() / "frames", Mapping::Access::read_only));

    std::optional<ImageView> image(std::uint32_t format, std::uint32_t width, std::uint32_t height,
                                   std::uint32_t stride, std::uint32_t bytes) const {
        FrameMetadata frame{};
        frame.pixel_format = format;
        frame.width = width;
        frame.height = height;
        frame.stride = stride;
        return image_of(frame, Payload(mapping, 0, 0, bytes));
    }
};

}  // namespace

TEST_CASE_METHOD(Images, "stream: an image has the numbers and the place of its frame") {
    const auto view = image(mono16, 5, 3, 12, 40);
    REQUIRE(view);
    CHECK(view->data == mapping->slot(0));
    CHECK(view->row(2) == mapping->slot(0) + 24);
    CHECK(view->width == 5);
    CHECK(view->height == 3);
    CHECK(view->stride == 12);
    CHECK(view->pixel_format == mono16);
    CHECK(view->layout.channels == 1);
    CHECK(view->layout.bytes_per_channel == 2);
}

TEST_CASE_METHOD(Images, "stream: an image is what fits its payload, and no byte more") {
    CHECK(image(mono8, 10, 4, 12, 48));
    CHECK_FALSE(image(mono8, 10, 4, 12, 47));
    CHECK(image(mono8, 1, 1, 1, 1));
    CHECK_FALSE(image(mono8, 1, 1, 1, 0));
    // A row is not longer than from row to row; of samples that are packed, nobody can say.
    for (const auto& [format, row] : {std::pair{mono8, 10U}, {mono16, 20U}, {rgb8, 30U}}) {
        CHECK(image(format, 10, 2, row, 100));
        CHECK_FALSE(image(format, 10, 2, row - 1, 100));
    }
    CHECK(image(mono12_packed, 10, 2, 15, 30));
}

TEST_CASE_METHOD(Images, "stream: numbers that are no image make none") {
    for (const std::uint32_t format : {mono8, mono12_packed}) {
        CHECK_FALSE(image(format, 0, 4, 12, 48));
        CHECK_FALSE(image(format, 10, 0, 12, 48));
        CHECK_FALSE(image(format, 10, 4, 0, 48));
    }
    // Each would fit if it were reckoned with 32 bits.
    CHECK_FALSE(image(mono8, 10, 0x10000, 0x10000, 48));
    CHECK_FALSE(image(mono16, 0x80000000, 1, 8, 48));
}
