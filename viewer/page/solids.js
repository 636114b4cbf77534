// SPDX-License-Identifier: Apache-2.0
// Creates the geometries of shapes, and places shapes in their bodies.
import * as THREE from 'three';

export function place(object, position, quaternion) {
  const [w, x, y, z] = quaternion;
  object.position.fromArray(position);
  object.quaternion.set(x, y, z, w);
  return object;
}

export function setShadow(object) {
  object.traverse((part) => {
    if (part.isMesh) part.castShadow = part.receiveShadow = true;
  });
}

/** Returns the geometry of a primitive shape, null for a mesh. Cylinders and capsules lie along
 * z. */
export function primitiveGeometry(shape) {
  switch (shape.shape) {
    case 'sphere': return new THREE.SphereGeometry(shape.radius_m, 32, 20);
    case 'box': return new THREE.BoxGeometry(...shape.half_extent_m.map((a) => 2 * a));
    case 'capsule':
      return new THREE.CapsuleGeometry(shape.radius_m, shape.length_m, 12, 28).rotateX(Math.PI / 2);
    case 'cylinder':
      return new THREE.CylinderGeometry(shape.radius_m, shape.radius_m, shape.length_m, 36)
        .rotateX(Math.PI / 2);
    default: return null;
  }
}
