/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Names of the kernels' variants. The native engine's kernels are compiled once per instruction
 * set; a new engine uses the best one that the machine supports. If NATIVE_VARIANT is defined, it
 * is appended to all names that the kernel files share. If not, the same files compile to the plain
 * variant. Include this file before any declaration of these names. It defines names only; each
 * declaration says whether it is RT-safe.
 */
#ifndef CONTACT_VARIANT_H
#define CONTACT_VARIANT_H

#ifdef NATIVE_VARIANT

#define NATIVE_PASTE(name, variant) name##_##variant
#define NATIVE_EXPAND(name, variant) NATIVE_PASTE(name, variant)
#define NATIVE_NAME(name) NATIVE_EXPAND(name, NATIVE_VARIANT)

#define broad_phase_find NATIVE_NAME(broad_phase_find)
#define clip2d_side NATIVE_NAME(clip2d_side)
#define clip2d_three_points NATIVE_NAME(clip2d_three_points)
#define clip2d_to_facet NATIVE_NAME(clip2d_to_facet)
#define clip2d_moments NATIVE_NAME(clip2d_moments)
#define clip2d_outline NATIVE_NAME(clip2d_outline)
#define native_anchor_drag NATIVE_NAME(native_anchor_drag)
#define native_anchor_read NATIVE_NAME(native_anchor_read)
#define native_anchor_write NATIVE_NAME(native_anchor_write)
#define friction_sticking_add NATIVE_NAME(friction_sticking_add)
#define native_bristle_press NATIVE_NAME(native_bristle_press)
#define native_bristle_relax NATIVE_NAME(native_bristle_relax)
#define native_bristle_resist NATIVE_NAME(native_bristle_resist)
#define native_gather_add NATIVE_NAME(native_gather_add)
#define native_law_sum NATIVE_NAME(native_law_sum)
#define native_make_room NATIVE_NAME(native_make_room)
#define native_ops NATIVE_NAME(native_ops)
#define native_overlap NATIVE_NAME(native_overlap)
#define native_overlap_capsule_half_space NATIVE_NAME(native_overlap_capsule_half_space)
#define native_overlap_capsules NATIVE_NAME(native_overlap_capsules)
#define native_overlap_fields NATIVE_NAME(native_overlap_fields)
#define native_overlap_hertz NATIVE_NAME(native_overlap_hertz)
#define native_overlap_half_space NATIVE_NAME(native_overlap_half_space)
#define native_overlap_meshes NATIVE_NAME(native_overlap_meshes)
#define native_overlap_sphere NATIVE_NAME(native_overlap_sphere)
#define native_pair_find_force NATIVE_NAME(native_pair_find_force)
#define native_place_fixed_surfaces NATIVE_NAME(native_place_fixed_surfaces)
#define friction_sums_gather NATIVE_NAME(friction_sums_gather)
#define friction_sums_hold NATIVE_NAME(friction_sums_hold)
#define solid_depth NATIVE_NAME(solid_depth)
#define solid_find_nearest NATIVE_NAME(solid_find_nearest)
#define solid_nearest_of_face NATIVE_NAME(solid_nearest_of_face)
#define facet_below_plane_depth NATIVE_NAME(facet_below_plane_depth)
#define facet_below_plane_gather NATIVE_NAME(facet_below_plane_gather)

#endif

#endif
