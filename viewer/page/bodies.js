// SPDX-License-Identifier: Apache-2.0
// Builds the solids of a scene's bodies. A body with visual shapes in its file shows those. Other
// bodies show their collision shapes: meshes, capsules, boxes and spheres. Joints are drums, with
// bones between them. A body without shapes is a box of equal inertia.
import * as THREE from 'three';
import { makeLooks } from './looks.js';
import { place, primitiveGeometry, setShadow } from './solids.js';

const SKIN = {
  light: { shell: 0xdfe4ea, metal: 0x5b6673, drum: 0x323a45, free: 0xc69a5b, world: 0xb9c0ca },
  dark: { shell: 0xc3cbd6, metal: 0x75818f, drum: 0x414b58, free: 0xb98a4a, world: 0x3a4452 },
};
const CALM = new THREE.Color(0x2f9e6e);
const WARM = new THREE.Color(0xe0a526);
const HOT = new THREE.Color(0xd1372c);

const vector = (array) => new THREE.Vector3(...array);

/** Returns a mesh: the box of uniform density with the body's principal moments of inertia. */
function equivalentBox(body, material) {
  const [xx, , , yy, , zz] = body.inertia_kg_m2;
  const mass = body.mass_kg;
  const side = (a, b, c) => Math.sqrt(Math.max(6 * (a + b - c) / mass, 1e-6));
  const mesh = new THREE.Mesh(new THREE.BoxGeometry(side(yy, zz, xx), side(xx, zz, yy),
    side(xx, yy, zz)), material);
  mesh.position.fromArray(body.com_m);
  return mesh;
}

/** Returns a mesh: the ellipsoid of uniform density with the body's moments about its axes. */
function inertiaEllipsoid(body, material) {
  const [xx, , , yy, , zz] = body.inertia_kg_m2;
  const axis = (a, b, c) => Math.sqrt(Math.max(2.5 * (a + b - c) / body.mass_kg, 1e-6));
  const mesh = new THREE.Mesh(new THREE.SphereGeometry(1, 20, 14), material);
  mesh.scale.set(axis(yy, zz, xx), axis(xx, zz, yy), axis(xx, yy, zz));
  mesh.position.fromArray(body.com_m);
  return mesh;
}

async function meshGeometry(load, url) {
  const buffer = await load(url);
  const [nvertex, nface] = new Uint32Array(buffer, 0, 2);
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(
    new Float32Array(buffer, 8, 3 * nvertex), 3));
  geometry.setIndex(new THREE.BufferAttribute(
    new Uint32Array(buffer, 8 + 12 * nvertex, 3 * nface), 1));
  // Separate the vertices of the faces, so that edges stay sharp
  const flat = geometry.toNonIndexed();
  flat.computeVertexNormals();
  return flat;
}

/** Returns the material of a solid. matt: a cheaper shader, for drawing without a graphics card. */
export function makeSkin(matt, roughness, metalness, other) {
  return matt ? new THREE.MeshLambertMaterial(other)
    : new THREE.MeshStandardMaterial({ roughness, metalness, ...other });
}

