// SPDX-License-Identifier: BSD-3-Clause
// A camera and an IMU beside whatever else a program waits for, in one epoll.
#include <sys/epoll.h>
#include <versavis/stream.hpp>
#include <versavis/wait_set.hpp>

#include <cstdio>

int main() {
    auto camera = versavis::FrameStream::open("cam0");
    auto imu = versavis::ImuStream::open("imu0");
    if (!camera || !imu) {
        std::fprintf(stderr, "%s\n", (camera ? imu.error() : camera.error()).message().c_str());
        return 1;
    }
    versavis::WaitSet both;
    if (!both.add(camera->reader()) || !both.add(imu->reader())) return 1;
    const auto descriptor = both.fd();
    if (!descriptor) return 1;
    const int poll = ::epoll_create1(0);
    epoll_event event{EPOLLIN, {}};
    ::epoll_ctl(poll, EPOLL_CTL_ADD, *descriptor, &event);
    for (;;) {
        if (::epoll_wait(poll, &event, 1, -1) != 1) continue;
        while (const auto which = both.wait({})) {  // until nothing is left
            if (*which == 1) {
                if (const auto sample = imu->next())
                    std::printf("%lld ns: %g rad/s\n", static_cast<long long>(sample->time.ns),
                                static_cast<double>(sample->data.gyro[2]));
            } else if (const auto frame = camera->next()) {
                std::printf("%lld ns: frame %llu\n", static_cast<long long>(frame->time.ns),
                            static_cast<unsigned long long>(frame->number));
            }
            std::fflush(stdout);
        }
    }
}
