// SPDX-License-Identifier: Apache-2.0
// Shows the visual shapes of the robot's file. Meshes appear as they arrive. Lists missing meshes.
import * as THREE from 'three';
import { place, primitiveGeometry, setShadow } from './solids.js';

const LOADERS = 3; // parallel requests; the server limits its connections
const TRIES = 3;
const AGAIN_MS = 400;

/** Returns a queue for functions that return promises; it runs `lanes` of them in parallel. */
function makeQueue(lanes) {
  const waiting = [];
  let running = 0;
  const next = () => {
    if (running === lanes || !waiting.length) return;
    running++;
    waiting.shift()().finally(() => {
      running--;
      next();
    });
  };
  return (task) => new Promise((resolve, reject) => {
    waiting.push(() => task().then(resolve, reject));
    next();
  });
}

/** Returns the triangles of a binary STL file as a geometry. */
function readStl(buffer) {
  const view = new DataView(buffer);
  const faces = view.getUint32(80, true);
  const corners = new Float32Array(9 * faces);
  for (let face = 0, at = 96, to = 0; face < faces; face++, at += 50) {
    for (let k = 0; k < 9; k++) corners[to++] = view.getFloat32(at + 4 * k, true);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(corners, 3));
  geometry.computeVertexNormals(); // flat shading, because no two faces share a vertex
  geometry.computeBoundingBox();
  return geometry;
}

async function loadPatiently(load, url) {
  for (let tried = 1; ; tried++) {
    try {
      return readStl(await load(url));
    } catch (error) {
      if (!(error instanceof TypeError) || tried === TRIES) throw error; // no answer: retry
      await new Promise((resolve) => { setTimeout(resolve, AGAIN_MS * tried); });
    }
  }
}

/**
 * Adds the visual shapes of hello.scene to the groups of their bodies. makeMaterial(color, body)
 * returns a material; color: RGBA, null = the default of the body. changed(whole) is called after
 * each mesh; whole = true: no mesh is outstanding.
 */
export function makeLooks(visuals, load, places, makeMaterial, changed) {
  const queue = makeQueue(LOADERS);
  const files = new Map(); // geometries by URL, because a robot may use a mesh several times
  const count = places.map(() => ({ all: 0, there: 0, missing: 0 }));
  const lacks = []; // {name, body, reason} of each shape that cannot be shown
  const parts = [];
  let awaited = 0;

  function lose(visual, reason) {
    count[visual.body].missing++;
    lacks.push({ name: visual.name, body: visual.body, reason });
  }

  function show(visual, geometry) {
    const mesh = new THREE.Mesh(geometry, makeMaterial(visual.color, visual.body));
    place(mesh, visual.position_m, visual.quaternion);
    setShadow(mesh);
    places[visual.body].add(mesh);
    parts.push(mesh);
    count[visual.body].there++;
  }

  function fetchMesh(visual) {
    if (!files.has(visual.mesh)) files.set(visual.mesh, queue(() => loadPatiently(load, visual.mesh)));
    awaited++;
    files.get(visual.mesh).then((geometry) => show(visual, geometry),
      (error) => lose(visual, error.message)).then(() => changed(--awaited === 0));
  }

  for (const visual of visuals) {
    count[visual.body].all++;
    if (visual.missing) lose(visual, visual.missing);
    else if (visual.shape === 'mesh') fetchMesh(visual);
    else show(visual, primitiveGeometry(visual));
  }

  return {
    parts,
    lacks,

    /** Returns whether a body shows its visual shapes: at least one is loaded, and none is
     * awaited. */
    covers(body) {
      const { all, there, missing } = count[body];
      return there > 0 && there + missing === all;
    },
  };
}
