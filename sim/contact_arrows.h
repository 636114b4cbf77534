/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Shows contact wrenches as a channel of a recording. Each row has a foxglove.SceneUpdate. For each
 * force it has an arrow that starts at the center of pressure, and a ball at that point. On the
 * ground, the center of pressure is the point of the plane about which the wrench has no moment
 * parallel to the plane (Sardain and Bessonnet 2004, "Forces acting on a biped robot"). Elsewhere
 * it is the point of the wrench's axis nearest to the body's origin. World frame, SI units.
 * RT-safe.
 */
#ifndef SIM_CONTACT_ARROWS_H
#define SIM_CONTACT_ARROWS_H

#include "rt/recording/recorder.h"

enum {
    CONTACT_ARROWS = 64,      /* maximum number of contacts shown */
    CONTACT_ARROW_SIZE = 1024 /* bytes per contact for arrow and ball in JSON */
};

/* A body whose contact is shown. */
struct contact_shown {
    /* column of the wrench's first component (force, then moment about the body's origin); the
     * other five components follow */
    size_t signal;
    size_t body; /* body whose pose is used */
};

struct contact_arrows {
    size_t ncontact;
    const struct contact_shown *contact;
    bool has_ground;
    double ground_point[3], ground_normal[3]; /* a point of the ground plane, and its unit normal */
    double arrow_m_per_n;
    size_t touching; /* number of arrows in the last message */
};

struct contact_arrow {
    double at[3]; /* the center of pressure */
    double along[3];
    double length_m;
};

/* Finds the contacts that have a force in a row, in the order of the list. value and pose are as in
 * recorder_row. Returns their number. */
size_t contact_arrows_find(const struct contact_arrows *arrows, const double *value,
                           const double *pose, struct contact_arrow arrow[CONTACT_ARROWS]);

/* Write arrows and centers of pressure as JSON lists without brackets. Return the address after the
 * last byte. */
char *contact_arrows_print(const struct contact_arrow *arrow, size_t count, char *at);
char *contact_arrows_print_pressures(const struct contact_arrow *arrow, size_t count, char *at);

/* Returns the channel /contacts for these arrows. The caller owns the arrows, which must outlive
 * the recorder. */
struct recorder_channel contact_arrows_channel(struct contact_arrows *arrows);

#endif
