// SPDX-License-Identifier: Apache-2.0
// usage: page_visual.mjs COMAN-HIL [FOLDER] — an arm (URDF) and a legged robot (MJCF) are imported and
// shown: their meshes have the color that they should where they should, all of them is in the
// picture, and what is missing is named. Prints TAP; pictures go to FOLDER.
import { spawnSync } from 'node:child_process';
import { mkdirSync, readdirSync, truncateSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { begin, check, test, WAIT_MS } from './browser.mjs';

const [program, folder] = process.argv.slice(2);
const TESTS = 20;
const PATIENCE_MS = 2 * WAIT_MS; // four pages, each with meshes, drawn by the processor

// ---- meshes whose answer is known ----

const CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]];
const SIDES = { '-z': [0, 2, 3, 1], '+z': [4, 5, 7, 6], '-y': [0, 1, 5, 4], '+y': [2, 6, 7, 3],
  '-x': [0, 4, 6, 2], '+x': [1, 3, 7, 5] };

/** The corners of a box between two points. */
function boxCorners(low, high) {
  return CORNERS.map((corner) => corner.map((far, m) => (far ? high[m] : low[m])));
}

function stlOf(low, high) {
  const corners = boxCorners(low, high);
  const faces = Object.values(SIDES).flatMap(([a, b, c, d]) => [[a, b, c], [a, c, d]]);
  const data = Buffer.alloc(84 + 50 * faces.length);
  data.writeUInt32LE(faces.length, 80);
  faces.forEach((face, f) => face.forEach((corner, k) => corners[corner].forEach((value, m) =>
    data.writeFloatLE(value, 84 + 50 * f + 12 + 12 * k + 4 * m))));
  return data;
}

function objOf(low, high, library, material) {
  return [`mtllib ${library}`, ...boxCorners(low, high).map((corner) => `v ${corner.join(' ')}`),
    `usemtl ${material}`, ...Object.values(SIDES).map((side) => `f ${side.map((i) => i + 1).join(' ')}`), '']
    .join('\n');
}

/** A cube of two units in centimeters, Y up as a file may say, green where its own y is least, else
 * yellow; a node stretches it to 3, 5 and 10, turns it about z by a right angle and lifts it by 10. */
const DAE = `<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="cm" meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_effects>
<effect id="ge"><profile_COMMON><technique sid="t"><lambert><diffuse><color>0 0.7 0 1</color></diffuse></lambert></technique></profile_COMMON></effect>
<effect id="ye"><profile_COMMON><technique sid="t"><phong><diffuse><color>0.9 0.8 0 1</color></diffuse></phong></technique></profile_COMMON></effect>
</library_effects>
<library_materials><material id="g"><instance_effect url="#ge"/></material><material id="y"><instance_effect url="#ye"/></material></library_materials>
<library_geometries><geometry id="c"><mesh><source id="s"><float_array id="a" count="24">
${boxCorners([-1, -1, -1], [1, 1, 1]).flat().join(' ')}</float_array>
<technique_common><accessor source="#a" count="8" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<polylist material="one" count="1"><input semantic="VERTEX" source="#v" offset="0"/><vcount>4</vcount><p>${SIDES['-y'].join(' ')}</p></polylist>
<polylist material="two" count="5"><input semantic="VERTEX" source="#v" offset="0"/><vcount>4 4 4 4 4</vcount><p>
${Object.entries(SIDES).filter(([side]) => side !== '-y').map(([, corners]) => corners.join(' ')).join(' ')}</p></polylist>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="x"><node><translate>0 0 10</translate><rotate>0 0 1 90</rotate><scale>3 5 10</scale>
<instance_geometry url="#c"><bind_material><technique_common><instance_material symbol="one" target="#g"/>
<instance_material symbol="two" target="#y"/></technique_common></bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#x"/></scene></COLLADA>
`;

// ---- robots ----

const INERTIAL = (z) => `<inertial><origin xyz="0 0 ${z}"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>`;
const JOINT = (name, parent, child, z) => `<joint name="${name}" type="revolute"><parent link="${parent}"/><child link="${child}"/>
<origin xyz="0 0 ${z}"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="60" velocity="4"/></joint>`;

