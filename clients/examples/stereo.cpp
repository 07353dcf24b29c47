// SPDX-License-Identifier: BSD-3-Clause
// Sets of frames of two cameras, with the IMU samples since the set before: what visual-inertial
// odometry needs.
#include <versavis/set_reader.hpp>

#include <cstdio>

int main(int argc, char** argv) {
    versavis::SetOptions options;
    options.imu = argc > 3 ? argv[3] : "imu0";
    auto sets = versavis::SetReader::open(
        {argc > 1 ? argv[1] : "cam0", argc > 2 ? argv[2] : "cam1"}, options);
    if (!sets) {
        std::fprintf(stderr, "%s\n", sets.error().message().c_str());
        return 1;
    }
    for (;;) {
        const auto set = sets->next(versavis::seconds(1));
        if (!set) {
            std::fprintf(stderr, "%s\n", set.error().message().c_str());
            continue;
        }
        // ... use set->frames[0]->image() and set->frames[1]->image() here ...
        if (!set->valid()) continue;  // too slow: the writer needed the memory
        std::printf("tick %llu: %lld ns, spread %lld ns, %zu samples%s\n",
                    static_cast<unsigned long long>(set->tick),
                    static_cast<long long>(set->time.ns), static_cast<long long>(set->spread.ns),
                    set->imu.samples.size(), set->imu.complete() ? "" : ", some are missing");
        std::fflush(stdout);
    }
}
