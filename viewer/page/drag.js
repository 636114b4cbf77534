// SPDX-License-Identifier: Apache-2.0
// Drags a body with the pointer. A spring pulls the grabbed point to the pointer, as in MuJoCo's
// simulate. The force is a push request of the control socket. A push expires if it is not renewed.
import * as THREE from 'three';
import { fixed, h, setText } from './dom.js';

const STRETCH_M = 0.5; // stretch of the spring at which its force equals the robot's weight
const WEIGHTS_MOST = 2; // maximum force, in weights of the robot
const PERIOD_MS = 33; // time between push requests
const HOLD_S = 0.3; // duration of one push, in wall-clock time
const G = 9.81;

export class Drag {
  #held = null; // {pointer, body, point: in the body, plane, target}
  #asking = false;
  #askedAt = 0;

  /** pace() returns virtual seconds per second. */
  constructor(link, hello, scene, { pace, complain }) {
    Object.assign(this, { link, hello, scene, pace, complain });
    this.mode = false; // true: a drag moves a body also without Ctrl
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
    event.stopPropagation(); // otherwise the camera turns too
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

  /** Returns the grabbed point in the world (m) and the force on it (N). */
  #force() {
    const point = this.scene.robot.bodies[this.#held.body].localToWorld(this.#held.point.clone());
    const force = this.#held.target.clone().sub(point).multiplyScalar(this.weight / STRETCH_M)
      .clampLength(0, WEIGHTS_MOST * this.weight);
    return { point, force };
  }

  /** Draws the force and renews the push. Call it after each state and each pointer move. */
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

  /** Releases the body: the force becomes 0. */
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
