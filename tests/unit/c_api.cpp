// SPDX-License-Identifier: BSD-3-Clause
#include <poll.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "../support/in_process.hpp"
#include "../support/temporary_directory.hpp"
#include "client/segment.hpp"
#include "engine/ring/writer.hpp"
#include "versavis.h"
#include "versavis/metadata.hpp"

using namespace versavis;

namespace {

struct CApi {
    test::TemporaryDirectory directory{"/dev/shm"};
    std::string instance = test::instance_in(directory.path());
    std::unique_ptr<ring::Writer> camera = make("cam0");

    std::unique_ptr<ring::Writer> make(const std::string& name,
                                       ring::StreamKind kind = ring::StreamKind::frames) const {
        return std::make_unique<ring::Writer>(
            *ring::Writer::create(directory.path(), {name, kind, 16, 4, 4096}));
    }
    static void frame(ring::Writer& writer, std::uint64_t tick, std::uint8_t fill = 0,
                      std::uint32_t size = 48, std::int64_t late = 0, std::uint32_t flags = 0) {
        FrameMetadata metadata{};
        metadata.flags = flags;
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
        std::memset(writer.slot_data(*slot), fill, size);
        writer.publish(*slot, size, OutputTime{static_cast<std::int64_t>(1000 + tick) + late},
                       pack(metadata));
    }
    ring::Writer make_events() const {
        return *ring::Writer::create(directory.path(), {"events", ring::StreamKind::events, 16});
    }
    ring::Writer make_imu() const {
        return *ring::Writer::create(directory.path(), {"imu0", ring::StreamKind::imu, 64});
    }
    /// A sample for each of these times, with its number.
    static void samples(ring::Writer& imu, std::int64_t first, std::int64_t last,
                        std::uint64_t number) {
        ImuMetadata sample{};
        sample.epoch = 1;
        for (std::int64_t time = first; time <= last; ++time) {
            sample.number = number++;
            imu.publish(OutputTime{time}, pack(sample));
        }
    }
    /// An instant of the stream's life.
    versavis_time at(const char* name, std::int64_t ns, std::uint32_t epoch) const {
        const auto ring =
            ring::Mapping::open(directory.path() / name, ring::Mapping::Access::read_only);
        REQUIRE(ring);
        return {ring->constants().life, ns, epoch, 0};
    }
    versavis_stream* open(const versavis_options* options = nullptr,
                          const char* name = "cam0") const {
        versavis_stream* stream = nullptr;
        versavis_error error{};
        REQUIRE(versavis_open(instance.c_str(), name, options, &stream, &error) == VERSAVIS_OK);
        return stream;
    }
    versavis_sets* open_sets(const versavis_sets_options* options) const {
        const char* const cameras[] = {"cam0", "cam1"};
        versavis_sets* sets = nullptr;
        REQUIRE(versavis_sets_open(instance.c_str(), cameras, 2, options, &sets, nullptr) ==
                VERSAVIS_OK);
        return sets;
    }
    /// How many mappings this process has of rings of the instance.
    std::size_t mapped() const {
        std::ifstream maps("/proc/self/maps");
        std::size_t found = 0;
        for (std::string line; std::getline(maps, line);)
            found += line.find(directory.path().string()) != std::string::npos ? 1 : 0;
        return found;
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
    CHECK(item.time.life != 0);
    CHECK(item.stale == 0);
    versavis_image image = VERSAVIS_IMAGE_INIT;
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
    CHECK(item.time.ns == 1024);
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

TEST_CASE_METHOD(CApi, "c_api: what an item held is let go by the next, a pause, or its release") {
    const std::size_t before = mapped();
    versavis_stream* stream = open();
    versavis_item item = VERSAVIS_ITEM_INIT;
    for (std::uint64_t number = 0; number < 2; ++number) {
        frame(*camera, 1, 9);
        REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
        CHECK(item.number == number);
        CHECK(item.payload_size == 48);
    }
    const auto is_empty = [&] {
        return item.payload == nullptr && item.payload_size == 0 && versavis_valid(&item) == 0;
    };
    CHECK(versavis_next(stream, &item, -1) == VERSAVIS_NOTHING);
    CHECK(is_empty());
    CHECK((item.number == 0 && item.time.ns == 0 && item.kind == 0 && item.lost == 0));
    frame(*camera, 2, 9);
    REQUIRE(versavis_latest(stream, &item, -1) == VERSAVIS_OK);
    CHECK(versavis_latest(stream, &item, -1) == VERSAVIS_NOTHING);
    for (std::uint64_t tick = 3; tick < 30; ++tick) frame(*camera, tick);
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_LOST);
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    CHECK(item.lost == 0);
    versavis_close(stream);
    CHECK(mapped() == before + 1);
    versavis_image image = VERSAVIS_IMAGE_INIT;
    CHECK(versavis_view(&item, &image) == VERSAVIS_OK);
    versavis_release(&item);
    CHECK(mapped() == before);
    CHECK(is_empty());
    CHECK(versavis_view(&item, &image) == VERSAVIS_INVALID);
}

TEST_CASE_METHOD(CApi, "c_api: a frame says gain and temperature, or that they are not known") {
    versavis_stream* stream = open();
    versavis_item item = VERSAVIS_ITEM_INIT;
    versavis_sensor_state state = VERSAVIS_SENSOR_STATE_INIT;
    CHECK(versavis_sensor(&item, &state) == VERSAVIS_INVALID);
    frame(*camera, 1);
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    CHECK(versavis_sensor(&item, &state) == VERSAVIS_OK);
    CHECK(std::isnan(state.gain));
    CHECK(std::isnan(state.temperature));
    camera->publish(*camera->acquire(), 48, OutputTime{1002}, {}, pack(SensorState{6.5F, 41}));
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    CHECK(versavis_sensor(&item, &state) == VERSAVIS_OK);
    CHECK(state.gain == 6.5F);
    CHECK(state.temperature == 41);
    CHECK(versavis_sensor(&item, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_sensor(nullptr, &state) == VERSAVIS_INVALID);
    for (std::uint64_t tick = 3; tick < 30; ++tick) frame(*camera, tick);
    CHECK(versavis_sensor(&item, &state) == VERSAVIS_OVERTAKEN);
    versavis_release(&item);
    versavis_close(stream);
}

TEST_CASE_METHOD(CApi, "c_api: an item without payload is whole, and a copy of nothing") {
    ring::Writer events = make_events();
    versavis_stream* stream = open(nullptr, "events");
    CHECK(versavis_stream_kind(stream) == VERSAVIS_EVENTS);
    EventMetadata event{};
    event.kind = EventKind::pps;
    event.value = 7;
    events.publish(OutputTime{5}, pack(event));
    versavis_item item = VERSAVIS_ITEM_INIT;
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    CHECK(item.kind == VERSAVIS_EVENTS);
    CHECK(item.data.event.value == 7);
    CHECK(versavis_event_name(item.data.event.kind) == std::string("pps"));
    CHECK(item.payload == nullptr);
    CHECK(item.payload_size == 0);
    CHECK(versavis_valid(&item) == 1);
    CHECK(versavis_copy(&item, nullptr, 0) == VERSAVIS_OK);
    versavis_image image = VERSAVIS_IMAGE_INIT;
    CHECK(versavis_view(&item, &image) == VERSAVIS_INVALID);
    versavis_release(&item);
    versavis_close(stream);
}

TEST_CASE_METHOD(CApi,
                 "c_api: a frame of a byte is copied to where there is room, and is no image") {
    versavis_stream* stream = open();
    frame(*camera, 1, 9, 1);
    versavis_item item = VERSAVIS_ITEM_INIT;
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    std::uint8_t byte = 0;
    CHECK(versavis_copy(&item, nullptr, 1) == VERSAVIS_INVALID);
    CHECK(versavis_copy(&item, &byte, 0) == VERSAVIS_INVALID);
    CHECK(versavis_copy(&item, &byte, 1) == VERSAVIS_OK);
    CHECK(byte == 9);
    versavis_image image = VERSAVIS_IMAGE_INIT;
    CHECK(versavis_view(&item, &image) == VERSAVIS_INVALID);
    versavis_release(&item);
    versavis_close(stream);
}

TEST_CASE_METHOD(CApi, "c_api: a document is no image, whatever its words are") {
    const auto status = make("status", ring::StreamKind::status);
    versavis_stream* stream = open(nullptr, "status");
    frame(*status, 1);
    versavis_item item = VERSAVIS_ITEM_INIT;
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    CHECK(item.kind == VERSAVIS_STATUS);
    versavis_image image = VERSAVIS_IMAGE_INIT;
    CHECK(versavis_view(&item, &image) == VERSAVIS_INVALID);
    versavis_release(&item);
    versavis_close(stream);
}

TEST_CASE_METHOD(CApi, "c_api: what is read of a service that has ended is stale") {
    versavis_stream* stream = open();
    frame(*camera, 1);
    camera.reset();
    versavis_item item = VERSAVIS_ITEM_INIT;
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    CHECK(item.stale == 1);
    versavis_release(&item);
    versavis_close(stream);
}

TEST_CASE_METHOD(CApi, "c_api: each place in a stream, to begin with, to go to, and after a loss") {
    ring::Writer events = make_events();
    const std::uint32_t places[] = {VERSAVIS_DEFAULT, VERSAVIS_NEXT, VERSAVIS_LATEST,
                                    VERSAVIS_MIDDLE, VERSAVIS_OLDEST};
    std::vector<versavis_stream*> slow;
    for (const std::uint32_t place : places) {
        versavis_options options = VERSAVIS_OPTIONS_INIT;
        options.after_loss = place;
        slow.push_back(open(&options, "events"));
    }
    for (std::int64_t time = 0; time < 40; ++time) events.publish(OutputTime{time}, {});
    versavis_item item = VERSAVIS_ITEM_INIT;
    const std::int64_t none = -1;
    const auto next_of = [&](versavis_stream* stream) {
        return versavis_next(stream, &item, 0) == VERSAVIS_OK ? item.time.ns : none;
    };
    std::vector<std::int64_t> begun;
    std::vector<std::int64_t> sought;
    std::vector<std::int64_t> after_loss;
    for (const std::uint32_t place : places) {
        versavis_options options = VERSAVIS_OPTIONS_INIT;
        options.start = place;
        versavis_stream* stream = open(&options, "events");
        begun.push_back(next_of(stream));
        CHECK(versavis_seek(stream, place) == VERSAVIS_OK);
        sought.push_back(next_of(stream));
        versavis_close(stream);
        CHECK(versavis_next(slow[place], &item, 0) == VERSAVIS_LOST);
        const auto lost = static_cast<std::int64_t>(item.lost);
        after_loss.push_back(next_of(slow[place]));
        CHECK(lost == (after_loss.back() == none ? 40 : after_loss.back()));
        versavis_close(slow[place]);
    }
    CHECK(begun == sought);
    CHECK(begun[VERSAVIS_DEFAULT] == none);
    CHECK(begun[VERSAVIS_NEXT] == none);
    CHECK(begun[VERSAVIS_LATEST] == 39);
    CHECK(begun[VERSAVIS_MIDDLE] < 39);
    CHECK(begun[VERSAVIS_OLDEST] < begun[VERSAVIS_MIDDLE]);
    CHECK(begun[VERSAVIS_OLDEST] >= 40 - 16);
    CHECK(after_loss[VERSAVIS_DEFAULT] == begun[VERSAVIS_MIDDLE]);
    for (const std::uint32_t place :
         {VERSAVIS_NEXT, VERSAVIS_LATEST, VERSAVIS_MIDDLE, VERSAVIS_OLDEST})
        CHECK(after_loss[place] == begun[place]);
    versavis_release(&item);
}

TEST_CASE_METHOD(CApi, "c_api: without an instance it is that of the environment") {
    CHECK(test::in_process([&] {
        ::setenv("VERSAVIS_INSTANCE", instance.c_str(), 1);
        versavis_stream* stream = nullptr;
        return versavis_open(nullptr, "cam0", nullptr, &stream, nullptr) == VERSAVIS_OK;
    }));
}

TEST_CASE_METHOD(CApi, "c_api: where reading begins is its choice") {
    for (std::uint64_t tick = 1; tick <= 3; ++tick) frame(*camera, tick);
    versavis_options options = VERSAVIS_OPTIONS_INIT;
    options.start = VERSAVIS_OLDEST;
    versavis_stream* stream = open(&options);
    versavis_item item = VERSAVIS_ITEM_INIT;
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    CHECK(item.time.ns == 1001);
    CHECK(versavis_seek(stream, VERSAVIS_LATEST) == VERSAVIS_OK);
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    CHECK(item.time.ns == 1003);
    versavis_time time = item.time;
    time.ns = 1002;
    CHECK(versavis_seek_time(stream, &time) == VERSAVIS_OK);
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    CHECK(item.time.ns == 1002);
    ++time.life;
    CHECK(versavis_seek_time(stream, &time) == VERSAVIS_OTHER_EPOCH);
    CHECK(versavis_seek_time(stream, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_seek(stream, 9) == VERSAVIS_INVALID);
    versavis_release(&item);
    versavis_close(stream);
}

TEST_CASE_METHOD(CApi, "c_api: what cannot be opened says why and what to do") {
    versavis_error error{};
    versavis_stream* const before = open();
    versavis_stream* stream = before;
    CHECK(versavis_open(instance.c_str(), "none", nullptr, &stream, nullptr) == VERSAVIS_ABSENT);
    CHECK(versavis_open(instance.c_str(), "none", nullptr, &stream, &error) == VERSAVIS_ABSENT);
    CHECK_THAT(error.message,
               Catch::Contains("no such stream") && Catch::Contains("versavis list"));
    CHECK(stream == nullptr);
    versavis_close(before);
    versavis_options odd = VERSAVIS_OPTIONS_INIT;
    odd.start = 77;
    CHECK(versavis_open(instance.c_str(), "cam0", &odd, &stream, &error) == VERSAVIS_INVALID);
    CHECK_THAT(error.message, Catch::Contains("is not a position"));
    odd = VERSAVIS_OPTIONS_INIT;
    odd.after_loss = 5;
    CHECK(versavis_open(instance.c_str(), "cam0", &odd, &stream, &error) == VERSAVIS_INVALID);
    odd = VERSAVIS_OPTIONS_INIT;
    odd.owner = 12345;
    CHECK(versavis_open(instance.c_str(), "cam0", &odd, &stream, &error) == VERSAVIS_NOT_TRUSTED);
    CHECK_THAT(error.message, Catch::Contains("belongs to user"));
    odd = VERSAVIS_OPTIONS_INIT;
    odd.sealed_only = 1;
    CHECK(versavis_open(instance.c_str(), "cam0", &odd, &stream, &error) == VERSAVIS_NOT_TRUSTED);
    CHECK_THAT(error.message, Catch::Contains("is not sealed"));
    for (const char* name : {"", "/etc/passwd", "../default/cam0", ".lock"}) {
        CHECK(versavis_open(instance.c_str(), name, nullptr, &stream, &error) == VERSAVIS_INVALID);
        CHECK_THAT(error.message, Catch::Contains("not a name"));
    }
    struct {
        versavis_error error;
        char behind[8];
    } room{};
    std::memset(&room, 'r', sizeof room);
    CHECK(versavis_open(instance.c_str(), std::string(2000, 'x').c_str(), nullptr, &stream,
                        &room.error) == VERSAVIS_ERROR);
    CHECK(std::string(room.error.message).size() == sizeof error.message - 1);
    CHECK(std::string(room.behind, sizeof room.behind) == "rrrrrrrr");
}

TEST_CASE_METHOD(CApi, "c_api: root is an owner, too") {
    if (::geteuid() == 0) {
        REQUIRE(::chown(directory.path().c_str(), 12345, 12345) == 0);
        REQUIRE(::chown((directory.path() / "cam0").c_str(), 12345, 12345) == 0);
    }
    versavis_options options = VERSAVIS_OPTIONS_INIT;
    options.owner = 0;
    versavis_stream* stream = nullptr;
    versavis_error error{};
    CHECK(versavis_open(instance.c_str(), "cam0", &options, &stream, &error) ==
          VERSAVIS_NOT_TRUSTED);
    CHECK_THAT(error.message, Catch::Contains("not to user 0"));
}

TEST_CASE_METHOD(CApi, "c_api: where memory is short, that is what is reported", "[kernel]") {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    return;  // there, a program ends that asks for too much
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
    return;
#endif
#endif
    const std::string large(std::size_t{1} << 26U, 'x');
    CHECK(test::in_process([&] {
        const rlimit none{0, 0};
        versavis_stream* stream = nullptr;
        versavis_error error{};
        return ::setrlimit(RLIMIT_AS, &none) == 0 &&
               versavis_open(instance.c_str(), large.c_str(), nullptr, &stream, &error) ==
                   VERSAVIS_NO_MEMORY &&
               error.message[0] != '\0';
    }));
}

TEST_CASE("c_api: NULL is refused, not followed") {
    std::uint32_t which = 0;
    versavis_stream* stream = nullptr;
    versavis_item item = VERSAVIS_ITEM_INIT;
    versavis_image image = VERSAVIS_IMAGE_INIT;
    versavis_set set = VERSAVIS_SET_INIT;
    versavis_error error{};
    CHECK(versavis_open(nullptr, nullptr, nullptr, &stream, &error) == VERSAVIS_INVALID);
    CHECK_THAT(error.message, Catch::Contains("is NULL"));
    CHECK(versavis_open(nullptr, "cam0", nullptr, nullptr, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_next(nullptr, &item, 0) == VERSAVIS_INVALID);
    CHECK(versavis_latest(nullptr, &item, 0) == VERSAVIS_INVALID);
    CHECK(versavis_seek(nullptr, VERSAVIS_NEXT) == VERSAVIS_INVALID);
    CHECK(versavis_seek_time(nullptr, &item.time) == VERSAVIS_INVALID);
    CHECK(versavis_fd(nullptr, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_valid(nullptr) == 0);
    CHECK(versavis_copy(nullptr, nullptr, 0) == VERSAVIS_INVALID);
    CHECK(versavis_copy(&item, nullptr, 0) == VERSAVIS_INVALID);
    CHECK(versavis_view(&item, &image) == VERSAVIS_INVALID);
    CHECK(versavis_stream_kind(nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_stream_name(nullptr) == std::string());
    CHECK(versavis_wait_set_add(nullptr, nullptr, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_wait_set_wait(nullptr, 0, &which) == VERSAVIS_INVALID);
    CHECK(versavis_wait_set_fd(nullptr, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_sets_next(nullptr, &set, 0) == VERSAVIS_INVALID);
    CHECK(versavis_sets_fd(nullptr, nullptr) == VERSAVIS_INVALID);
    versavis_release(nullptr);
    versavis_close(nullptr);
    versavis_sets_close(nullptr);
    versavis_set_release(nullptr);
    versavis_wait_set_free(nullptr);
}

TEST_CASE_METHOD(CApi, "c_api: NULL beside what is not is refused, too") {
    const auto imu = make_imu();
    const auto other = make("cam1");
    versavis_stream* stream = open();
    versavis_wait_set* waiting = versavis_wait_set_new();
    versavis_sets* sets = open_sets(nullptr);
    versavis_imu_window* window = nullptr;
    REQUIRE(versavis_imu_window_open(instance.c_str(), "imu0", nullptr, &window, nullptr) ==
            VERSAVIS_OK);
    versavis_item item = VERSAVIS_ITEM_INIT;
    frame(*camera, 1);
    CHECK(versavis_next(stream, nullptr, 0) == VERSAVIS_INVALID);
    CHECK(versavis_latest(stream, nullptr, 0) == VERSAVIS_INVALID);
    REQUIRE(versavis_next(stream, &item, 0) == VERSAVIS_OK);
    versavis_image image = VERSAVIS_IMAGE_INIT;
    CHECK(versavis_view(&item, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_view(nullptr, &image) == VERSAVIS_INVALID);
    CHECK(versavis_wait_set_add(waiting, nullptr, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_wait_set_add(nullptr, stream, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_sets_next(sets, nullptr, 0) == VERSAVIS_INVALID);
    versavis_set_report report = VERSAVIS_SET_REPORT_INIT;
    CHECK(versavis_sets_report(sets, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_sets_report(nullptr, &report) == VERSAVIS_INVALID);
    CHECK(versavis_imu_window_span(window, &item.time, &item.time, 0, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_imu_window_open(instance.c_str(), "imu0", nullptr, nullptr, nullptr) ==
          VERSAVIS_INVALID);
    versavis_release(&item);
    versavis_imu_window_close(window);
    versavis_imu_window_close(nullptr);
    versavis_sets_close(sets);
    versavis_wait_set_free(waiting);
    versavis_close(stream);
}

TEST_CASE("c_api: each result has a sentence of its own, and others share one") {
    std::set<std::string> texts{versavis_result_text(-77)};
    for (int result = VERSAVIS_OTHER_EPOCH; result <= VERSAVIS_OVERTAKEN; ++result)
        texts.insert(versavis_result_text(result));
    CHECK(texts.size() == 18);
    CHECK(texts.count("") == 0);
    for (const int result : {VERSAVIS_OTHER_EPOCH - 1, VERSAVIS_OVERTAKEN + 1})
        CHECK(versavis_result_text(result) == std::string(versavis_result_text(-77)));
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
    std::uint32_t which = 7;
    CHECK(versavis_wait_set_wait(set, 0, &which) == VERSAVIS_NOTHING);
    CHECK(versavis_wait_set_wait(set, 0, nullptr) == VERSAVIS_INVALID);
    frame(*other, 4);
    CHECK(versavis_wait_set_wait(set, 10'000'000'000, &which) == VERSAVIS_OK);
    CHECK(which == 1);
    CHECK(versavis_wait_set_fd(set, nullptr) >= 0);
    pollfd entry{versavis_fd(second, nullptr), POLLIN, 0};
    CHECK(::poll(&entry, 1, 20'000) == 1);
    versavis_wait_set_free(set);
    versavis_close(first);
    versavis_close(second);
}

TEST_CASE_METHOD(CApi, "c_api: samples between two instants") {
    ring::Writer imu = make_imu();
    ImuMetadata sample{};
    for (std::int64_t i = 0; i < 5; ++i) {
        sample.number = static_cast<std::uint64_t>(i == 3 ? i + 1 : i);
        imu.publish(OutputTime{1000 + i}, pack(sample));
    }
    versavis_imu_window* window = nullptr;
    versavis_error error{};
    REQUIRE(versavis_imu_window_open(instance.c_str(), "imu0", nullptr, &window, &error) ==
            VERSAVIS_OK);
    versavis_imu_span span = VERSAVIS_IMU_SPAN_INIT;
    const auto between = [&](std::int64_t after, std::int64_t upto, std::int64_t patience = 0) {
        const versavis_time a = at("imu0", after, 0);
        const versavis_time b = at("imu0", upto, 0);
        return versavis_imu_window_span(window, &a, &b, patience, &span);
    };
    REQUIRE(between(1000, 1002) == VERSAVIS_OK);
    REQUIRE(span.count == 2);
    CHECK(span.samples[1].time.ns == 1002);
    CHECK(span.gap == VERSAVIS_SPAN_COVERED);
    CHECK(span.lost == 1);  // up to the one beyond
    REQUIRE(span.beyond != nullptr);
    CHECK(span.beyond->time.ns == 1003);
    CHECK(span.beyond->data.number == 4);
    REQUIRE(between(1002, 2000) == VERSAVIS_OK);
    CHECK(span.count == 2);
    CHECK(span.gap == VERSAVIS_SPAN_END);
    CHECK(span.beyond == nullptr);
    CHECK(between(2000, 2000, -1) == VERSAVIS_OK);
    CHECK(span.count == 0);
    CHECK(between(2, 1) == VERSAVIS_INVALID);
    const versavis_time time = at("imu0", 1000, 0);
    for (const bool other_life : {true, false}) {
        versavis_time other = time;
        other.life += other_life ? 1 : 0;
        other.epoch += other_life ? 0 : 1;
        CHECK(versavis_imu_window_span(window, &time, &other, 0, &span) == VERSAVIS_OTHER_EPOCH);
    }
    CHECK(versavis_imu_window_span(nullptr, &time, &time, 0, &span) == VERSAVIS_INVALID);
    CHECK(versavis_imu_window_fd(window, nullptr) >= 0);
    CHECK(versavis_imu_window_fd(nullptr, nullptr) == VERSAVIS_INVALID);
    versavis_imu_window_close(window);
    CHECK(versavis_imu_window_open(instance.c_str(), "cam0", nullptr, &window, &error) ==
          VERSAVIS_WRONG_KIND);
    CHECK(window == nullptr);
    CHECK_THAT(error.message, Catch::Contains("another kind"));
    versavis_options odd = VERSAVIS_OPTIONS_INIT;
    odd.after_loss = 5;
    CHECK(versavis_imu_window_open(instance.c_str(), "imu0", &odd, &window, &error) ==
          VERSAVIS_INVALID);
    CHECK(versavis_imu_window_open(instance.c_str(), nullptr, nullptr, &window, &error) ==
          VERSAVIS_INVALID);
}

TEST_CASE_METHOD(CApi,
                 "c_api: of a service that was restarted, samples are reported once to be others") {
    auto first = std::make_unique<ring::Writer>(make_imu());
    versavis_imu_window* window = nullptr;
    REQUIRE(versavis_imu_window_open(instance.c_str(), "imu0", nullptr, &window, nullptr) ==
            VERSAVIS_OK);
    samples(*first, 1000, 1004, 0);
    versavis_imu_span span = VERSAVIS_IMU_SPAN_INIT;
    versavis_time from = at("imu0", 1000, 1);
    versavis_time upto = at("imu0", 1002, 1);
    REQUIRE(versavis_imu_window_span(window, &from, &upto, 0, &span) == VERSAVIS_OK);
    CHECK(span.count == 2);
    first.reset();
    ring::Writer second = *ring::Writer::create(
        directory.path(), {"imu0", ring::StreamKind::imu, 64, 0, 0, 0, from.life + 1});
    samples(second, 1000, 1002, 0);
    CHECK(versavis_imu_window_span(window, &from, &upto, 0, &span) == VERSAVIS_RESTARTED);
    REQUIRE(versavis_imu_window_span(window, &from, &upto, 0, &span) == VERSAVIS_OK);
    CHECK(span.count == 0);  // times of another life
    CHECK(span.gap == VERSAVIS_SPAN_EPOCH);
    from = at("imu0", 1000, 1);
    upto = at("imu0", 1002, 1);
    REQUIRE(versavis_imu_window_span(window, &from, &upto, 0, &span) == VERSAVIS_OK);
    CHECK(span.count == 2);
    versavis_imu_window_close(window);
}

TEST_CASE_METHOD(CApi, "c_api: sets of frames with the samples between them") {
    const auto other = make("cam1");
    ring::Writer imu = make_imu();
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
    sample.epoch = 1;
    sample.gyro[1] = 0.5F;
    for (std::int64_t i = 0; i < 5; ++i) {
        sample.number = static_cast<std::uint64_t>(i + 1);
        imu.publish(OutputTime{1000 + i}, pack(sample));
    }
    frame(*camera, 3, 1, 48, -2);
    frame(*other, 3, 2);
    REQUIRE(versavis_sets_next(sets, &set, 0) == VERSAVIS_OK);
    versavis_item item = VERSAVIS_ITEM_INIT;
    REQUIRE(versavis_set_frame(&set, 0, &item) == VERSAVIS_OK);
    CHECK(set.time.life == item.time.life);
    CHECK(versavis_valid(&item) == 1);
    CHECK(item.kind == VERSAVIS_FRAMES);
    CHECK(set.tick == 3);
    CHECK(set.time.epoch == 1);
    CHECK(set.present == 3);
    CHECK(set.time.ns == 1001);
    CHECK(set.spread == 2);
    REQUIRE(versavis_set_frame(&set, 1, &item) == VERSAVIS_OK);
    CHECK(static_cast<const std::uint8_t*>(item.payload)[0] == 2);
    CHECK(versavis_set_frame(&set, 2, &item) == VERSAVIS_INVALID);
    CHECK(versavis_set_frame(&set, 0, nullptr) == VERSAVIS_INVALID);
    CHECK(versavis_set_frame(nullptr, 0, &item) == VERSAVIS_INVALID);
    CHECK(versavis_set_valid(&set) == 1);
    versavis_release(&item);
    CHECK(set.imu_count == 0);  // there was no set before
    CHECK(set.imu_gap == VERSAVIS_SPAN_BEGIN);
    frame(*camera, 4);
    frame(*other, 4);
    REQUIRE(versavis_sets_next(sets, &set, 0) == VERSAVIS_OK);
    REQUIRE(set.imu_count == 1);
    CHECK(set.imu[0].time.ns == 1004);
    CHECK(set.imu[0].data.gyro[1] == 0.5F);
    versavis_set_report report = VERSAVIS_SET_REPORT_INIT;
    CHECK(versavis_sets_report(sets, &report) == VERSAVIS_OK);
    CHECK(report.sets == 2);
    CHECK(set.imu_lost == 0);
    CHECK(set.imu_gap == VERSAVIS_SPAN_COVERED);
    samples(imu, 1005, 1006, 8);  // two are missing
    frame(*camera, 6);
    frame(*other, 6);
    REQUIRE(versavis_sets_next(sets, &set, 0) == VERSAVIS_OK);
    REQUIRE(set.imu_count == 2);
    CHECK(set.imu[1].time.ns == 1006);
    CHECK(set.imu_lost == 2);
    CHECK(versavis_sets_fd(sets, nullptr) >= 0);
    CHECK(versavis_sets_next(sets, &set, -1) == VERSAVIS_NOTHING);
    CHECK(set.present == 0);
    CHECK(set.imu == nullptr);
    CHECK(set.imu_count == 0);
    versavis_set_release(&set);
    versavis_sets_close(sets);
}

TEST_CASE_METHOD(CApi, "c_api: a set keeps its frames until it is released") {
    const auto other = make("cam1");
    const std::size_t before = mapped();
    versavis_sets* sets = open_sets(nullptr);
    frame(*camera, 3, 1);
    frame(*other, 3, 2);
    versavis_set set = VERSAVIS_SET_INIT;
    REQUIRE(versavis_sets_next(sets, &set, 0) == VERSAVIS_OK);
    versavis_sets_close(sets);
    CHECK(mapped() == before + 2);
    versavis_item item = VERSAVIS_ITEM_INIT;
    REQUIRE(versavis_set_frame(&set, 1, &item) == VERSAVIS_OK);
    for (std::uint64_t tick = 4; tick < 9; ++tick) frame(*camera, tick);
    CHECK(versavis_set_valid(&set) == 0);
    versavis_set_release(&set);
    CHECK(mapped() == before + 1);  // of the frame that was taken out
    CHECK(versavis_set_valid(&set) == 0);
    CHECK(versavis_set_frame(&set, 1, &item) == VERSAVIS_INVALID);
    versavis_release(&item);
    CHECK(mapped() == before);
    CHECK(set.present == 0);
    CHECK(set.size == sizeof set);
}

TEST_CASE_METHOD(CApi, "c_api: sets that lack something, by the options") {
    const auto other = make("cam1");
    const ring::Writer imu = make_imu();
    versavis_sets_options options = VERSAVIS_SETS_OPTIONS_INIT;
    options.patience = 1;
    versavis_sets* strict = open_sets(&options);
    options.imu = "imu0";
    versavis_sets* alone = open_sets(&options);
    options.partial = 1;
    options.suspect = 1;
    versavis_sets* lenient = open_sets(&options);
    frame(*camera, 2, 0, 48, 0, flag_suspect);
    frame(*other, 2, 0, 48, 0, flag_suspect);
    frame(*other, 3, 5);
    versavis_set set = VERSAVIS_SET_INIT;
    CHECK(versavis_sets_next(strict, &set, 0) == VERSAVIS_NOTHING);
    versavis_set_report report = VERSAVIS_SET_REPORT_INIT;
    REQUIRE(versavis_sets_report(strict, &report) == VERSAVIS_OK);
    CHECK(report.sets == 0);
    CHECK(report.incomplete == 1);
    CHECK(report.left_out == 2);
    CHECK(report.lost == 0);
    REQUIRE(versavis_sets_next(lenient, &set, 0) == VERSAVIS_OK);
    CHECK(set.present == 3);
    CHECK(set.imu_gap != VERSAVIS_SPAN_COVERED);
    REQUIRE(versavis_sets_next(lenient, &set, 0) == VERSAVIS_OK);
    CHECK(set.present == 2);
    versavis_item item = VERSAVIS_ITEM_INIT;
    CHECK(versavis_set_frame(&set, 0, &item) == VERSAVIS_NOTHING);
    CHECK(item.payload == nullptr);
    REQUIRE(versavis_set_frame(&set, 1, &item) == VERSAVIS_OK);
    CHECK(static_cast<const std::uint8_t*>(item.payload)[47] == 5);
    versavis_release(&item);
    frame(*camera, 4);
    frame(*other, 4);
    REQUIRE(versavis_sets_next(alone, &set, 0) == VERSAVIS_OK);
    CHECK(set.tick == 4);
    versavis_set_release(&set);
    for (versavis_sets* sets : {strict, alone, lenient}) versavis_sets_close(sets);
}

TEST_CASE_METHOD(CApi, "c_api: a set waits for its samples, unless asked not to") {
    const auto other = make("cam1");
    const ring::Writer imu = make_imu();
    versavis_sets_options options = VERSAVIS_SETS_OPTIONS_INIT;
    options.imu = "imu0";
    versavis_sets* sets = open_sets(&options);
    versavis_set set = VERSAVIS_SET_INIT;
    int result = VERSAVIS_OK;  // of a machine that stands still for 200 ms
    for (std::uint64_t tick = 1; tick < 10 && result == VERSAVIS_OK; ++tick) {
        frame(*camera, tick);
        frame(*other, tick);
        result = versavis_sets_next(sets, &set, 0);
    }
    CHECK(result == VERSAVIS_NOTHING);
    versavis_set_release(&set);
    versavis_sets_close(sets);
}

TEST_CASE_METHOD(CApi, "c_api: sets of one to sixteen cameras that are there") {
    std::vector<std::unique_ptr<ring::Writer>> writers;
    std::vector<std::string> names;
    for (int i = 0; i < 17; ++i) {
        names.push_back("camera" + std::to_string(i));
        writers.push_back(make(names.back()));
    }
    std::vector<const char*> cameras;
    for (const std::string& name : names) cameras.push_back(name.c_str());
    versavis_error error{};
    versavis_set set = VERSAVIS_SET_INIT;
    for (const std::size_t count : {1U, 16U}) {
        versavis_sets* sets = nullptr;
        REQUIRE(versavis_sets_open(instance.c_str(), cameras.data(), count, nullptr, &sets,
                                   &error) == VERSAVIS_OK);
        for (std::size_t i = 0; i < count; ++i) frame(*writers[i], count);
        REQUIRE(versavis_sets_next(sets, &set, 0) == VERSAVIS_OK);
        CHECK(set.present == (1U << count) - 1);
        versavis_set_release(&set);
        versavis_sets_close(sets);
    }
    const auto refused = [&](const char* const* those, std::size_t count,
                             const versavis_sets_options* options = nullptr) {
        auto* sets = reinterpret_cast<versavis_sets*>(&set);
        const int result =
            versavis_sets_open(instance.c_str(), those, count, options, &sets, &error);
        CHECK((sets == nullptr || result == VERSAVIS_INVALID));
        return result;
    };
    CHECK(refused(cameras.data(), 17) == VERSAVIS_INVALID);
    CHECK_THAT(error.message, Catch::Contains("1 to 16 cameras"));
    CHECK(refused(cameras.data(), 0) == VERSAVIS_INVALID);
    CHECK(refused(nullptr, 1) == VERSAVIS_INVALID);
    CHECK(versavis_sets_open(instance.c_str(), cameras.data(), 1, nullptr, nullptr, &error) ==
          VERSAVIS_INVALID);
    cameras[1] = "none";
    CHECK(refused(cameras.data(), 2) == VERSAVIS_ABSENT);
    CHECK_THAT(error.message, Catch::Contains("no such stream"));
    cameras[1] = nullptr;
    CHECK(refused(cameras.data(), 2) == VERSAVIS_INVALID);
    versavis_sets_options options = VERSAVIS_SETS_OPTIONS_INIT;
    versavis_options streams = VERSAVIS_OPTIONS_INIT;
    streams.start = 5;
    options.streams = &streams;
    CHECK(refused(cameras.data(), 1, &options) == VERSAVIS_INVALID);
    CHECK_THAT(error.message, Catch::Contains("is not a position"));
}

namespace {

/// A structure of another header: shorter or longer than this library's, with something behind it
/// that nobody may touch.
template <class T>
struct Foreign {
    explicit Foreign(const T& begun, std::uint32_t its_size) {
        std::memset(room, 0x5A, sizeof room);
        std::memset(room, 0, its_size);
        std::memcpy(room, &begun, std::min<std::size_t>(sizeof begun, its_size));
        std::memcpy(room, &its_size, sizeof its_size);
        size = its_size;
    }

    T* get() { return reinterpret_cast<T*>(room); }
    bool untouched_behind() const {
        return std::all_of(room + size, room + sizeof room, [](auto byte) { return byte == 0x5A; });
    }
    bool zeros_beyond() const {
        return std::all_of(room + sizeof(T), room + size, [](auto byte) { return byte == 0; });
    }

    alignas(8) unsigned char room[sizeof(T) + 64]{};
    std::uint32_t size;
};

constexpr std::uint32_t of_tomorrow = 24;  ///< bytes that a later header has more

}  // namespace

TEST_CASE_METHOD(CApi, "c_api: structures of a later header are filled as far as both know them") {
    const auto other = make("cam1");
    versavis_stream* stream = open();
    versavis_sets* sets = open_sets(nullptr);
    frame(*camera, 1, 7);
    frame(*other, 1);
    Foreign<versavis_item> item(VERSAVIS_ITEM_INIT, sizeof(versavis_item) + of_tomorrow);
    Foreign<versavis_image> image(VERSAVIS_IMAGE_INIT, sizeof(versavis_image) + of_tomorrow);
    Foreign<versavis_set> set(VERSAVIS_SET_INIT, sizeof(versavis_set) + of_tomorrow);
    Foreign<versavis_set_report> report(VERSAVIS_SET_REPORT_INIT,
                                        sizeof(versavis_set_report) + of_tomorrow);
    Foreign<versavis_sensor_state> state(VERSAVIS_SENSOR_STATE_INIT,
                                         sizeof(versavis_sensor_state) + of_tomorrow);
    REQUIRE(versavis_next(stream, item.get(), 0) == VERSAVIS_OK);
    REQUIRE(versavis_view(item.get(), image.get()) == VERSAVIS_OK);
    CHECK(image.get()->data[0] == 7);
    CHECK(versavis_sensor(item.get(), state.get()) == VERSAVIS_OK);
    REQUIRE(versavis_sets_next(sets, set.get(), 0) == VERSAVIS_OK);
    CHECK(set.get()->present == 3);
    REQUIRE(versavis_set_frame(set.get(), 0, item.get()) == VERSAVIS_OK);
    REQUIRE(versavis_sets_report(sets, report.get()) == VERSAVIS_OK);
    CHECK(report.get()->sets == 1);
    CHECK((item.zeros_beyond() && item.untouched_behind()));
    CHECK((image.zeros_beyond() && image.untouched_behind()));
    CHECK((set.zeros_beyond() && set.untouched_behind()));
    CHECK((report.zeros_beyond() && report.untouched_behind()));
    CHECK((state.zeros_beyond() && state.untouched_behind()));
    CHECK(set.get()->size == sizeof(versavis_set) + of_tomorrow);
    versavis_set_release(set.get());
    CHECK(set.untouched_behind());
    versavis_release(item.get());
    versavis_sets_close(sets);
    versavis_close(stream);
}

TEST_CASE_METHOD(CApi, "c_api: what a later header asks for, and this library cannot, is refused") {
    Foreign<versavis_options> options(VERSAVIS_OPTIONS_INIT,
                                      sizeof(versavis_options) + of_tomorrow);
    versavis_close(open(options.get()));  // zeros ask for nothing
    options.room[sizeof(versavis_options) + 3] = 1;
    versavis_stream* stream = nullptr;
    versavis_error error{};
    CHECK(versavis_open(instance.c_str(), "cam0", options.get(), &stream, &error) ==
          VERSAVIS_INVALID);
    CHECK_THAT(error.message, Catch::Contains("does not know"));
}

TEST_CASE_METHOD(CApi, "c_api: a structure without its size is refused, and not touched") {
    const auto other = make("cam1");
    versavis_stream* stream = open();
    versavis_sets* sets = open_sets(nullptr);
    frame(*camera, 1);
    frame(*other, 1);
    versavis_item good = VERSAVIS_ITEM_INIT;
    REQUIRE(versavis_next(stream, &good, 0) == VERSAVIS_OK);
    for (const std::uint32_t less : {0U, 4U}) {
        Foreign<versavis_item> item(VERSAVIS_ITEM_INIT, less);
        Foreign<versavis_image> image(VERSAVIS_IMAGE_INIT, less);
        Foreign<versavis_set> set(VERSAVIS_SET_INIT, less);
        Foreign<versavis_set_report> report(VERSAVIS_SET_REPORT_INIT, less);
        Foreign<versavis_options> options(VERSAVIS_OPTIONS_INIT, less);
        CHECK(versavis_next(stream, item.get(), 0) == VERSAVIS_INVALID);
        CHECK(versavis_latest(stream, item.get(), 0) == VERSAVIS_INVALID);
        CHECK(versavis_valid(item.get()) == 0);
        CHECK(versavis_view(&good, image.get()) == VERSAVIS_INVALID);
        CHECK(versavis_sets_next(sets, set.get(), 0) == VERSAVIS_INVALID);
        CHECK(versavis_set_valid(set.get()) == 0);
        CHECK(versavis_sets_report(sets, report.get()) == VERSAVIS_INVALID);
        versavis_release(item.get());
        versavis_set_release(set.get());
        versavis_stream* none = nullptr;
        CHECK(versavis_open(instance.c_str(), "cam0", options.get(), &none, nullptr) ==
              VERSAVIS_INVALID);
        // The size itself is four bytes.
        const auto untouched = [](const auto& foreign) {
            return std::all_of(foreign.room + 4, foreign.room + sizeof foreign.room,
                               [](auto byte) { return byte == 0x5A; });
        };
        CHECK((untouched(item) && untouched(image) && untouched(set) && untouched(report)));
    }
    versavis_item garbage;
    versavis_set other_garbage;
    std::memset(&garbage, 0xCC, sizeof garbage);
    std::memset(&other_garbage, 0xCC, sizeof other_garbage);
    CHECK(versavis_next(stream, &garbage, 0) == VERSAVIS_INVALID);
    CHECK(versavis_sets_next(sets, &other_garbage, 0) == VERSAVIS_INVALID);
    versavis_release(&garbage);
    versavis_set_release(&other_garbage);
    versavis_release(&good);
    versavis_sets_close(sets);
    versavis_close(stream);
}

TEST_CASE("c_api: times of two epochs, or of none, do not compare") {
    const versavis_time time{7, 1000, 3, 0};
    std::int64_t span = 0;
    versavis_time other = time;
    other.ns += 50;
    CHECK(versavis_time_difference(&other, &time, &span) == VERSAVIS_OK);
    CHECK(span == 50);
    CHECK(versavis_time_difference(&time, &other, &span) == VERSAVIS_OK);
    CHECK(span == -50);
    other.epoch = 4;
    CHECK(versavis_time_difference(&other, &time, &span) == VERSAVIS_OTHER_EPOCH);
    other = time;
    other.life = 8;
    CHECK(versavis_time_difference(&other, &time, &span) == VERSAVIS_OTHER_EPOCH);
    const versavis_time none{7, 1000, VERSAVIS_NO_EPOCH, 0};
    CHECK(versavis_time_difference(&none, &none, &span) == VERSAVIS_OTHER_EPOCH);
    CHECK(versavis_time_difference(nullptr, &time, &span) == VERSAVIS_INVALID);
    CHECK(versavis_time_difference(&time, nullptr, &span) == VERSAVIS_INVALID);
    CHECK(versavis_time_difference(&time, &time, nullptr) == VERSAVIS_INVALID);
    CHECK(span == -50);
}

TEST_CASE_METHOD(CApi, "c_api: the streams of an instance, by name, and what cannot be opened") {
    const auto imu = make_imu();
    std::ofstream(directory.path() / "broken") << "no ring";
    frame(*camera, 1);
    struct Seen {
        std::vector<std::string> names;
        std::vector<versavis_stream_info> infos;
        std::size_t enough;
    } seen{{}, {}, 99};
    const auto visit = [](const versavis_stream_info* info, void* context) {
        auto& all = *static_cast<Seen*>(context);
        all.names.emplace_back(info->name);
        all.infos.push_back(*info);
        CHECK((info->error == VERSAVIS_OK) == (info->why[0] == '\0'));
        return all.names.size() == all.enough ? 77 : 0;
    };
    versavis_error error{};
    REQUIRE(versavis_list(instance.c_str(), nullptr, visit, &seen, &error) == VERSAVIS_OK);
    REQUIRE(seen.names == std::vector<std::string>{"broken", "cam0", "imu0"});
    CHECK(seen.infos[0].size == sizeof(versavis_stream_info));
    CHECK(seen.infos[0].kind == 0);
    CHECK(seen.infos[0].error == VERSAVIS_DAMAGED);
    CHECK(seen.infos[1].kind == VERSAVIS_FRAMES);
    CHECK(seen.infos[1].published == 1);
    CHECK(seen.infos[1].retained == 4);
    CHECK(seen.infos[1].alive == 1);
    CHECK(seen.infos[2].kind == VERSAVIS_IMU);
    seen = {{}, {}, 2};
    CHECK(versavis_list(instance.c_str(), nullptr, visit, &seen, &error) == 77);
    CHECK(seen.names.size() == 2);
    CHECK(versavis_list(instance.c_str(), nullptr, nullptr, nullptr, &error) == VERSAVIS_INVALID);
    CHECK(versavis_list("no-such-instance", nullptr, visit, &seen, &error) == VERSAVIS_ABSENT);
    CHECK_THAT(error.message, Catch::Contains("is versavisd running"));
}

TEST_CASE_METHOD(CApi, "c_api: opening waits for a stream as long as it is asked to [threads]",
                 "[threads]") {
    versavis_options options = VERSAVIS_OPTIONS_INIT;
    options.wait = 60'000'000'000;
    options.start = VERSAVIS_OLDEST;
    std::unique_ptr<ring::Writer> late;
    std::thread service([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
        late = make("late");
    });
    versavis_stream* stream = open(&options, "late");
    service.join();
    versavis_close(stream);
    options.wait = 1'000'000;
    CHECK(versavis_open(instance.c_str(), "never", &options, &stream, nullptr) == VERSAVIS_ABSENT);
}

TEST_CASE_METHOD(CApi, "c_api: the newest set, and how many were passed over") {
    const auto other = make("cam1");
    versavis_sets* sets = open_sets(nullptr);
    for (std::uint64_t tick = 1; tick <= 3; ++tick) {
        frame(*camera, tick);
        frame(*other, tick);
    }
    versavis_set set = VERSAVIS_SET_INIT;
    REQUIRE(versavis_sets_latest(sets, &set, 0) == VERSAVIS_OK);
    CHECK(set.tick == 3);
    CHECK(versavis_sets_latest(sets, &set, 0) == VERSAVIS_NOTHING);
    versavis_set_report report = VERSAVIS_SET_REPORT_INIT;
    REQUIRE(versavis_sets_report(sets, &report) == VERSAVIS_OK);
    CHECK(report.sets == 1);
    CHECK(report.skipped == 2);
    versavis_sets_close(sets);
}
