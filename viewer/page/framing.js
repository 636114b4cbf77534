// SPDX-License-Identifier: Apache-2.0
// Computes the camera distance at which a box fits into the picture.
import * as THREE from 'three';

/** Returns the corners of a box. */
export function cornersOf(box) {
  return [0, 1, 2, 3, 4, 5, 6, 7].map((i) => new THREE.Vector3(i & 1 ? box.max.x : box.min.x,
    i & 2 ? box.max.y : box.min.y, i & 4 ? box.max.z : box.min.z));
}

/**
 * Returns the distance between the center of a box and the camera at which the box fits.
 * direction: unit vector from the box to the camera. share: the part of the picture's half height
 * and half width that the corners may use.
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
