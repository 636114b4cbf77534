// SPDX-License-Identifier: Apache-2.0
// Where the robot is looked at from: from the front, the side, above, or along with a body.
import * as THREE from 'three';

/** Names, keys, and where the camera is, seen from a robot that looks along x. */
export const VIEWS = { front: { key: '7', text: 'from the front', from: [1, 0, 0.08] },
  side: { key: '8', text: 'from the right side', from: [0, -1, 0.08] },
  top: { key: '9', text: 'from above', from: [-1e-3, 0, 1] },
  body: { key: '0', text: 'along with the chosen body' } };

const UP = new THREE.Vector3(0, 0, 1);

/** The heading of a body: the angle of its x axis about the vertical. */
function heading(body) {
  const ahead = new THREE.Vector3(1, 0, 0).applyQuaternion(body.quaternion);
  return Math.atan2(ahead.y, ahead.x);
}

/** The middle of the robot's bodies, of which it has so many. */
function middle(scene, nrobot) {
  const box = new THREE.Box3();
  for (const body of scene.robot.bodies.slice(0, nrobot)) box.expandByPoint(body.position);
  return box.getCenter(new THREE.Vector3());
}

export class Camera {
  #ridden = null; // {index, position, heading} of the body that the camera goes along with

  /** scene: a Scene; hello: the description. */
  constructor(scene, hello) {
    this.scene = scene;
    this.nrobot = hello.scene.joints.length + 1;
    scene.moved = () => this.#ride();
  }

  /** One of VIEWS; index: the chosen body, null = the first one. */
  view(name, index) {
    if (name === 'body') this.#mount(index ?? 0);
    else this.#turn(VIEWS[name].from);
    this.scene.dirty = true;
  }

  /** Looks at the robot from a side of its own, as far away as before. */
  #turn(from) {
    const { camera, controls, robot } = this.scene;
    const far = camera.position.distanceTo(controls.target);
    this.#ridden = null;
    controls.target.copy(middle(this.scene, this.nrobot));
    camera.position.set(...from).applyAxisAngle(UP, heading(robot.bodies[0])).normalize()
      .multiplyScalar(far).add(controls.target);
    controls.update();
  }

  /** The camera keeps its place beside a body that moves and turns. */
  #mount(index) {
    const body = this.scene.robot.bodies[index];
    this.#ridden = { index, position: body.position.clone(), heading: heading(body) };
    this.scene.controls.target.copy(body.position);
    this.scene.controls.update();
  }

  /** Back to where the scene puts it. */
  free() {
    this.#ridden = null;
  }

  /** Whether the camera goes along with a body, and not with the base. */
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
