/* SPDX-License-Identifier: BSD-3-Clause */
/* Looks at a camera's newest frame in place, five times a second. */
#include <inttypes.h>
#include <stdio.h>
#include <time.h>
#include <versavis.h>

static void print_frame(const versavis_item* item, const versavis_image* image, uint8_t first) {
    char sigma[24] = "unknown";
    if (item->data.frame.sigma != VERSAVIS_SIGMA_UNKNOWN)
        snprintf(sigma, sizeof sigma, "%" PRIu32 " ns", item->data.frame.sigma);
    printf("%" PRId64 " ns +- %s: %" PRIu32 " x %" PRIu32 " %s, first byte %u\n", item->time.ns,
           sigma, image->width, image->height, versavis_pixel_format_name(image->pixel_format),
           (unsigned)first);
}

int main(int argc, char** argv) {
    versavis_error error;
    versavis_stream* stream;
    versavis_item item = VERSAVIS_ITEM_INIT;
    versavis_image image = VERSAVIS_IMAGE_INIT;
    if (versavis_open(NULL, argc > 1 ? argv[1] : "cam0", NULL, &stream, &error) != VERSAVIS_OK) {
        fprintf(stderr, "%s\n", error.message);
        return 1;
    }
    for (;;) {
        int result = versavis_latest(stream, &item, 1000000000);
        if (result == VERSAVIS_OK && versavis_view(&item, &image) == VERSAVIS_OK) {
            const uint8_t first = image.data[0]; /* ... draw it here ... */
            /* The time of a suspect frame is a guess. */
            const int suspect = (item.data.frame.flags & VERSAVIS_SUSPECT) != 0;
            if (!suspect && versavis_valid(&item)) print_frame(&item, &image, first);
        } else if (result < 0 || result == VERSAVIS_OK) {
            fprintf(stderr, "%s\n", result < 0 ? versavis_result_text(result) : "not an image");
            return 1;
        } else {
            fprintf(stderr, "%s\n", versavis_result_text(result));
        }
        if (fflush(stdout) != 0) return 1; /* nobody reads on, or the disk is full */
        nanosleep(&(struct timespec){0, 200000000}, NULL);
    }
}
