/* SPDX-License-Identifier: Apache-2.0 */
/* Shows a recording in the page (viewer/viewer.h): coman-hil replay --http. Not RT-safe. */
#ifndef APP_CLI_REPLAY_PAGE_H
#define APP_CLI_REPLAY_PAGE_H

struct replay_page_options {
    const char *directory;
    const char *http;  /* "[HOST:]PORT" */
    const char *ready; /* file of --ready, NULL = none */
    const char *with;  /* recording to compare it with, NULL = none */
    const char *rig;   /* NULL = that of the recording's summary */
    double from_s, to_s, speed;
};

/* Serves the recording until the program is told to end; returns the exit status. */
int replay_page(const struct replay_page_options *options);

#endif