export function makeBodies(hello, loadMesh, changed, matt) {
  const { bodies, joints, shapes } = hello.scene;
  const standard = (roughness, metalness) => makeSkin(matt, roughness, metalness);
  const material = { shell: standard(0.55, 0.05), metal: standard(0.4, 0.5),
    drum: standard(0.45, 0.35), free: standard(0.8, 0), world: standard(0.95, 0) };
  const glass = makeSkin(matt, 0.6, 0, { color: 0x2f81f7, transparent: true, opacity: 0.45,
    depthWrite: false });
  const group = new THREE.Group();
  const places = bodies.map((body, index) => {
    const object = new THREE.Group();
    object.userData.body = index;
    group.add(object);
    return object;
  });
  const nrobot = joints.length + 1;
  const solids = [];
  const glasses = [];
  const drums = [];
  const shaped = new Set();
  const width = new Map(); // width of each body's capsules

  // Collision shapes of the description
  for (const shape of shapes) {
    if (shape.shape === 'half_space') continue;
    const owner = shape.body < 0 ? group : places[shape.body];
    const skin = shape.body < 0 ? material.world
      : shape.body >= nrobot ? material.free : material.shell;
    const mesh = new THREE.Mesh(primitiveGeometry(shape) ?? new THREE.BufferGeometry(), skin);
    place(mesh, shape.position_m, shape.quaternion);
    setShadow(mesh);
    owner.add(mesh);
    shaped.add(shape.body);
    if (shape.body >= 0) solids.push(mesh);
    if (shape.shape === 'capsule') {
      width.set(shape.body, Math.max(width.get(shape.body) ?? 0, shape.radius_m));
    }
    if (shape.mesh) {
      meshGeometry(loadMesh, shape.mesh).then((geometry) => {
        mesh.geometry = geometry;
        changed();
      }).catch(() => {});
    }
  }

  // A drum for each joint, on the body that the joint moves, and bones between bodies
  joints.forEach((joint, j) => {
    const body = bodies[joint.body];
    const size = Math.min(0.036, 0.016 + 0.012 * Math.cbrt(body.mass_kg));
    const own = material.drum.clone();
    const wide = Math.min(0.075, Math.max(width.get(joint.body) ?? 0, size));
    const drum = new THREE.Mesh(joint.type === 'revolute'
      ? new THREE.CylinderGeometry(size, size, 2 * wide + 0.016, 28)
      : new THREE.BoxGeometry(size, 2.5 * size, size), own);
    drum.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), vector(joint.axis));
    drum.userData.joint = j;
    setShadow(drum);
    places[joint.body].add(drum);
    drums.push(drum);
  });
  bodies.forEach((body, index) => {
    if (!shaped.has(index) && index >= nrobot) {
      const box = equivalentBox(body, material.free);
      setShadow(box);
      places[index].add(box);
    }
    const ellipsoid = inertiaEllipsoid(body, glass);
    ellipsoid.visible = false;
    places[index].add(ellipsoid);
    glasses.push(ellipsoid);
  });
  const bones = joints.map((joint) => {
    const parent = bodies[joint.body].parent;
    const bone = new THREE.Mesh(new THREE.CylinderGeometry(0.014, 0.014, 1, 14).translate(0, 0.5, 0),
      material.metal);
    bone.userData = { body: parent, child: joint.body };
    setShadow(bone);
    group.add(bone);
    return bone;
  });

  // Visual shapes of the robot's file, in their own colors or in the color of the body's skin
  const painted = []; // {skin, own, body}
  const paint = (color, body) => {
    if (!color) return skins[body];
    const own = new THREE.Color().setRGB(color[0], color[1], color[2], THREE.SRGBColorSpace);
    const skin = makeSkin(matt, 0.55, 0.05, { color: own, transparent: color[3] < 1, opacity: color[3] });
    painted.push({ skin, own, body });
    return skin;
  };

  let marked = null;
  // Each body of the robot has its own skin, colored by the torque of the body's joint
  const skins = bodies.map((_, i) => i < nrobot ? material.shell.clone() : material.free);
  const skinOf = (mesh) => skins[mesh.parent.userData.body];
  for (const solid of solids) solid.material = skinOf(solid);
  const looks = makeLooks(hello.scene.visuals ?? [], loadMesh, places, paint, (whole) => changed(whole));

  /** Sets a color for `part`, the torque as a share of the joint's limit. */
  function tint(color, calm, part) {
    if (part < 0.35) color.lerpColors(calm, WARM, part / 0.35);
    else color.lerpColors(WARM, HOT, (part - 0.35) / 0.65);
  }

  return {
    group,
    bodies: places,
    lacks: looks.lacks,
    parts: looks.parts,

    /** Returns the bounding box, in the world, of the visible bodies. */
    bounds() {
      const box = new THREE.Box3();
      group.updateMatrixWorld(true);
      for (const body of places) box.expandByPoint(body.position);
      for (const part of [...solids, ...looks.parts]) {
        if (part.visible) box.expandByObject(part);
      }
      return box;
    },

    setTheme(theme) {
      for (const [name, color] of Object.entries(SKIN[theme])) material[name].color.set(color);
      for (const drum of drums) drum.material.color.copy(material.drum.color);
      skins[0].color.copy(material.shell.color);
    },

    /** Highlights the chosen body; null = none. */
    mark(index) {
      marked = index;
      const shine = (skin, i) => {
        skin.emissive.set(i === index ? 0x1f6feb : 0);
        skin.emissiveIntensity = 0.5;
      };
      skins.slice(0, nrobot).forEach(shine);
      for (const { skin, body } of painted) shine(skin, body);
      changed();
    },

    centerOfMass() {
      const center = new THREE.Vector3();
      let mass = 0;
      for (let i = 0; i < nrobot; i++) {
        const at = vector(bodies[i].com_m).applyQuaternion(places[i].quaternion)
          .add(places[i].position);
        center.addScaledVector(at, bodies[i].mass_kg);
        mass += bodies[i].mass_kg;
      }
      return mass > 0 ? center.divideScalar(mass) : null;
    },

    update(state, show) {
      places.forEach((object, i) => {
        const [x, y, z, qw, qx, qy, qz] = state.bodies.subarray(7 * i, 7 * i + 7);
        object.position.set(x, y, z);
        object.quaternion.set(qx, qy, qz, qw);
      });
      const covered = places.map((_, i) => show.visuals && !show.skeleton && looks.covers(i));
      for (const bone of bones) {
        const from = places[bone.userData.body].position;
        const way = places[bone.userData.child].position.clone().sub(from);
        const length = way.length();
        bone.visible = length > 0.02 && !covered[bone.userData.child];
        if (bone.visible) {
          bone.position.copy(from);
          bone.scale.set(1, length, 1);
          bone.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), way.divideScalar(length));
        }
      }
      const loads = []; // for each body: torque of its joint as a share of the limit
      drums.forEach((drum, j) => {
        const limit = joints[j].torque_limit_nm || 50;
        const part = Math.min(1, Math.abs(state.joints[2 * j + 1]) / limit);
        const skin = skins[joints[j].body];
        drum.visible = !covered[joints[j].body];
        tint(drum.material.color, CALM, part);
        tint(skin.color, material.shell.color, part);
        if (!show.torques) {
          drum.material.color.copy(material.drum.color);
          skin.color.copy(material.shell.color);
        }
        loads[joints[j].body] = show.torques ? part : 0;
      });
      for (const { skin, own, body } of painted) tint(skin.color, own, loads[body] ?? 0);
      for (const solid of solids) {
        const { body } = solid.parent.userData;
        if (body < nrobot) solid.visible = !show.skeleton && !covered[body];
      }
      for (const part of looks.parts) part.visible = show.visuals && !show.skeleton;
      for (const part of glasses) {
        part.visible = show.skeleton && part.parent.userData.body < nrobot;
      }
      if (marked !== null && marked >= places.length) marked = null;
    },
  };
}
