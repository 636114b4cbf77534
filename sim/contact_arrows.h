/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Contact wrenches as a channel of a recording: in each row a foxglove.SceneUpdate with an arrow
 * along each force, from its center of pressure, and a ball there. On the ground the center of
 * pressure is the point of the plane about which the wrench has no moment along the plane (Sardain
 * and Bessonnet 2004, "Forces acting on a biped robot"); elsewhere that point of the wrench's axis
 * which is nearest to the body's origin. World frame, SI units. RT-safe.
 */
#ifndef SIM_CONTACT_ARROWS_H
#define SIM_CONTACT_ARROWS_H

#include "rt/recording/recorder.h"

enum {
    CONTACT_ARROWS = 64,      /* contacts beyond are not shown */
    CONTACT_ARROW_SIZE = 1024 /* bytes of a contact's arrow and ball in JSON */
};

/* A body whose contact is shown. */
struct contact_shown {
    size_t signal; /* of its wrench's first component (force, then moment about the body's origin);
                    * the other five follow */
    size_t body;   /* whose pose it has */
};

struct contact_arrows {
    size_t ncontact;
    const struct contact_shown *contact;
    bool has_ground;
    double ground_point[3], ground_normal[3]; /* a plane; the normal has length 1 */
    double arrow_m_per_n;
    size_t touching; /* arrows of the last message */
};

struct contact_arrow {
    double at[3]; /* the center of pressure */
    double along[3];
    double length_m;
};

/* Finds the contacts of a row that touch, in their order; value and pose are those of
 * recorder_row. Returns how many. */
size_t contact_arrows_find(const struct contact_arrows *arrows, const double *value,
                           const double *pose, struct contact_arrow arrow[CONTACT_ARROWS]);

/* Write lists without their brackets; return where the next byte goes. */
char *contact_arrows_print(const struct contact_arrow *arrow, size_t count, char *at);
char *contact_arrows_print_pressures(const struct contact_arrow *arrow, size_t count, char *at);

/* Returns the channel /contacts for these arrows, which stay the caller's and must outlive the
 * recorder. */
struct recorder_channel contact_arrows_channel(struct contact_arrows *arrows);

#endif
