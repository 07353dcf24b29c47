/* SPDX-License-Identifier: BSD-3-Clause */
/* Looks at a camera's newest frame in place, five times a second. */
#include <inttypes.h>
#include <stdio.h>
#include <time.h>
#include <versavis.h>

int main(int argc, char** argv) {
    versavis_error error;
    versavis_stream* stream;
    versavis_item item = VERSAVIS_ITEM_INIT;
    versavis_image image;
    if (versavis_open(NULL, argc > 1 ? argv[1] : "cam0", NULL, &stream, &error) != VERSAVIS_OK) {
        fprintf(stderr, "%s\n", error.message);
        return 1;
    }
    for (;;) {
        int result = versavis_latest(stream, &item, 1000000000);
        if (result == VERSAVIS_OK && versavis_view(&item, &image) == VERSAVIS_OK) {
            const uint8_t first = image.data[0]; /* ... draw it here ... */
            if (versavis_valid(&item))
                printf("%" PRId64 " ns: %" PRIu32 " x %" PRIu32 " %s, first byte %u\n", item.time,
                       image.width, image.height, versavis_pixel_format_name(image.pixel_format),
                       (unsigned)first);
        } else if (result < 0 || result == VERSAVIS_OK) {
            fprintf(stderr, "%s\n", result < 0 ? versavis_result_text(result) : "not an image");
            return 1;
        } else {
            fprintf(stderr, "%s\n", versavis_result_text(result));
        }
        fflush(stdout);
        nanosleep(&(struct timespec){0, 200000000}, NULL);
    }
}
