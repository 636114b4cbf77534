// SPDX-License-Identifier: Apache-2.0
// Sets the camera: a view from the front, the side or above, or a camera that moves with a body.
import * as THREE from 'three';

/** The views: name, key, and direction from the robot to the camera; the robot faces along x. */
export const VIEWS = { front: { key: '7', text: 'from the front', from: [1, 0, 0.08] },
  side: { key: '8', text: 'from the right side', from: [0, -1, 0.08] },
  top: { key: '9', text: 'from above', from: [-1e-3, 0, 1] },
  body: { key: '0', text: 'along with the chosen body' } };

const UP = new THREE.Vector3(0, 0, 1);

/** Returns the heading of a body: the angle of its x axis about the vertical, rad. */
function heading(body) {
  const ahead = new THREE.Vector3(1, 0, 0).applyQuaternion(body.quaternion);
  return Math.atan2(ahead.y, ahead.x);
}

/** Returns the center of the robot's bodies: the first nrobot bodies of the scene. */
function middle(scene, nrobot) {
  const box = new THREE.Box3();
  for (const body of scene.robot.bodies.slice(0, nrobot)) box.expandByPoint(body.position);
  return box.getCenter(new THREE.Vector3());
}

export class Camera {
  #ridden = null; // {index, position, heading} of the body that the camera moves with

  /** scene: a Scene; hello: the server's hello message. */
  constructor(scene, hello) {
    this.scene = scene;
    this.nrobot = hello.scene.joints.length + 1;
    scene.moved = () => this.#ride();
  }

  /** Selects a view of VIEWS. index: the chosen body, null = the first body. */
  view(name, index) {
    if (name === 'body') this.#mount(index ?? 0);
    else this.#turn(VIEWS[name].from);
    this.scene.dirty = true;
  }

  /** Moves the camera to a direction in the robot's heading frame; keeps the distance. */
  #turn(from) {
    const { camera, controls, robot } = this.scene;
    const far = camera.position.distanceTo(controls.target);
    this.#ridden = null;
    controls.target.copy(middle(this.scene, this.nrobot));
    camera.position.set(...from).applyAxisAngle(UP, heading(robot.bodies[0])).normalize()
      .multiplyScalar(far).add(controls.target);
    controls.update();
  }

  /** Attaches the camera to a body: it follows the body's position and heading. */
  #mount(index) {
    const body = this.scene.robot.bodies[index];
    this.#ridden = { index, position: body.position.clone(), heading: heading(body) };
    this.scene.controls.target.copy(body.position);
    this.scene.controls.update();
  }

  /** Detaches the camera from a body. */
  free() {
    this.#ridden = null;
  }

  /** Returns whether the camera is attached to a body. */
  get rides() {
    return this.#ridden !== null;
  }

  #ride() {
    if (!this.#ridden) return;
    const { camera, controls, robot } = this.scene;
    const body = robot.bodies[this.#ridden.index];
    const turned = heading(body) - this.#ridden.heading;
    const offset = camera.position.clone().sub(controls.target).applyAxisAngle(UP, turned);
    controls.target.add(body.position.clone().sub(this.#ridden.position));
    camera.position.copy(controls.target).add(offset);
    this.#ridden.position.copy(body.position);
    this.#ridden.heading += turned;
  }
}