/** 1.16 m tall: a box, an STL in mm, a DAE in cm, an OBJ that lies along x, a mesh that is not there. */
const ARM = `<robot name="arm"><material name="sea"><color rgba="0.1 0.2 0.9 1"/></material>
<link name="base">${INERTIAL(0.05)}<visual><origin xyz="0 0 0.05"/><geometry><box size="0.2 0.2 0.1"/></geometry><material name="sea"/></visual></link>
<link name="lower">${INERTIAL(0.2)}<visual><geometry><mesh filename="meshes/lower.stl" scale="0.001 0.001 0.001"/></geometry>
<material name=""><color rgba="0.8 0.05 0.05 1"/></material></visual></link>
<link name="elbow">${INERTIAL(0.1)}<visual><geometry><mesh filename="meshes/elbow.dae"/></geometry></visual></link>
<link name="upper">${INERTIAL(0.2)}<visual><origin xyz="0.02 0 0" rpy="0 -1.5707963267948966 0"/><geometry><mesh filename="meshes/upper.obj"/></geometry>
<material name="sea"/></visual></link>
<link name="hand">${INERTIAL(0.03)}<visual><geometry><mesh filename="meshes/gone.stl"/></geometry></visual>
<collision><origin xyz="0 0 0.03"/><geometry><box size="0.06 0.06 0.06"/></geometry></collision></link>
${JOINT('j1', 'base', 'lower', 0.1)}${JOINT('j2', 'lower', 'elbow', 0.4)}${JOINT('j3', 'elbow', 'upper', 0.2)}${JOINT('j4', 'upper', 'hand', 0.4)}
</robot>
`;

const LEG = (name, x, y) => `<body name="${name}-thigh" pos="${x} ${y} 0"><joint name="${name}-hip" axis="0 1 0" range="-1.5 1.5" armature="0.01"/>
<inertial pos="0 0 -0.1" mass="0.8" diaginertia="4e-3 4e-3 1e-3"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.03" group="3" rgba="1 0 0 1"/>
<geom type="cylinder" fromto="0 0 -0.02 0 0 -0.18" size="0.028" group="2" contype="0" conaffinity="0" material="steel"/>
<geom type="sphere" size="0.035" group="2" contype="0" conaffinity="0" rgba="0.15 0.15 0.17 1"/>
<body name="${name}-shank" pos="0 0 -0.2"><joint name="${name}-knee" axis="0 1 0" range="-2.5 2.5" armature="0.01"/>
<inertial pos="0 0 -0.1" mass="0.3" diaginertia="1e-3 1e-3 2e-4"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.015" rgba="0.2 0.22 0.25 1"/>
<geom type="sphere" pos="0 0 -0.2" size="0.025" rgba="0.9 0.5 0.1 1"/></body></body>`;

/** Four legs; the trunk a mesh, the thighs shapes only to be looked at, the shanks both. */
const DOG = `<mujoco model="dog"><compiler angle="radian" meshdir="meshes"/>
<asset><mesh name="trunk" file="trunk.stl"/><mesh name="head" file="head.stl"/><material name="steel" rgba="0.55 0.6 0.68 1"/></asset>
<worldbody><body name="trunk" pos="0 0 0.42"><freejoint/><inertial pos="0 0 0" mass="8" diaginertia="0.1 0.2 0.2"/>
<geom type="mesh" mesh="trunk" group="1" contype="0" conaffinity="0" rgba="0.95 0.75 0.1 1"/>
<geom type="mesh" mesh="head" group="1" contype="0" conaffinity="0" rgba="0.1 0.1 0.1 1"/>
<geom type="box" size="0.25 0.1 0.06" group="3"/>
${LEG('fl', 0.2, 0.12)}${LEG('fr', 0.2, -0.12)}${LEG('hl', -0.2, 0.12)}${LEG('hr', -0.2, -0.12)}
</body></worldbody>
<keyframe><key name="stand" qpos="0 0 0.42 1 0 0 0 0.5 -1 0.5 -1 0.5 -1 0.5 -1"/></keyframe></mujoco>
`;

function importRobot(work, file, text, meshes) {
  const from = join(work, file.replace(/\..*/, ''));
  mkdirSync(join(from, 'meshes'), { recursive: true });
  writeFileSync(join(from, file), text);
  for (const [name, data] of Object.entries(meshes)) writeFileSync(join(from, 'meshes', name), data);
  const { status, stdout, stderr } = spawnSync(program, ['import', join(from, file), '-o', join(from, 'out')],
    { encoding: 'utf8', timeout: WAIT_MS });
  if (status !== 0) throw new Error(stderr);
  return { folder: join(from, 'out'), text: stdout };
}

const start = (work, rig) => begin(work, program, ['run', rig, '--transport', 'local', '--clock', 'real', '--control', 'none']);

