/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The anchor of a pair's bristles (contact.h): a point and an axis that are fixed in one of its
 * surfaces, and a radius. They stay while the patch that touches rocks about them, and are dragged
 * along by one that rolls on. Frames as said; SI units. Pure functions; nothing fails; RT-safe.
 */
#ifndef CONTACT_NATIVE_ANCHOR_H
#define CONTACT_NATIVE_ANCHOR_H

#include "contact/contact.h"

#include <stdbool.h>

struct native_anchor {
    double point[3], axis[3]; /* m; of length 1 */
    double radius;            /* m; 0 where the patch is a point: then there is no anchor */
};

/* Reads the anchor that a pair's bristles have kept, in the frame that it is kept in. Returns
 * whether there is one. */
bool native_anchor_read(const double y[CONTACT_BRISTLE], struct native_anchor *anchor);

/* Writes it behind those that bend. */
void native_anchor_write(const struct native_anchor *anchor, double y[CONTACT_BRISTLE]);

/* Drags an anchor to where it is within its play about that of the area in touch (centroid, mean
 * normal and RMS radius, same frame). Returns whether it was not. */
bool native_anchor_drag(const struct native_anchor *touch, struct native_anchor *anchor);

#endif
