/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a rig's bodies and world look like, as the content of a foxglove.SceneUpdate in JSON: an
 * entity a frame, "world" or a body's name, that stays for the whole recording. Surfaces as they
 * touch (meshes, capsules, boxes, spheres, the ground); a body without any as the ellipsoid that
 * has its mass at the density of water and the proportions of its moments of inertia about the axes
 * of its frame. Not RT-safe.
 */
#ifndef SIM_SCENE_MESSAGE_H
#define SIM_SCENE_MESSAGE_H

#include "base/memory_file.h"
#include "rig/rig.h"

/* Writes the scene into a text, which is the caller's to free. ERROR_MEMORY. */
enum error_code scene_message_make(const struct rig *rig, struct memory_file *text,
                                   struct error *error);

#endif
