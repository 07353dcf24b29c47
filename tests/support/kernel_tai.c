/* SPDX-License-Identifier: BSD-3-Clause */
/* Preloaded: the kernel's offset of TAI is what the file /run/kernel-tai says, as it would be after
 * some program had set it. The real one is that of the whole machine, and a container may not read
 * it. */
#include <stdio.h>
#include <string.h>
#include <sys/timex.h>

int adjtimex(struct timex* kernel) {
    FILE* file = fopen("/run/kernel-tai", "re");
    memset(kernel, 0, sizeof *kernel);
    kernel->status = STA_UNSYNC;
    if (file == NULL) return TIME_ERROR;
    if (fscanf(file, "%d", &kernel->tai) != 1) kernel->tai = 0;
    fclose(file);
    return TIME_ERROR;
}
