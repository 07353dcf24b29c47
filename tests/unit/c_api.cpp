// SPDX-License-Identifier: BSD-3-Clause
#include <poll.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "../support/temporary_directory.hpp"
#include "engine/ring/writer.hpp"
#include "versavis.h"
#include "versavis/metadata.hpp"

using namespace versavis;

namespace {

struct CApi {
    test::TemporaryDirectory directory{"/dev/shm"};
    std::string instance = std::filesystem::relative(directory.path(), "/dev/shm/versavis");
    std::unique_ptr<ring::Writer> camera = make("cam0");

    std::unique_ptr<ring::Writer> make(const std::string& name) const {
        return std::make_unique<ring::Writer>(
            *ring::Writer::create(directory.path(), {name, ring::StreamKind::frames, 16, 4, 4096}));
    }
    static void frame(ring::Writer& writer, std::uint64_t tick, std::uint8_t fill = 0) {
        FrameMetadata metadata{};
        metadata.set_tick(tick);
        metadata.trigger = tick + 1;
        metadata.width = 10;
        metadata.height = 4;
        metadata.stride = 12;
        metadata.pixel_format = 0x01080001;
        metadata.sigma_ns = 77;
        metadata.epoch = 1;
        const auto slot = writer.acquire();
        REQUIRE(slot);
        std::memset(writer.slot_data(*slot), fill, 48);
        writer.publish(*slot, 48, OutputTime{static_cast<std::int64_t>(1000 + tick)},
                       pack(metadata));
    }
    versavis_stream* open(const versavis_options* options = nullptr) const {
        versavis_stream* stream = nullptr;
        versavis_error error{};
        REQUIRE(versavis_open(instance.c_str(), "cam0", options, &stream, &error) == VERSAVIS_OK);
        return stream;
    }
};

}  // namespace

TEST_CASE_METHOD(CApi, "c_api: a frame, its numbers, its pixels") {
    versavis_stream* stream = open();
    CHECK(versavis_stream_kind(stream) == VERSAVIS_FRAMES);
    CHECK(versavis_stream_name(stream) == std::string("cam0"));
    versavis_item item = VERSAVIS_ITEM_INIT;
    CHECK(versavis_next(stream, &item, 0) == VERSAVIS_NOTHING);
    CHECK(versavis_next(stream, &item, 1'000'000) == VERSAVIS_NOTHING);
    CHECK(versavis_valid(&item) == 0);
    frame(*camera, (std::uint64_t{3} << 32U) + 9, 5);
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    CHECK(item.kind == VERSAVIS_FRAMES);
    CHECK(item.data.frame.tick_low == 9);
    CHECK(item.data.frame.tick_high == 3);
    CHECK(item.data.frame.sigma == 77);
    CHECK(item.life != 0);
    CHECK(item.stale == 0);
    versavis_image image{};
    REQUIRE(versavis_view(&item, &image) == VERSAVIS_OK);
    CHECK(image.width == 10);
    CHECK(image.stride == 12);
    CHECK(image.channels == 1);
    CHECK(image.data[3 * 12 + 9] == 5);
    CHECK(versavis_pixel_format_name(image.pixel_format) == std::string("Mono8"));
    std::vector<std::uint8_t> copy(48);
    CHECK(versavis_copy(&item, copy.data(), 47) == VERSAVIS_INVALID);
    CHECK(versavis_copy(&item, copy.data(), 48) == VERSAVIS_OK);
    CHECK(copy == std::vector<std::uint8_t>(48, 5));
    CHECK(versavis_valid(&item) == 1);
    for (std::uint64_t tick = 20; tick < 25; ++tick) frame(*camera, tick);
    CHECK(versavis_valid(&item) == 0);
    CHECK(versavis_copy(&item, copy.data(), 48) == VERSAVIS_OVERTAKEN);
    CHECK(versavis_next(stream, &item, 0) == VERSAVIS_LOST);
    CHECK(item.lost > 0);
    CHECK(item.payload == nullptr);
    CHECK(versavis_latest(stream, &item, 0) == VERSAVIS_OK);
    CHECK(item.time == 1024);
    versavis_release(&item);
    versavis_close(stream);
}

