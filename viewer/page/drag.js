// SPDX-License-Identifier: Apache-2.0
// A body that is dragged with the pointer: a spring between the point that was taken hold of and the
// pointer pushes it, as in MuJoCo's simulate. The force is a push of the control socket that ends by
// itself when this page no longer renews it.
import * as THREE from 'three';
import { fixed, h, setText } from './dom.js';

const STRETCH_M = 0.5; // of the spring at the robot's weight
const WEIGHTS_MOST = 2; // of the robot: the greatest force
const PERIOD_MS = 33; // between requests
const HOLD_S = 0.3; // of wall time, for which a request lasts
const G = 9.81;

export class Drag {
  #held = null; // {pointer, body, point: in the body, plane, target}
  #asking = false;
  #askedAt = 0;

  /** pace(): virtual seconds a second. */
  constructor(link, hello, scene, { pace, complain }) {
    Object.assign(this, { link, hello, scene, pace, complain });
    this.mode = false; // whether a drag without Ctrl is one of a body
    this.weight = Math.max(1, hello.scene.robot_mass_kg * G);
    this.label = h('output', { class: 'force mono', hidden: true, 'aria-live': 'off' });
    const stage = scene.canvas.parentElement;
    stage.append(this.label);
    stage.addEventListener('pointerdown', (event) => this.#begin(event), { capture: true });
    stage.addEventListener('pointermove', (event) => this.#move(event));
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture']) {
      stage.addEventListener(end, (event) => this.#end(event));
    }
    addEventListener('blur', () => this.release());
  }

  #ray(event) {
    const box = this.scene.canvas.getBoundingClientRect();
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(2 * (event.clientX - box.left) / box.width - 1,
      1 - 2 * (event.clientY - box.top) / box.height), this.scene.camera);
    return ray.ray;
  }

  #begin(event) {
    if (this.#held || event.button !== 0 || !(this.mode || event.ctrlKey)) return;
    const hit = this.scene.hit(event.clientX, event.clientY);
    if (!hit || hit.body === null) return;
    event.stopPropagation(); // or else the camera turns too
    event.preventDefault();
    const body = this.scene.robot.bodies[hit.body];
    const away = this.scene.camera.getWorldDirection(new THREE.Vector3());
    this.scene.canvas.setPointerCapture(event.pointerId);
    this.#held = { pointer: event.pointerId, body: hit.body, point: body.worldToLocal(hit.point.clone()),
      pushed: false, plane: new THREE.Plane().setFromNormalAndCoplanarPoint(away, hit.point), target: hit.point.clone() };
    this.update();
  }

  #move(event) {
    if (this.#held?.pointer !== event.pointerId) return;
    this.#ray(event).intersectPlane(this.#held.plane, this.#held.target);
    this.update();
  }

  #end(event) {
    if (this.#held?.pointer === event.pointerId) this.release();
  }

  /** The point that is held, in the world, and the force on it. */
  #force() {
    const point = this.scene.robot.bodies[this.#held.body].localToWorld(this.#held.point.clone());
    const force = this.#held.target.clone().sub(point).multiplyScalar(this.weight / STRETCH_M)
      .clampLength(0, WEIGHTS_MOST * this.weight);
    return { point, force };
  }

  /** With each state and each move: draws the force and renews the push. */
  update() {
    if (!this.#held) return;
    const { point, force } = this.#force();
    const size = force.length();
    this.scene.showForce(point, force, Math.min(1.2, STRETCH_M * size / this.weight));
    const at = point.clone().project(this.scene.camera);
    const box = this.scene.canvas.getBoundingClientRect();
    this.label.hidden = false;
    this.label.style.left = `${fixed((at.x + 1) / 2 * box.width + 14, 0)}px`;
    this.label.style.top = `${fixed((1 - at.y) / 2 * box.height + 14, 0)}px`;
    setText(this.label, `${fixed(size, 0)} N`);
    if (!this.#asking && (size >= 1 || this.#held.pushed) && performance.now() - this.#askedAt >= PERIOD_MS) {
      this.#held.pushed = true;
      const lever = point.sub(this.scene.robot.bodies[this.#held.body].position);
      this.#push(this.#held.body, force, lever.cross(force), Math.min(10, HOLD_S * Math.max(1, this.pace() || 1)));
    }
  }

  /** Lets go: the force is 0. */
  release() {
    if (!this.#held) return;
    const { body, pushed } = this.#held;
    const none = new THREE.Vector3();
    this.#held = null;
    this.label.hidden = true;
    this.scene.showForce(none, none, 0);
    if (pushed) this.#push(body, none, none, 0);
  }

  async #push(body, force, moment, duration) {
    this.#asking = true;
    this.#askedAt = performance.now();
    try {
      await this.link.ask('push', { body: this.hello.scene.bodies[body].name, force_n: force.toArray(),
        moment_nm: moment.toArray(), duration_s: duration });
    } catch (error) {
      if (this.link.open) this.complain(error.message);
      if (duration > 0) this.release();
    }
    this.#asking = false;
  }
}