// ---- in the page ----

/** Whether all meshes have come or failed, and the picture shows it. */
const isWhole = () => {
  const { scene, hello } = window.coman?.page ?? {};
  const visuals = hello?.scene.visuals ?? []; // a page is there before the server has said what it shows
  return scene?.firstDrawn > 0 && scene.robot.parts.length + scene.robot.lacks.length === visuals.length
    && visuals.some(({ mesh }) => mesh);
};

/** The colors of the picture where points of the world are, and whether they are within it. */
const look = (points) => {
  const { scene } = window.coman.page;
  scene.show.torques = false;
  scene.show.centers = false;
  scene.update(window.coman.state);
  scene.renderer.render(scene.scene, scene.camera);
  const canvas = document.createElement('canvas');
  canvas.width = scene.canvas.width;
  canvas.height = scene.canvas.height;
  const pen = canvas.getContext('2d');
  pen.drawImage(scene.canvas, 0, 0);
  return points.map((point) => {
    const at = scene.target.clone().set(...point).project(scene.camera);
    const within = Math.abs(at.x) < 0.98 && Math.abs(at.y) < 0.98;
    const [r, g, b] = within ? pen.getImageData(Math.round((0.5 + 0.5 * at.x) * canvas.width),
      Math.round((0.5 - 0.5 * at.y) * canvas.height), 1, 1).data : [];
    return { r, g, b, within };
  });
};

/** Whether a color has the hue of another one, however light it is. */
function isHue({ r, g, b }, [x, y, z]) {
  const most = Math.max(r, g, b);
  const top = Math.max(x, y, z);
  return most > 25 && [[r, x], [g, y], [b, z]].every(([got, meant]) => Math.abs(got / most - meant / top) < 0.3);
}

async function open(browser, url, viewport, errors) {
  const page = await browser.newPage({ viewport, colorScheme: 'light' });
  page.setDefaultTimeout(PATIENCE_MS);
  page.on('pageerror', (error) => errors.push(error.message));
  await page.goto(`${url}&quality=low`);
  await page.waitForFunction(isWhole, null, { timeout: PATIENCE_MS });
  await page.evaluate(() => { window.coman.page.scene.period = 1000; }); // tests draw what they look at
  return page;
}

const save = (page, name) => folder && page.screenshot({ path: join(folder, `${name}.png`) });

// ---- the tests ----

const ARM_POINTS = [['a box has its material by name', [0.1, 0, 0.05], [0.1, 0.2, 0.9]],
  ['an STL in millimeters is scaled, and red', [0.05, 0, 0.3], [0.8, 0.05, 0.05]],
  ['a side of a DAE is turned by its node, and green', [0.05, 0, 0.6], [0, 0.7, 0]],
  ['another one of it is yellow', [0, -0.03, 0.6], [0.9, 0.8, 0]],
  ['an OBJ is turned up and has the color of its MTL', [0.06, 0, 0.9], [0.8, 0, 0.8]]];
const ARM_ENDS = [[0.1, 0.1, 0], [-0.1, -0.1, 0], [0.1, -0.1, 0], [-0.1, 0.1, 0], [0.04, 0, 1.17], [-0.04, 0, 1.17]];