TEST_CASE_METHOD(CApi, "c_api: an item outlives its stream and its service") {
    versavis_stream* stream = open();
    frame(*camera, 1, 9);
    versavis_item item = VERSAVIS_ITEM_INIT;
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    versavis_item second = VERSAVIS_ITEM_INIT;
    camera.reset();
    CHECK(versavis_next(stream, &second, 10'000'000'000) == VERSAVIS_GONE);
    camera = make("cam0");
    CHECK(versavis_next(stream, &second, 10'000'000'000) == VERSAVIS_RESTARTED);
    versavis_close(stream);
    CHECK(static_cast<const std::uint8_t*>(item.payload)[47] == 9);
    CHECK(versavis_valid(&item) == 1);
    versavis_release(&item);
    versavis_release(&item);
    versavis_release(&second);
    CHECK(versavis_valid(&item) == 0);
}

TEST_CASE_METHOD(CApi, "c_api: where reading begins is its choice") {
    for (std::uint64_t tick = 1; tick <= 3; ++tick) frame(*camera, tick);
    versavis_options options = VERSAVIS_OPTIONS_INIT;
    options.start = VERSAVIS_OLDEST;
    versavis_stream* stream = open(&options);
    versavis_item item = VERSAVIS_ITEM_INIT;
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    CHECK(item.time == 1001);
    CHECK(versavis_seek(stream, VERSAVIS_LATEST) == VERSAVIS_OK);
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    CHECK(item.time == 1003);
    CHECK(versavis_seek_time(stream, 1002) == VERSAVIS_OK);
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    CHECK(item.time == 1002);
    CHECK(versavis_seek(stream, 9) == VERSAVIS_INVALID);
    versavis_release(&item);
    versavis_close(stream);
}

TEST_CASE_METHOD(CApi, "c_api: what cannot be opened says why and what to do") {
    versavis_error error{};
    versavis_stream* stream = nullptr;
    CHECK(versavis_open(instance.c_str(), "none", nullptr, &stream, &error) == VERSAVIS_ERROR);
    CHECK_THAT(error.message,
               Catch::Contains("no such stream") && Catch::Contains("versavis list"));
    CHECK(stream == nullptr);
    versavis_options odd = VERSAVIS_OPTIONS_INIT;
    odd.start = 77;
    CHECK(versavis_open(instance.c_str(), "cam0", &odd, &stream, &error) == VERSAVIS_INVALID);
    odd = VERSAVIS_OPTIONS_INIT;
    odd.owner = 12345;
    CHECK(versavis_open(instance.c_str(), "cam0", &odd, &stream, &error) == VERSAVIS_ERROR);
    CHECK_THAT(error.message, Catch::Contains("belongs to user"));
    odd = VERSAVIS_OPTIONS_INIT;
    odd.sealed_only = 1;
    CHECK(versavis_open(instance.c_str(), "cam0", &odd, &stream, &error) == VERSAVIS_ERROR);
    CHECK_THAT(error.message, Catch::Contains("is not sealed"));
    for (const char* name : {"", "/etc/passwd", "../default/cam0", ".lock"}) {
        CHECK(versavis_open(instance.c_str(), name, nullptr, &stream, &error) == VERSAVIS_ERROR);
        CHECK_THAT(error.message, Catch::Contains("not a name"));
    }
    CHECK(versavis_open(instance.c_str(), std::string(2000, 'x').c_str(), nullptr, &stream,
                        &error) == VERSAVIS_ERROR);
    CHECK(std::strlen(error.message) < sizeof error.message);
}

TEST_CASE("c_api: NULL is refused, not followed") {
    versavis_stream* stream = nullptr;
    versavis_item item = VERSAVIS_ITEM_INIT;
    versavis_image image{};
    versavis_set set = VERSAVIS_SET_INIT;
    CHECK(versavis_open(nullptr, nullptr, nullptr, &stream, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_open(nullptr, "cam0", nullptr, nullptr, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_next(nullptr, &item, 0) == VERSAVIS_INVALID);
    CHECK(versavis_latest(nullptr, &item, 0) == VERSAVIS_INVALID);
    CHECK(versavis_seek(nullptr, VERSAVIS_NEXT) == VERSAVIS_INVALID);
    CHECK(versavis_seek_time(nullptr, 0) == VERSAVIS_INVALID);
    CHECK(versavis_fd(nullptr, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_valid(nullptr) == 0);
    CHECK(versavis_copy(nullptr, nullptr, 0) == VERSAVIS_INVALID);
    CHECK(versavis_copy(&item, nullptr, 0) == VERSAVIS_INVALID);
    CHECK(versavis_view(&item, &image) == VERSAVIS_INVALID);
    CHECK(versavis_stream_kind(nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_stream_name(nullptr) == std::string());
    CHECK(versavis_wait_set_add(nullptr, nullptr, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_wait_set_wait(nullptr, 0) == VERSAVIS_INVALID);
    CHECK(versavis_wait_set_fd(nullptr, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_sets_next(nullptr, &set, 0) == VERSAVIS_INVALID);
    CHECK(versavis_sets_fd(nullptr, nullptr) == VERSAVIS_INVALID);
    versavis_release(nullptr);
    versavis_close(nullptr);
    versavis_sets_close(nullptr);
    versavis_set_release(nullptr);
    versavis_wait_set_free(nullptr);
    for (int result = -4; result < 8; ++result)
        CHECK(std::strlen(versavis_result_text(result)) > 0);
}

TEST_CASE_METHOD(CApi, "c_api: several streams in one wait, and by descriptors [threads]",
                 "[threads]") {
    const auto other = make("cam1");
    versavis_stream* first = open();
    versavis_stream* second = nullptr;
    REQUIRE(versavis_open(instance.c_str(), "cam1", nullptr, &second, nullptr) == VERSAVIS_OK);
    versavis_wait_set* set = versavis_wait_set_new();
    CHECK(versavis_wait_set_add(set, first, nullptr) == VERSAVIS_OK);
    CHECK(versavis_wait_set_add(set, second, nullptr) == VERSAVIS_OK);
    CHECK(versavis_wait_set_wait(set, 0) == -1);
    frame(*other, 4);
    CHECK(versavis_wait_set_wait(set, 10'000'000'000) == 1);
    CHECK(versavis_wait_set_fd(set, nullptr) >= 0);
    pollfd entry{versavis_fd(second, nullptr), POLLIN, 0};
    CHECK(::poll(&entry, 1, 20'000) == 1);
    versavis_wait_set_free(set);
    versavis_close(first);
    versavis_close(second);
}

TEST_CASE_METHOD(CApi, "c_api: samples between two instants") {
    ring::Writer imu = *ring::Writer::create(directory.path(), {"imu0", ring::StreamKind::imu, 64});
    ImuMetadata sample{};
    for (std::int64_t i = 0; i < 5; ++i) {
        sample.number = static_cast<std::uint64_t>(i == 3 ? i + 1 : i);
        imu.publish(OutputTime{1000 + i}, pack(sample));
    }
    versavis_imu_window* window = nullptr;
    versavis_error error{};
    REQUIRE(versavis_imu_window_open(instance.c_str(), "imu0", nullptr, &window, &error) ==
            VERSAVIS_OK);
    versavis_imu_span span{};
    REQUIRE(versavis_imu_window_between(window, 1000, 1002, 0, &span) == VERSAVIS_OK);
    REQUIRE(span.count == 2);
    CHECK(span.samples[1].time == 1002);
    CHECK(span.covered == 1);
    CHECK(span.lost == 1);  // up to the one beyond
    CHECK(span.has_beyond == 1);
    CHECK(span.beyond.data.number == 4);
    REQUIRE(versavis_imu_window_between(window, 1002, 2000, 0, &span) == VERSAVIS_OK);
    CHECK(span.count == 2);
    CHECK(span.covered == 0);
    CHECK(span.has_beyond == 0);
    CHECK(versavis_imu_window_between(window, 2, 1, 0, &span) == VERSAVIS_INVALID);
    CHECK(versavis_imu_window_between(nullptr, 1, 2, 0, &span) == VERSAVIS_INVALID);
    versavis_imu_window_close(window);
    CHECK(versavis_imu_window_open(instance.c_str(), "cam0", nullptr, &window, &error) ==
          VERSAVIS_ERROR);
    CHECK_THAT(error.message, Catch::Contains("another kind"));
    CHECK(versavis_imu_window_open(instance.c_str(), nullptr, nullptr, &window, &error) ==
          VERSAVIS_INVALID);
}

TEST_CASE_METHOD(CApi, "c_api: sets of frames with the samples between them") {
    const auto other = make("cam1");
    ring::Writer imu = *ring::Writer::create(directory.path(), {"imu0", ring::StreamKind::imu, 64});
    const char* const cameras[] = {"cam0", "cam1"};
    versavis_sets_options options = VERSAVIS_SETS_OPTIONS_INIT;
    options.imu = "imu0";
    options.patience = 60'000'000'000;
    versavis_sets* sets = nullptr;
    versavis_error error{};
    REQUIRE(versavis_sets_open(instance.c_str(), cameras, 2, &options, &sets, &error) ==
            VERSAVIS_OK);
    versavis_set set = VERSAVIS_SET_INIT;
    CHECK(versavis_sets_next(sets, &set, 0) == VERSAVIS_NOTHING);
    ImuMetadata sample{};
    sample.gyro[1] = 0.5F;
    for (std::int64_t i = 0; i < 5; ++i) {
        sample.number = static_cast<std::uint64_t>(i + 1);
        imu.publish(OutputTime{1000 + i}, pack(sample));
    }
    frame(*camera, 3, 1);
    frame(*other, 3, 2);
    REQUIRE(versavis_sets_next(sets, &set, 0) == VERSAVIS_OK);
    CHECK(set.tick == 3);
    CHECK(set.present == 3);
    CHECK(set.spread == 0);
    CHECK(static_cast<const std::uint8_t*>(set.frames[1].payload)[0] == 2);
    CHECK(versavis_valid(&set.frames[0]) == 1);
    CHECK(set.imu_count == 0);  // there was no set before
    frame(*camera, 4);
    frame(*other, 4);
    REQUIRE(versavis_sets_next(sets, &set, 0) == VERSAVIS_OK);
    REQUIRE(set.imu_count == 1);
    CHECK(set.imu[0].time == 1004);
    CHECK(set.imu[0].data.gyro[1] == 0.5F);
    versavis_set_report report{};
    CHECK(versavis_sets_report(sets, &report) == VERSAVIS_OK);
    CHECK(report.sets == 2);
    CHECK(set.imu_covered == 1);
    CHECK(versavis_sets_fd(sets, nullptr) >= 0);
    CHECK(versavis_sets_next(sets, &set, 0) == VERSAVIS_NOTHING);
    CHECK(set.present == 0);
    versavis_set_release(&set);
    versavis_sets_close(sets);
    CHECK(versavis_sets_open(instance.c_str(), cameras, 17, &options, &sets, &error) ==
          VERSAVIS_INVALID);
}
