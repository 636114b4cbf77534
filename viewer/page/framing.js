// SPDX-License-Identifier: Apache-2.0
// How far away a camera has to be so that a box is in its picture.
import * as THREE from 'three';

/** The corners of a box. */
export function cornersOf(box) {
  return [0, 1, 2, 3, 4, 5, 6, 7].map((i) => new THREE.Vector3(i & 1 ? box.max.x : box.min.x,
    i & 2 ? box.max.y : box.min.y, i & 4 ? box.max.z : box.min.z));
}

/**
 * The distance from the middle of a box, along a direction of unit length from it to the camera, at
 * which all its corners are within that share of the picture, half its height and width.
 */
export function distanceToFit(camera, box, direction, share) {
  const middle = box.getCenter(new THREE.Vector3());
  const right = camera.up.clone().cross(direction).normalize();
  const up = direction.clone().cross(right);
  const tall = Math.tan(camera.fov * Math.PI / 360) * share;
  const wide = tall * camera.aspect;
  return Math.max(...cornersOf(box).map((corner) => {
    const at = corner.sub(middle);
    return at.dot(direction) + Math.max(Math.abs(at.dot(right)) / wide, Math.abs(at.dot(up)) / tall);
  }));
}
