// SPDX-License-Identifier: Apache-2.0
// The three-dimensional view: robot, surroundings, forces, centers of mass and pressure.
import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { makeBodies, makeSkin } from './bodies.js';
import { distanceToFit } from './framing.js';

const COLORS = {
  light: { sky: 0xf4f6f9, ground: 0xe9ecf1, line: 0xc3cad4, strong: 0x9aa4b2 },
  dark: { sky: 0x10151c, ground: 0x1a212b, line: 0x35404e, strong: 0x546172 },
};
const FORCE = 0x2f81f7;
const PUSH = 0xe0552b;
const CENTER = 0xd9a514;
const UP = new THREE.Vector3(0, 0, 1);

const GROUND_M = 12;
const CELL_M = 0.5;

/** Returns the ground's texture: squares of 0.5 m, each divided into four. Shadows fall on it. */
function makeSquares(colors, anisotropy) {
  const canvas = document.createElement('canvas');
  const size = 512;
  const pen = canvas.getContext('2d');
  const css = (color) => `#${color.toString(16).padStart(6, '0')}`;
  canvas.width = canvas.height = size;
  pen.fillStyle = css(colors.ground);
  pen.fillRect(0, 0, size, size);
  for (const [at, color, width] of [[size / 2, colors.line, 3], [0, colors.strong, 5], [size, colors.strong, 5]]) {
    pen.strokeStyle = css(color);
    pen.lineWidth = width;
    pen.beginPath();
    pen.moveTo(at, 0);
    pen.lineTo(at, size);
    pen.moveTo(0, at);
    pen.lineTo(size, at);
    pen.stroke();
  }
  const texture = new THREE.CanvasTexture(canvas);
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.repeat.set(2 * GROUND_M / CELL_M, 2 * GROUND_M / CELL_M);
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.anisotropy = anisotropy;
  return texture;
}

/** Returns an arrow of unit length along +z. */
function makeArrow(color) {
  const material = new THREE.MeshBasicMaterial({ color, depthTest: false, transparent: true,
    opacity: 0.9 });
  const shaft = new THREE.Mesh(new THREE.CylinderGeometry(0.007, 0.007, 1, 12), material);
  const head = new THREE.Mesh(new THREE.ConeGeometry(0.02, 0.05, 16), material);
  const arrow = new THREE.Group();
  shaft.geometry.rotateX(Math.PI / 2).translate(0, 0, 0.5);
  head.geometry.rotateX(Math.PI / 2);
  arrow.add(shaft, head);
  shaft.renderOrder = head.renderOrder = 4;
  arrow.userData = { shaft, head };
  arrow.visible = false;
  return arrow;
}

function pointArrow(arrow, from, vector, length) {
  arrow.visible = length > 0.004;
  if (!arrow.visible) return;
  arrow.position.copy(from);
  arrow.quaternion.setFromUnitVectors(UP, vector.clone().normalize());
  arrow.userData.shaft.scale.set(1, 1, length);
  arrow.userData.head.position.set(0, 0, length);
}

/** Returns whether this browser draws without a graphics card. */
function drawsBySoftware() {
  const gl = document.createElement('canvas').getContext('webgl2');
  const names = gl?.getExtension('WEBGL_debug_renderer_info');
  const name = gl?.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER) ?? '';
  gl?.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

export class Scene {
  show = { forces: true, centers: true, torques: true, skeleton: false, follow: true, visuals: true };

