/* SPDX-License-Identifier: BSD-3-Clause */
/* A camera and the events beside whatever else a program waits for, in one epoll. */
#include <inttypes.h>
#include <stdio.h>
#include <sys/epoll.h>
#include <versavis.h>

static void print(const versavis_item* item) {
    if (item->kind == VERSAVIS_EVENTS)
        printf("%" PRId64 " ns: %s %s\n", item->time.ns, item->data.event.source_name,
               versavis_event_name(item->data.event.kind));
    else
        printf("%" PRId64 " ns: a frame of %zu bytes\n", item->time.ns, item->payload_size);
    fflush(stdout);
}

int main(void) {
    const char* const names[] = {"cam0", "events"};
    versavis_stream* streams[2];
    versavis_item item = VERSAVIS_ITEM_INIT;
    versavis_error error;
    int poll = epoll_create1(0);
    for (uint32_t i = 0; i < 2; ++i) {
        struct epoll_event event = {.events = EPOLLIN, .data.u32 = i};
        if (versavis_open(NULL, names[i], NULL, &streams[i], &error) != VERSAVIS_OK ||
            epoll_ctl(poll, EPOLL_CTL_ADD, versavis_fd(streams[i], &error), &event) != 0) {
            fprintf(stderr, "%s: %s\n", names[i], error.message);
            return 1;
        }
    }
    for (;;) {
        struct epoll_event ready;
        if (epoll_wait(poll, &ready, 1, -1) != 1) continue;
        int result;
        while ((result = versavis_next(streams[ready.data.u32], &item, 0)) != VERSAVIS_NOTHING) {
            if (result == VERSAVIS_OK) print(&item);
            if (result == VERSAVIS_GONE) break;
            if (result < 0) return 1;
        }
    }
}
