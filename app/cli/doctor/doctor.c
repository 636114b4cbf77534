/* SPDX-License-Identifier: Apache-2.0 */
/* Collects the findings of doctor, and reads the files that they come from. */
#include "app/cli/doctor/private.h"

#include <ctype.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void doctor_add_finding(struct doctor *d, enum doctor_verdict verdict, const char *subject,
                        const char *fix, const char *format, ...)
{
    struct doctor_finding *finding;
    va_list args;

    if (d->count == d->max) {
        return;
    }
    finding = &d->findings[d->count++];
    finding->verdict = verdict;
    finding->subject = subject;
    snprintf(finding->fix, sizeof finding->fix, "%s", fix);
    va_start(args, format);
    vsnprintf(finding->found, sizeof finding->found, format, args);
    va_end(args);
}

bool doctor_read_line(const struct doctor *d, char *text, size_t size, const char *format, ...)
{
    char path[DOCTOR_PATH], name[DOCTOR_PATH];
    va_list args;
    FILE *file;
    bool good;

    va_start(args, format);
    vsnprintf(name, sizeof name, format, args);
    va_end(args);
    if ((size_t)snprintf(path, sizeof path, "%s%s", d->config->root, name) >= sizeof path) {
        return false;
    }
    file = fopen(path, "re");
    if (!file) {
        return false;
    }
    good = fgets(text, (int)size, file) != NULL;
    fclose(file);
    if (good) {
        text[strcspn(text, "\n")] = '\0';
    }
    return good;
}

bool doctor_read_entry(const struct doctor *d, const char *name, const char *key, char *text,
                       size_t size)
{
    char path[DOCTOR_PATH], line[8192]; /* the flags of a processor are that long */
    bool found = false;
    FILE *file;

    snprintf(path, sizeof path, "%s%s", d->config->root, name);
    file = fopen(path, "re");
    while (file && !found && fgets(line, sizeof line, file)) {
        found = strncmp(line, key, strlen(key)) == 0;
    }
    if (found) {
        const char *value = line + strlen(key);

        value += strspn(value, " \t:");
        snprintf(text, size, "%.*s", (int)strcspn(value, "\n"), value);
    }
    if (file) {
        fclose(file);
    }
    return found;
}

bool doctor_may_write(const struct doctor *d, const char *name)
{
    char path[DOCTOR_PATH];

    return (size_t)snprintf(path, sizeof path, "%s%s", d->config->root, name) < sizeof path &&
           access(path, W_OK) == 0;
}

bool doctor_has_capability(const struct doctor *d, int capability)
{
    char text[DOCTOR_TEXT];

    return doctor_read_entry(d, "/proc/self/status", "CapEff", text, sizeof text) &&
           (strtoull(text, NULL, 16) >> capability & 1) != 0;
}

long long doctor_limit_of(const struct doctor *d, const char *row)
{
    char text[DOCTOR_TEXT];

    if (!doctor_read_entry(d, "/proc/self/limits", row, text, sizeof text)) {
        return -2;
    }
    return strncmp(text, "unlimited", 9) == 0 ? -1 : strtoll(text, NULL, 10);
}

bool doctor_list_has(const char *list, int cpu)
{
    while (isdigit((unsigned char)*list)) {
        char *end;
        long first = strtol(list, &end, 10), last = first;

        if (*end == '-' && isdigit((unsigned char)end[1])) {
            last = strtol(end + 1, &end, 10);
        }
        if (cpu >= first && cpu <= last) {
            return true;
        }
        list = *end == ',' ? end + 1 : end;
    }
    return false;
}

size_t doctor_examine(const struct doctor_config *config, struct doctor_finding *findings,
                      size_t max)
{
    struct doctor d = {.config = config, .findings = findings, .max = max};

    doctor_examine_machine(&d);
    doctor_examine_board(&d);
    doctor_examine_buses(&d);
    doctor_examine_external(&d);
    return d.count;
}

enum doctor_verdict doctor_verdict(const struct doctor_finding *findings, size_t count)
{
    enum doctor_verdict worst = DOCTOR_OK;

    for (size_t i = 0; i < count; i++) {
        worst = findings[i].verdict > worst ? findings[i].verdict : worst;
    }
    return worst;
}