async function judgeArm(browser, work, errors) {
  const made = importRobot(work, 'arm.urdf', ARM, { 'lower.stl': stlOf([-50, -50, 0], [50, 50, 400]), 'elbow.dae': DAE,
    'upper.obj': objOf([0, -0.03, -0.04], [0.4, 0.03, 0.04], 'paint.mtl', 'pink'), 'paint.mtl': 'newmtl pink\nKd 0.8 0 0.8\n' });
  check(/missing: visual mesh of link "hand": .*gone\.stl/.test(made.text), 'import names the mesh that is missing',
    made.text.split('\n').filter((line) => line.includes('missing:')));
  const run = await start(work, join(made.folder, 'rigs/arm.yaml'));
  try {
    const page = await open(browser, run.page_view, { width: 1100, height: 800 }, errors);
    const colors = await page.evaluate(look, ARM_POINTS.map(([, point]) => point));
    ARM_POINTS.forEach(([name, , color], i) => check(isHue(colors[i], color), name, colors[i]));
    const ends = await page.evaluate(look, ARM_ENDS);
    check(ends.every(({ within }) => within), 'nothing of the arm is cut off');
    check(await page.evaluate(() => window.coman.page.scene.ground.visible), 'there is ground below a robot that is fixed');
    const pushed = await page.evaluate(() => {
      const { bodies } = window.coman.page.hello.scene;
      return bodies[Number(document.querySelector('#push-body').value)].parent;
    });
    check(pushed >= 0, 'what is pushed at first is no body that is fixed', pushed);
    await page.click('.lacks summary');
    const lacks = await page.textContent('.lacks');
    check(lacks.startsWith('1 shape is missing') && lacks.includes('gone.stl'), 'the page names what is missing', lacks);
    check(/notice: page: .* is not shown as it looks: .*gone\.stl/.test(run.said()), 'so does the terminal',
      run.said().split('\n').filter((line) => line.includes('page:')));
    const hand = await page.evaluate(() => {
      const { scene, hello } = window.coman.page;
      const body = hello.scene.bodies.findIndex(({ name }) => name === 'hand');
      return scene.robot.bodies[body].children.filter(({ visible, geometry }) => visible
        && geometry?.type === 'BoxGeometry').length;
    });
    check(hand === 1, 'in its place is what can touch', hand);
    await save(page, 'arm');
    await page.keyboard.press('v');
    const touch = await page.evaluate(() => window.coman.page.scene.robot.parts.every(({ visible }) => !visible));
    check(touch, 'a key shows what can touch instead');
    await page.close();

    const phone = await open(browser, run.page_view, { width: 390, height: 780 }, errors);
    const seen = await phone.evaluate(look, ARM_ENDS);
    check(seen.every(({ within }) => within), 'nothing is cut off on a telephone');
    await save(phone, 'arm-telephone');
    await phone.close();
  } finally {
    run.child.kill('SIGKILL');
  }
}

async function judgeDog(browser, work, errors) {
  const made = importRobot(work, 'dog.xml', DOG, { 'trunk.stl': stlOf([-0.27, -0.09, -0.06], [0.27, 0.09, 0.06]),
    'head.stl': stlOf([0.27, -0.05, -0.03], [0.36, 0.05, 0.07]) });
  const files = readdirSync(join(made.folder, 'meshes')).filter((name) => name.endsWith('.stl')).sort();
  check(files.length === 2, 'meshes are written once each', files);
  truncateSync(join(made.folder, 'meshes', files.find((name) => name.endsWith('visual2.stl'))), 300);
  const run = await start(work, join(made.folder, 'rigs/dog-standing.yaml'));
  try {
    const page = await open(browser, run.page_view, { width: 1100, height: 800 }, errors);
    const [at] = await page.evaluate(() => [window.coman.state.bodies.slice(0, 3)]).then(([p]) => [Object.values(p)]);
    const [side, thigh] = await page.evaluate(look, [[at[0], at[1] - 0.09, at[2]], [at[0], at[1] - 0.09, at[2] - 0.03]]);
    check(isHue(side, [0.95, 0.75, 0.1]) && isHue(thigh, [0.95, 0.75, 0.1]), 'a geom of MJCF has its color', side);
    const red = await page.evaluate(() => window.coman.page.hello.scene.visuals.filter(({ color }) => color?.[0] === 1).length);
    check(red === 0, 'groups that MuJoCo hides are hidden', red);
    const lacks = await page.textContent('.lacks');
    check(/visual2.*found 300 bytes, expected a binary STL/.test(lacks)
      && /notice: page: .*found 300 bytes, expected a binary STL/.test(run.said()), 'a damaged file is named', lacks);
    const whole = await page.evaluate(look, [[at[0] + 0.3, at[1] + 0.15, 0], [at[0] - 0.3, at[1] - 0.15, 0], [at[0] - 0.27, at[1] + 0.09, at[2] + 0.06]]);
    check(whole.every(({ within }) => within), 'nothing of the legged robot is cut off');
    await save(page, 'dog');
    await page.evaluate(() => document.documentElement.dataset.theme !== 'dark' && document.querySelector('[aria-label="light or dark"]').click());
    await page.evaluate(look, []);
    await save(page, 'dog-dark');
    await page.close();
    const phone = await open(browser, run.page_view, { width: 390, height: 780 }, errors);
    await save(phone, 'dog-telephone');
    await phone.close();
  } finally {
    run.child.kill('SIGKILL');
  }
}

await test(TESTS, async (browser, work) => {
  const errors = [];
  await judgeArm(browser, work, errors);
  await judgeDog(browser, work, errors);
  check(errors.length === 0, 'the page has no errors', errors);
});
