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
    versavis_set set = VERSAVIS_SET_INIT;
    versavis_item frames[] = {VERSAVIS_ITEM_INIT, VERSAVIS_ITEM_INIT};
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
        for (uint32_t camera = 0; camera < 2; ++camera)
            if (versavis_set_frame(&set, camera, &frames[camera]) != VERSAVIS_OK) return 1;
        /* ... use versavis_view(&frames[0], &image) here ... */
        if (!versavis_set_valid(&set)) continue; /* too slow: the writer needed the memory */
        printf("tick %" PRIu64 ": %" PRId64 " ns, spread %" PRId64 " ns, %zu samples\n", set.tick,
               set.time.ns, set.spread, set.imu_count);
        fflush(stdout);
    }
}