  /** quality: 'high' = best picture at any cost; 'low' = for slow machines; else automatic. */
  constructor(canvas, hello, loadMesh, quality) {
    this.canvas = canvas;
    this.hello = hello;
    this.patient = quality === 'high';
    this.slowest = quality === 'low';
    const context = this.#makeContext();
    this.plain = this.slowest || (this.software && !this.patient);
    this.renderer = new THREE.WebGLRenderer({ canvas, context });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(34, 1, 0.05, 60);
    this.camera.up.copy(UP);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener('change', () => { this.dirty = true; });
    this.controls.addEventListener('start', () => { this.touched = true; });
    this.target = new THREE.Vector3();
    this.#makeLights();
    this.#makeGround();
    this.robot = makeBodies(hello, loadMesh, (whole) => this.#take(whole), this.plain);
    this.scene.add(this.robot.group);
    this.#makeMarks();
    new ResizeObserver(() => this.#resize()).observe(canvas.parentElement);
    this.#resize();
  }

  /** Creates the renderer. Without a graphics card, antialiasing is off, because it is too slow. */
  #makeContext() {
    this.software = drawsBySoftware();
    return this.canvas.getContext('webgl2', { alpha: true, stencil: false,
      antialias: !this.software || this.patient });
  }

  #makeLights() {
    this.sun = new THREE.DirectionalLight(0xffffff, 2.2); // shadows: after first picture
    this.sun.shadow.mapSize.set(1024, 1024);
    this.sun.shadow.bias = -0.0006;
    this.sun.shadow.normalBias = 0.01;
    Object.assign(this.sun.shadow.camera, { left: -1.6, right: 1.6, top: 1.6, bottom: -1.6,
      near: 0.5, far: 9 });
    this.scene.add(this.sun, this.sun.target, new THREE.HemisphereLight(0xffffff, 0x8a93a0, 1.5));
  }

