/* SPDX-License-Identifier: BSD-3-Clause */
/* Sets of frames of two cameras, with the IMU samples since the set before. */
#include <inttypes.h>
#include <stdio.h>
#include <versavis.h>

int main(void) {
    const char* const cameras[] = {"cam0", "cam1"};
    versavis_sets_options options = VERSAVIS_SETS_OPTIONS_INIT;
    versavis_error error;
    versavis_sets* sets;
    static versavis_set set = VERSAVIS_SET_INIT;
    options.imu = "imu0";
    if (versavis_sets_open(NULL, cameras, 2, &options, &sets, &error) != VERSAVIS_OK) {
        fprintf(stderr, "%s\n", error.message);
        return 1;
    }
    for (;;) {
        int result = versavis_sets_next(sets, &set, 1000000000);
        if (result != VERSAVIS_OK) {
            fprintf(stderr, "%s\n", versavis_result_text(result));
            if (result < 0) return 1;
            continue;
        }
        /* ... use versavis_view(&set.frames[0], &image) and set.frames[1] here ... */
        if (!versavis_valid(&set.frames[0]) || !versavis_valid(&set.frames[1])) continue;
        printf("tick %" PRIu64 ": %" PRId64 " ns, spread %" PRId64 " ns, %zu samples\n", set.tick,
               set.time, set.spread, set.imu_count);
        fflush(stdout);
    }
}