  /** Handles newly loaded shapes. whole: all are loaded; fits the view, unless the user has moved
   * it. */
  #take(whole) {
    this.dirty = true;
    if (whole && !this.touched) this.framed = false;
    if (this.state) this.update(this.state);
    if (whole) this.loaded?.();
  }

  /** Creates the scene's ground, or a floor below a robot with a fixed base. */
  #makeGround() {
    const plane = this.hello.scene.shapes.find((s) => s.shape === 'half_space' && s.body < 0);
    this.ground = new THREE.Group();
    this.firm = Boolean(plane);
    this.ground.visible = this.firm || !this.hello.scene.floating;
    this.floor = new THREE.Mesh(new THREE.CircleGeometry(GROUND_M, 64),
      makeSkin(this.plain, 1, 0));
    this.floor.receiveShadow = true;
    this.ground.add(this.floor);
    if (plane) {
      const [w, x, y, z] = plane.quaternion;
      this.ground.position.fromArray(plane.position_m);
      this.ground.quaternion.set(x, y, z, w);
    }
    this.scene.add(this.ground);
  }

  #makeMarks() {
    const group = new THREE.Group();
    const gold = new THREE.MeshBasicMaterial({ color: CENTER });
    this.arrows = this.hello.scene.contacts.map(() => makeArrow(FORCE));
    this.pressure = this.hello.scene.contacts.map(() => new THREE.Mesh(
      new THREE.RingGeometry(0.008, 0.014, 24), new THREE.MeshBasicMaterial({ color: FORCE,
        side: THREE.DoubleSide, depthTest: false, transparent: true })));
    this.push = makeArrow(PUSH);
    this.com = new THREE.Mesh(new THREE.SphereGeometry(0.016, 20, 14), gold);
    this.com.material.depthTest = false;
    this.com.renderOrder = 5;
    this.shadow = new THREE.Mesh(new THREE.RingGeometry(0.014, 0.02, 32),
      new THREE.MeshBasicMaterial({ color: CENTER, side: THREE.DoubleSide }));
    this.plumb = new THREE.Line(new THREE.BufferGeometry().setFromPoints(
      [new THREE.Vector3(), new THREE.Vector3()]),
    new THREE.LineDashedMaterial({ color: CENTER, dashSize: 0.02, gapSize: 0.015 }));
    group.add(...this.arrows, ...this.pressure, this.push, this.com, this.shadow, this.plumb);
    this.marks = group;
    this.scene.add(group);
  }

  setTheme(theme) {
    const colors = COLORS[theme];
    this.scene.background = new THREE.Color(colors.sky);
    this.#makeFog();
    this.floor.material.map?.dispose();
    this.floor.material.map = makeSquares(colors, this.renderer.capabilities.getMaxAnisotropy());
    this.floor.material.needsUpdate = true;
    this.robot.setTheme(theme);
    this.dirty = true;
  }

  #resize() {
    const box = this.canvas.parentElement.getBoundingClientRect();
    const width = Math.max(2, Math.floor(box.width));
    const height = Math.max(2, Math.floor(box.height));
    this.renderer.setPixelRatio(this.plain ? 1 : Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.dirty = true;
  }

  /** Sets the first view: the whole robot, from the front left. */
  #frame() {
    const box = this.robot.bounds().expandByScalar(0.02);
    const direction = new THREE.Vector3(0.82, -0.62, 0.28).normalize();
    const far = Math.max(0.4, distanceToFit(this.camera, box, direction, 0.84));
    box.getCenter(this.target);
    this.controls.target.copy(this.target);
    this.camera.position.copy(this.target).addScaledVector(direction, far);
    this.#suitSize(far, box);
    this.controls.update(); // turns the camera before the first picture
    this.base = this.#basePosition();
  }

  /** Scales the view to the robot's size: clipping depths, fog, range of shadows, size of the
   * ground. */
  #suitSize(far, box) {
    const reach = Math.max(1.6, 0.6 * box.getSize(new THREE.Vector3()).length());
    this.camera.near = Math.min(0.05, 0.02 * far);
    this.camera.far = Math.max(60, 20 * far);
    this.camera.updateProjectionMatrix();
    this.far = far;
    this.#makeFog();
    Object.assign(this.sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach,
      near: 0.3 * reach, far: 6 * reach });
    this.sun.shadow.camera.updateProjectionMatrix();
    this.height = 2.1 * reach; // height of the sun
    this.floor.scale.setScalar(Math.max(1, Math.ceil(far / 3)));
    if (!this.firm) this.ground.position.z = Math.min(0, box.min.z) - 0.001;
  }

  #makeFog() {
    const far = this.far ?? 0;
    this.scene.fog = new THREE.Fog(this.scene.background, Math.max(3.5, 1.6 * far), Math.max(9, 4 * far));
  }

  /** Moves the floor with the view, by whole squares of its pattern; fog hides its edge. */
  #placeFloor() {
    const at = this.ground.worldToLocal(this.controls.target.clone());
    const cell = CELL_M * this.floor.scale.x;
    this.floor.position.set(cell * Math.round(at.x / cell), cell * Math.round(at.y / cell), 0);
  }

  #basePosition() {
    return this.robot.bodies.length ? this.robot.bodies[0].position.clone() : new THREE.Vector3();
  }

  #follow() {
    const now = this.#basePosition();
    if (this.base && this.show.follow) {
      const by = now.clone().sub(this.base);
      by.z *= 0.35;
      this.controls.target.add(by);
      this.camera.position.add(by);
    }
    this.base = now;
    this.sun.position.copy(this.controls.target).add(new THREE.Vector3(0.35, -0.47, 1)
      .multiplyScalar(this.height ?? 3.4));
    this.sun.target.position.copy(this.controls.target);
  }

  /** Returns the center of pressure of a contact wrench: near the ground, the ground's point
   * without tangential moment. Otherwise returns the point of the wrench's axis nearest to the
   * body. */
  #pressureCenter(body, force, moment) {
    const square = force.lengthSq();
    const at = force.clone().cross(moment).divideScalar(square).add(body.position);
    if (this.firm) {
      const normal = UP.clone().applyQuaternion(this.ground.quaternion);
      const slope = force.dot(normal);
      const height = normal.dot(body.position.clone().sub(this.ground.position));
      if (Math.abs(slope) > 0.2 * Math.sqrt(square) && height < 0.3) {
        const lever = normal.clone().multiplyScalar(height);
        const turning = lever.clone().cross(force).add(moment);
        at.copy(body.position).sub(lever).addScaledVector(normal.clone().cross(turning), 1 / slope);
      }
    }
    return at.distanceTo(body.position) < 0.6 ? at : body.position.clone();
  }

  #placeForces(state) {
    const weight = Math.max(1, this.hello.scene.robot_mass_kg * 9.81);
    for (const arrow of this.arrows) arrow.visible = false;
    for (const ring of this.pressure) ring.visible = false;
    if (!this.show.forces) return;
    for (const { index, wrench } of state.contacts) {
      const body = this.robot.bodies[this.hello.scene.contacts[index].body];
      const force = new THREE.Vector3(...wrench.subarray(0, 3));
      const at = this.#pressureCenter(body, force, new THREE.Vector3(...wrench.subarray(3, 6)));
      const length = Math.min(0.9, 0.42 * force.length() / weight);
      pointArrow(this.arrows[index], at, force, length);
      this.pressure[index].visible = length > 0.004;
      this.pressure[index].position.copy(at).addScaledVector(UP, 0.002);
    }
  }

  #placeCenter() {
    const center = this.robot.centerOfMass();
    const points = this.plumb.geometry.attributes.position;
    const visible = this.show.centers && center !== null;
    this.com.visible = visible;
    this.plumb.visible = this.shadow.visible = visible && this.ground.visible;
    if (!visible) return;
    this.com.position.copy(center);
    this.shadow.position.set(center.x, center.y, this.ground.position.z + 0.003);
    points.setXYZ(0, center.x, center.y, center.z);
    points.setXYZ(1, center.x, center.y, this.ground.position.z);
    points.needsUpdate = true;
    this.plumb.computeLineDistances();
  }

  /** Draws a force at a point of the world as an arrow of this length (m); 0 = none. */
  showForce(point, force, length) {
    pointArrow(this.push, point, force, length);
    this.dirty = true;
  }

  /** Draws the preview of a push: an arrow at the body. body: null = none. */
  showPush(body, force) {
    const vector = new THREE.Vector3(...(force ?? [0, 0, 0]));
    if (body === null) this.push.visible = false;
    else {
      pointArrow(this.push, this.robot.bodies[body].position, vector,
        Math.min(0.8, vector.length() / 300 + 0.08) * (vector.length() > 0));
    }
    this.dirty = true;
  }

  update(state) {
    this.state = state;
    this.robot.update(state, this.show);
    if (!this.framed) {
      this.#frame();
      this.framed = true;
    }
    this.#follow();
    this.moved?.();
    this.#placeFloor();
    this.#placeForces(state);
    this.#placeCenter();
    this.dirty = true;
  }

  /** Reduces the quality: no shadows, low resolution, 5 pictures per second. */
  #hurry() {
    this.plain = true;
    this.sun.castShadow = false;
    this.renderer.setPixelRatio(1);
    this.period = 200;
    this.hurried?.();
  }

  /** Adds shadows after the first picture; their shaders are compiled in the background. */
  async #finishFirst() {
    this.firstDrawn = performance.now(); // ms since the page was requested
    if (this.slowest) this.#hurry();
    if (this.plain) return;
    this.preparing = true;
    this.sun.castShadow = true;
    await this.renderer.compileAsync(this.scene, this.camera);
    this.preparing = false;
    this.dirty = true;
  }

  /** Returns whether the first picture is not finished. A second one would delay it. */
  #waitsForFirst() {
    if (!this.drawn || this.firstDrawn) return false;
    const gl = this.renderer.getContext();
    this.fence ??= gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    if (gl.getSyncParameter(this.fence, gl.SYNC_STATUS) !== gl.SIGNALED) return true;
    gl.deleteSync(this.fence);
    this.#finishFirst();
    return false;
  }

  /** Measures the time per picture, and reduces the quality if drawing is slow. */
  #judgeSpeed(now) {
    const took = now - (this.drawnAt ?? now);
    this.drawnAt = now;
    this.slow = took > 90 && took < 2000 ? (this.slow ?? 0) + 1 : 0;
    if (this.slow > 6 && !this.patient && !this.period) this.#hurry();
  }

  /** Draws a state if the state or the view has changed. */
  draw(now, state) {
    this.controls.update();
    if (this.#waitsForFirst() || this.preparing) return;
    if (now - (this.drawnAt ?? -Infinity) < (this.period ?? 0)) return;
    if (state !== this.state) this.update(state);
    if (this.dirty) {
      this.#judgeSpeed(now);
      this.renderer.render(this.scene, this.camera);
      this.dirty = false;
      this.drawn = (this.drawn ?? 0) + 1;
    }
  }

  /** Returns the robot's body and point at a position of the canvas; null = nothing. */
  hit(x, y) {
    const box = this.canvas.getBoundingClientRect();
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(2 * (x - box.left) / box.width - 1,
      1 - 2 * (y - box.top) / box.height), this.camera);
    const hit = ray.intersectObject(this.robot.group, true)[0];
    for (let object = hit?.object; object; object = object.parent) {
      if (object.userData.body !== undefined) return { body: object.userData.body, point: hit.point };
    }
    return null;
  }

  /** Returns the index of the body at a position of the canvas; null = none. */
  pick(x, y) {
    return this.hit(x, y)?.body ?? null;
  }

  reset() {
    this.framed = this.touched = false;
  }
}
