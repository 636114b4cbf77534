// SPDX-License-Identifier: Apache-2.0
// usage: judge.mjs IMPORT_DUMP COUNT [SEED [FOLDER]]
// Generates COUNT robot files, has import_dump import them and MuJoCo 3 load them, and compares.
// Prints TAP: one result for each kind of difference, and a table of files by feature.
import { spawnSync } from 'node:child_process'
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs'
import { tmpdir } from 'node:os'
import { join } from 'node:path'
import load from 'mujoco-js'
import { generate, meshes } from './generate.mjs'

const [dump, count, seed = '1', kept] = process.argv.slice(2)
const mujoco = await load()
const folder = kept ?? mkdtempSync(join(tmpdir(), 'hil-generated-'))
const BODY = 1
const JOINT = 3
const SITE = 6

// ---- 3-vectors and matrices by rows ----

const apply = (R, x) => [0, 1, 2].map((i) => R[3 * i] * x[0] + R[3 * i + 1] * x[1] + R[3 * i + 2] * x[2])
const turned = (R, x) => [0, 1, 2].map((i) => R[i] * x[0] + R[3 + i] * x[1] + R[6 + i] * x[2])
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
const norm = (x) => Math.hypot(...x)
const apart = (a, b) => Math.max(...a.map((x, i) => Math.abs(x - b[i])))
const rotation = ([w, x, y, z]) => [
  1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
  2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
  2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
]

// Solves A x = b by elimination with pivots.
function solve(A, b) {
  const n = b.length
  for (let k = 0; k < n; k++) {
    let p = k
    for (let i = k + 1; i < n; i++) {
      p = Math.abs(A[i][k]) > Math.abs(A[p][k]) ? i : p
    }
    ;[A[k], A[p]] = [A[p], A[k]]
    ;[b[k], b[p]] = [b[p], b[k]]
    for (let i = k + 1; i < n; i++) {
      const f = A[i][k] / A[k][k]
      for (let j = k; j < n; j++) {
        A[i][j] -= f * A[k][j]
      }
      b[i] -= f * b[k]
    }
  }
  for (let k = n - 1; k >= 0; k--) {
    for (let j = k + 1; j < n; j++) {
      b[k] -= A[k][j] * b[j]
    }
    b[k] /= A[k][k]
  }
  return b
}

// ---- what is compared ----

// By kind: the largest difference that is allowed. MuJoCo keeps corners of meshes in single
// precision and finds principal axes to 1e-6, so inertias agree to that; accelerations are compared
// with MuJoCo's moments about the axes that belong to its tensor.
const TOLERANCE = {
  import: 0, refusal: 0, masses: 1e-6, centers: 1e-6, inertias: 1e-6, accelerations: 1e-9, ranges: 1e-6,
  'torque limits': 1e-6, drives: 1e-6, springs: 1e-6, poses: 1e-9, sensors: 1e-9, couplings: 1e-9, report: 0,
}
const worst = Object.fromEntries(Object.keys(TOLERANCE).map((kind) => [kind, 0]))
const failures = Object.fromEntries(Object.keys(TOLERANCE).map((kind) => [kind, []]))
const table = new Map()
let wrong

function differ(kind, file, size, what) {
  if (Number.isFinite(size) && size <= TOLERANCE[kind]) {
    worst[kind] = Math.max(worst[kind], size)
    return
  }
  wrong = true
  failures[kind].push(`${file.name}: ${what}${Number.isFinite(size) && size > 0 ? ` (${size.toExponential(1)})` : ''}`)
}

const same = (a, b) => Math.abs(a - b) / Math.max(1, Math.abs(b))

// ---- states ----

// Sets MuJoCo's state to one of the robot's. Returns the degrees of freedom of the robot's joints.
function pose(m, data, robot, state) {
  const base = robot.floating ? 6 : 0
  const q0 = robot.floating ? 7 : 0
  const dofs = []
  data.qvel.fill(0)
  data.qpos.set(m.qpos0)
  robot.locked.forEach(([id, value]) => (data.qpos[m.jnt_qposadr[id]] = value))
  for (let i = 0; i < q0; i++) {
    data.qpos[i] = state.q[i]
  }
  if (robot.floating) {
    const R = rotation(state.q.slice(3))
    const v = apply(R, state.v.slice(0, 3))
    v.forEach((x, i) => (data.qvel[i] = x))
    for (let i = 3; i < 6; i++) {
      data.qvel[i] = state.v[i]
    }
  }
  for (let i = 0; i < base; i++) {
    dofs.push(i)
  }
  robot.joints.forEach((joint, j) => {
    data.qpos[m.jnt_qposadr[joint.id]] = state.q[q0 + j] + m.qpos0[m.jnt_qposadr[joint.id]]
    data.qvel[m.jnt_dofadr[joint.id]] = state.v[base + j]
    dofs.push(m.jnt_dofadr[joint.id])
  })
  return dofs
}

function accelerations(m, data, robot, state) {
  const dofs = pose(m, data, robot, state)
  const base = robot.floating ? 6 : 0
  mujoco.mj_forward(m, data)
  const full = Array(m.nv * m.nv).fill(0)
  const M = new mujoco.DoubleBuffer(m.nv * m.nv)
  mujoco.mj_fullM(m, M, data.qM)
  M.GetView().forEach((x, i) => (full[i] = x))
  M.delete()
  const A = dofs.map((i) => dofs.map((j) => full[i * m.nv + j]))
  const b = dofs.map((i, k) => (k < base ? 0 : state.tau[k - base]) - data.qfrc_bias[i])
  const a = solve(A, b)
  // MuJoCo's base accelerates in the world, ours is the derivative in the moving frame
  if (robot.floating) {
    const own = turned(rotation(state.q.slice(3)), a.slice(0, 3))
    const spin = cross(state.v.slice(3, 6), state.v.slice(0, 3))
    own.forEach((x, i) => (a[i] = x - spin[i]))
  }
  return a
}

// Mass, center and inertia of a body with all that is fixed to it, in the world.
function weigh(m, data, id, locked) {
  const sum = { mass: 0, first: [0, 0, 0], I: [0, 0, 0, 0, 0, 0] }
  const add = (body) => {
    const mass = m.body_mass[body]
    const c = [...data.xipos.slice(3 * body, 3 * body + 3)]
    const R = data.ximat.slice(9 * body, 9 * body + 9)
    const own = m.body_inertia.slice(3 * body, 3 * body + 3)
    sum.mass += mass
    let k = 0
    for (let i = 0; i < 3; i++) {
      sum.first[i] += mass * c[i]
      for (let j = i; j < 3; j++, k++) {
        for (let n = 0; n < 3; n++) {
          sum.I[k] += R[3 * i + n] * own[n] * R[3 * j + n]
        }
        sum.I[k] += mass * ((i === j ? norm(c) ** 2 : 0) - c[i] * c[j])
      }
    }
    for (let child = body + 1; child < m.nbody; child++) {
      if (m.body_parentid[child] === body && fixed(m, child, locked)) {
        add(child)
      }
    }
  }
  add(id)
  const com = sum.first.map((x) => x / sum.mass)
  let k = 0
  for (let i = 0; i < 3; i++) {
    for (let j = i; j < 3; j++, k++) {
      sum.I[k] -= sum.mass * ((i === j ? norm(com) ** 2 : 0) - com[i] * com[j])
    }
  }
  return { mass: sum.mass, com, I: sum.I }
}

// Whether all joints of a body are fixed in the robot.
function fixed(m, body, locked) {
  for (let j = 0; j < m.body_jntnum[body]; j++) {
    if (!locked.some(([id]) => id === m.body_jntadr[body] + j)) {
      return false
    }
  }
  return true
}

// Turns a symmetric tensor (xx xy xz yy yz zz) onto its axes; the columns of V.
function principal(I) {
  const A = [[I[0], I[1], I[2]], [I[1], I[3], I[4]], [I[2], I[4], I[5]]]
  const V = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
  for (let sweep = 0; sweep < 20; sweep++) {
    for (const [p, q] of [[0, 1], [1, 2], [0, 2]]) {
      if (A[p][q] === 0) {
        continue
      }
      const t = 0.5 * Math.atan2(2 * A[p][q], A[q][q] - A[p][p])
      const [c, s] = [Math.cos(t), Math.sin(t)]
      for (let k = 0; k < 3; k++) {
        ;[A[k][p], A[k][q]] = [c * A[k][p] - s * A[k][q], s * A[k][p] + c * A[k][q]]
        ;[V[k][p], V[k][q]] = [c * V[k][p] - s * V[k][q], s * V[k][p] + c * V[k][q]]
      }
      for (let k = 0; k < 3; k++) {
        ;[A[p][k], A[q][k]] = [c * A[p][k] - s * A[q][k], s * A[p][k] + c * A[q][k]]
      }
    }
  }
  return { moments: [A[0][0], A[1][1], A[2][2]], V }
}

function quaternion(V) {
  const m = V.map((row) => [...row])
  const det = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
  if (det < 0) {
    m.forEach((row) => (row[2] = -row[2]))
  }
  const candidates = [1 + m[0][0] + m[1][1] + m[2][2], 1 + m[0][0] - m[1][1] - m[2][2], 1 - m[0][0] + m[1][1] - m[2][2], 1 - m[0][0] - m[1][1] + m[2][2]]
  const k = candidates.indexOf(Math.max(...candidates))
  const s = 2 * Math.sqrt(candidates[k])
  const o = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]]
  const p = [m[1][0] + m[0][1], m[2][0] + m[0][2], m[2][1] + m[1][2]] // xy xz yz
  return [
    [s / 4, o[0] / s, o[1] / s, o[2] / s],
    [o[0] / s, s / 4, p[0] / s, p[1] / s],
    [o[1] / s, p[0] / s, s / 4, p[2] / s],
    [o[2] / s, p[1] / s, p[2] / s, s / 4],
  ][k]
}

// Inertias that agree to 1e-6 are those of the robot to MuJoCo, so that the rest agrees to 1e-9.
function lend(m, data, robot, state) {
  pose(m, data, robot, state)
  mujoco.mj_forward(m, data)
  const given = new Map(robot.bodies.map((body) => [mujoco.mj_name2id(m, BODY, body.name), body]))
  for (let id = 1; id < m.nbody; id++) {
    const body = given.get(id)
    m.body_mass[id] = body ? body.mass : 0
    if (!body) {
      m.body_inertia.set([0, 0, 0], 3 * id)
      continue
    }
    const R = data.xmat.slice(9 * id, 9 * id + 9)
    const c = turned(R, body.com.map((x, i) => x - data.xpos[3 * id + i]))
    const S = [[0, 1, 2], [1, 3, 4], [2, 4, 5]]
    const own = [0, 0, 0, 0, 0, 0]
    for (let i = 0; i < 3; i++) {
      for (let j = i; j < 3; j++) {
        let sum = 0
        for (let a = 0; a < 3; a++) {
          for (let b = 0; b < 3; b++) {
            sum += R[3 * a + i] * body.I[S[a][b]] * R[3 * b + j]
          }
        }
        own[S[i][j]] = sum
      }
    }
    const { moments, V } = principal(own)
    m.body_ipos.set(c, 3 * id)
    m.body_inertia.set(moments, 3 * id)
    m.body_iquat.set(quaternion(V), 4 * id)
    m.body_sameframe[id] = 0
  }
}

// A force-torque sensor in the last joint has the axes of the child or, at 0, of the parent; the
// report says so where the joint moves. Its sign is that of child to parent, or in the report.
function compareForceTorque(m, data, robot, file) {
  const id = mujoco.mj_name2id(m, BODY, 'end')
  const says = (words) => robot.notes.some(([, , note]) => note.text.includes('"wrist"') && note.text.includes(words))
  const frame = robot.frames[robot.ft[0]?.frame]
  if (!frame || robot.ft[0].name !== 'wrist') {
    differ('sensors', file, NaN, 'no force-torque sensor "wrist"')
    return
  }
  differ('sensors', file, apart(frame.p, data.xpos.slice(3 * id, 3 * id + 3)), 'place of the force-torque sensor')
  if (file.ft.frame !== 'parent') {
    differ('sensors', file, apart(frame.R, data.xmat.slice(9 * id, 9 * id + 9)), 'axes of the force-torque sensor')
  }
  differ('sensors', file, (file.ft.frame === 'parent') === says('parent\'s axes at 0') ? 0 : NaN, 'report of its axes')
  differ('sensors', file, (file.ft.measure === 'parent_to_child') === says('opposite') ? 0 : NaN, 'report of its signs')
}

function compareDynamics(m, data, robot, file) {
  const first = robot.states[0]
  pose(m, data, robot, first)
  mujoco.mj_forward(m, data)
  let known = true
  for (const body of robot.bodies) {
    const id = mujoco.mj_name2id(m, BODY, body.name)
    if (id < 0 || (id === 0 && !robot.floating)) {
      // Of several joints of a body only the last has the body's name and mass, if it moves
      known = (known && body.mass <= 1e-14) || id === 0 || robot.locked.length > 0
      continue
    }
    const own = weigh(m, data, id, robot.locked)
    if (!(own.mass > 0)) {
      continue
    }
    differ('masses', file, Math.abs(own.mass - body.mass) / own.mass, `mass of ${body.name}: ${body.mass}, ${own.mass}`)
    differ('centers', file, apart(own.com, body.com), `center of ${body.name}`)
    differ('inertias', file, apart(own.I, body.I) / (own.I[0] + own.I[3] + own.I[5]), `inertia of ${body.name}`)
  }
  if (!known) {
    differ('masses', file, NaN, 'a body that MuJoCo does not know weighs')
  }
  // Frames of sites and the inertial sensor
  if (file.imu) {
    const id = mujoco.mj_name2id(m, SITE, file.imu)
    const frame = robot.frames[robot.imu]
    if (!frame) {
      differ('sensors', file, NaN, 'no inertial sensor')
    } else {
      differ('sensors', file, apart(frame.p, data.site_xpos.slice(3 * id, 3 * id + 3)), 'place of the inertial sensor')
      differ('sensors', file, apart(frame.R, data.site_xmat.slice(9 * id, 9 * id + 9)), 'axes of the inertial sensor')
    }
  }
  if (file.ft) {
    compareForceTorque(m, data, robot, file)
  }
  if (wrong) {
    return
  }
  // A body whose last joint is held has another name here: MuJoCo keeps its inertias, good to 1e-6
  const scale = robot.locked.length ? 1e-4 : 1
  if (!robot.locked.length) {
    lend(m, data, robot, first)
  }
  for (const state of robot.states) {
    const theirs = accelerations(m, data, robot, state)
    const largest = Math.max(1, ...theirs.map(Math.abs))
    differ('accelerations', file, (scale * apart(theirs, state.vdot)) / largest, 'accelerations')
  }
}

// ---- limits, drives, poses, couplings ----

// The range of the torque that MuJoCo's actuators can exert on a joint; null = no bound.
function torqueRange(m, id) {
  let low = 0
  let high = 0
  let driven = false
  for (let a = 0; a < m.nu; a++) {
    if (m.actuator_trntype[a] > 1 || m.actuator_trnid[2 * a] !== id) {
      continue
    }
    let range = [-Infinity, Infinity]
    const fixedGain = m.actuator_gaintype[a] === 0 && m.actuator_biastype[a] === 0
    driven = true
    if (fixedGain) {
      const gain = m.actuator_gainprm[10 * a]
      const integrates = m.actuator_dyntype[a] === 1
      const [limited, of] = integrates ? [m.actuator_actlimited, m.actuator_actrange] : [m.actuator_ctrllimited, m.actuator_ctrlrange]
      if (limited[a]) {
        range = [gain * of[2 * a], gain * of[2 * a + 1]].sort((x, y) => x - y)
      }
    }
    if (m.actuator_forcelimited[a]) {
      const own = m.actuator_forcerange.slice(2 * a, 2 * a + 2)
      range = range.map((x) => Math.min(Math.max(x, own[0]), own[1]))
    }
    const gear = m.actuator_gear[6 * a]
    const on = range.map((x) => (gear === 0 ? 0 : x * gear)).sort((x, y) => x - y)
    low += on[0]
    high += on[1]
  }
  if (m.jnt_actfrclimited[id]) {
    const own = m.jnt_actfrcrange.slice(2 * id, 2 * id + 2)
    ;[low, high] = driven ? [low, high].map((x) => Math.min(Math.max(x, own[0]), own[1])) : own
  } else if (!driven) {
    return { driven }
  }
  const most = Math.max(Math.abs(low), Math.abs(high))
  return { driven, limit: Number.isFinite(most) ? most : undefined }
}

function compareJoints(m, robot, file) {
  // The report lists springdamper, which changes both
  const springy = robot.notes.some(([, , note]) => note.text.startsWith('"springdamper"'))
  const actuated = m.nu > 0 && [...m.actuator_trntype].every((type) => type <= 1)
  for (const joint of robot.joints) {
    const { id, name } = joint
    const slide = m.jnt_type[id] === 2
    const ref = m.qpos0[m.jnt_qposadr[id]]
    const dof = m.jnt_dofadr[id]
    const says = robot.notes.filter(([, , note]) => note.text.includes(`"${name}"`)).map(([, , note]) => note.text)
    if (m.jnt_limited[id] && !joint.leader) {
      const own = m.jnt_range.slice(2 * id, 2 * id + 2)
      const narrowed = says.some((note) => /narrow|range/.test(note) && /follow/.test(note))
      if (!narrowed && !robot.joints.some((other) => other.leader === name)) {
        differ('ranges', file, Math.max(same(joint.lower, own[0] - ref), same(joint.upper, own[1] - ref)), `range of ${name}: ${joint.lower} ${joint.upper}, ${own[0] - ref} ${own[1] - ref}`)
      }
    } else if (!joint.leader && joint.stop && !says.some((note) => /without limits|follow|narrow/.test(note))) {
      differ('ranges', file, NaN, `${name} has stops`)
    }
    if (joint.leader) {
      if (!springy) {
        differ('drives', file, same(joint.damping, m.dof_damping[dof]), `damping of ${name}: ${joint.damping}, ${m.dof_damping[dof]}`)
        differ('springs', file, same(joint.stiffness, m.jnt_stiffness[id]), `stiffness of ${name}`)
      }
      continue
    }
    if (file.mjcf) {
      const { driven, limit } = torqueRange(m, id)
      if (limit !== undefined && limit > 0) {
        const assumed = says.find((note) => /as strong as/.test(note))
        const told = assumed && [...assumed.matchAll(/-?\d[\d.]*(e[+-]?\d+)?/g)].some(([x]) => Math.abs(+x / limit - 1) < 0.006)
        if (!told) {
          differ('torque limits', file, Math.abs(joint.limit - limit) / limit, `limit of ${name}: ${joint.limit}, ${limit}`)
        }
      } else if (driven && !says.some((note) => /as strong as/.test(note))) {
        differ('torque limits', file, NaN, `${name} has no limit in the file and ${joint.limit} here`)
      }
      if (actuated && !slide && joint.driven !== driven) {
        differ('drives', file, NaN, `${name} is ${driven ? 'driven' : 'not driven'} in MuJoCo`)
      }
      if (joint.driven) {
        if (m.dof_armature[dof] > 0) {
          differ('drives', file, same(joint.armature, robot.armature[dof]), `armature of ${name}`)
        }
      }
      if (!springy && (m.jnt_stiffness[id] > 0 || joint.stiffness > 0)) {
        differ('springs', file, same(joint.stiffness, m.jnt_stiffness[id]), `stiffness of ${name}`)
        differ('springs', file, same(joint.rest, m.qpos_spring[m.jnt_qposadr[id]] - ref), `rest of ${name}`)
      }
    }
    if (robot.armature[dof] > 0 && joint.driven) {
      differ('drives', file, same(joint.armature, robot.armature[dof]), `armature of ${name}`)
    }
    if (m.dof_damping[dof] > 0 && !springy) {
      differ('drives', file, same(joint.damping, m.dof_damping[dof]), `damping of ${name}: ${joint.damping}, ${m.dof_damping[dof]}`)
    }
    if (m.dof_frictionloss[dof] > 0 && !says.some((note) => /friction/.test(note))) {
      differ('drives', file, same(joint.friction, m.dof_frictionloss[dof]), `friction of ${name}`)
    }
  }
}

function comparePoses(m, robot, file) {
  for (let k = 0; k < m.nkey; k++) {
    const own = robot.poses[k + 1]
    if (!own) {
      differ('poses', file, NaN, `keyframe ${k} is no pose`)
      continue
    }
    robot.joints.forEach((joint, j) => {
      const at = m.jnt_qposadr[joint.id]
      const says = robot.notes.some(([, , note]) => note.text.includes(`"${own.name}"`) && note.text.includes(`"${joint.name}"`))
      if (!joint.leader && !says) {
        differ('poses', file, same(own.joint[j], m.key_qpos[k * m.nq + at] - m.qpos0[at]), `${own.name}: ${joint.name} ${own.joint[j]}, ${m.key_qpos[k * m.nq + at] - m.qpos0[at]}`)
      }
    })
  }
}

function compareCouplings(m, robot, file) {
  for (let e = 0; e < m.neq; e++) {
    if (m.eq_type[e] !== 2 || !m.eq_active0[e]) {
      continue
    }
    const [one, other] = [m.eq_obj1id[e], m.eq_obj2id[e]]
    const poly = m.eq_data.slice(11 * e, 11 * e + 5)
    if (other < 0) {
      if (robot.joints.some((joint) => joint.id === one)) {
        differ('couplings', file, NaN, 'a joint of an equality with a constant moves')
      }
      continue
    }
    const follows = robot.joints.find((joint) => joint.leader && [one, other].includes(joint.id))
    if (!follows) {
      const says = robot.notes.some(([, , note]) => /follow/.test(note.text))
      if (!says) {
        differ('couplings', file, NaN, 'no joint follows')
      }
      continue
    }
    // Both count from the place in the file, as the polynomial of MuJoCo does
    const direct = follows.id === one
    differ('couplings', file, same(follows.multiplier, direct ? poly[1] : 1 / poly[1]), 'multiplier')
    differ('couplings', file, same(follows.offset, direct ? poly[0] : -poly[0] / poly[1]), 'offset')
  }
}

// ---- the report ----

// What import takes of each element, by the guide. Everything else must be in the report.
const TAKEN = {
  mujoco: 'model',
  compiler: 'angle eulerseq autolimits inertiafromgeom inertiagrouprange meshdir assetdir coordinate exactmeshinertia settotalmass',
  default: 'class',
  mesh: 'name file scale inertia class filename refpos refquat',
  material: 'name rgba class',
  body: 'name pos quat axisangle euler xyaxes zaxis childclass',
  frame: 'name pos quat axisangle euler xyaxes zaxis childclass',
  freejoint: 'name',
  joint: 'name class type pos axis range limited ref springref stiffness damping armature frictionloss actuatorfrcrange actuatorfrclimited joint1 joint2 polycoef active joint coef',
  fixed: 'name',
  inertial: 'pos quat axisangle euler xyaxes zaxis mass diaginertia fullinertia',
  geom: 'name class type size pos quat axisangle euler xyaxes zaxis fromto mass density group contype conaffinity mesh material rgba',
  site: 'name class pos quat axisangle euler xyaxes zaxis fromto',
  motor: 'name class joint jointinparent gear ctrlrange ctrllimited forcerange forcelimited',
  general: 'name class joint jointinparent gear ctrlrange ctrllimited forcerange forcelimited gaintype gainprm biastype dyntype actrange actlimited',
  equality: 'active',
  key: 'name qpos',
  gyro: 'name site',
  accelerometer: 'name site',
}
for (const kind of ['position', 'velocity', 'damper', 'intvelocity', 'cylinder']) {
  TAKEN[kind] = TAKEN.motor
}
const TAKEN_URDF = {
  robot: 'name version', link: 'name', inertial: '-', origin: 'xyz rpy', mass: 'value', inertia: 'ixx ixy ixz iyy iyz izz',
  visual: '-', collision: '-', geometry: '-', box: 'size', sphere: 'radius', cylinder: 'radius length', capsule: 'radius length',
  mesh: 'filename scale', material: 'name', color: 'rgba', joint: 'name type', parent: 'link', child: 'link',
  axis: 'xyz', limit: 'lower upper effort velocity', dynamics: 'damping friction', mimic: 'joint multiplier offset',
  gazebo: 'reference', sensor: 'name type', force_torque: '-', frame: '-', measure_direction: '-',
  transmission: 'name', actuator: 'name', mechanicalReduction: '-',
}
const SECTIONS = new Set(['worldbody', 'asset', 'actuator', 'keyframe', 'sensor', 'default', 'equality', 'tendon'])

function compareReport(robot, file) {
  const taken = file.mjcf ? TAKEN : TAKEN_URDF
  const texts = robot.notes.map(([, , note]) => note.text)
  const lists = (element, attribute) =>
    texts.some((text) => text.includes(`<${element}>`) && (!attribute || new RegExp(`(^|[ ,"])${attribute}([ ,:"]|$)`).test(text)))
  const whole = (element) => texts.some((text) => text.startsWith(`<${element}>`))
  const inside = []
  for (const line of file.text.split('\n')) {
    const [, shut, element, words, leaf] = /^\s*<(\/?)([a-z_0-9]+)((?: [a-z_0-9]+="[^"]*")*)(\/?)>/i.exec(line) ?? []
    if (!element) {
      continue
    }
    if (shut) {
      inside.pop()
      continue
    }
    const covered = inside.some((above) => !SECTIONS.has(above) && !taken[above] && whole(above))
    if (!covered && !SECTIONS.has(element) && !taken[element] && !whole(element) && !lists(element)) {
      differ('report', file, NaN, `<${element}> is not in the report`)
    }
    for (const [, attribute] of words.matchAll(/ ([a-z_0-9]+)="/gi)) {
      if (!covered && taken[element] && !taken[element].split(' ').includes(attribute) && !whole(element) && !lists(element, attribute)) {
        differ('report', file, NaN, `${attribute} of <${element}> is not in the report`)
      }
      if (taken[element]?.split(' ').includes(attribute) && texts.some((text) => text.includes(`of <${element}>`) && new RegExp(`[" ,]${attribute}[" ,]`).test(text.split(` of <${element}>`)[0]))) {
        differ('report', file, NaN, `${attribute} of <${element}> is taken and in the report`)
      }
    }
    if (!leaf) {
      inside.push(element)
    }
  }
}

// ---- the whole ----

// The text that MuJoCo's exceptions begin with, in the memory of its module.
function reason(error) {
  const memory = new mujoco.DoubleBuffer(1)
  const bytes = new Uint8Array(memory.GetView().buffer, error.excPtr, 500)
  memory.delete()
  return Buffer.from(bytes).toString('latin1').split('\0')[0].replace(/\n/g, ' ')
}

// MuJoCo does not turn the tensor of a URDF with its origin: its copy gets the tensor turned.
function turnInertias(text) {
  return text.replace(/<origin([^>]*)\/>(\s*<mass[^>]*>\s*)<inertia ([^>]*)\/>/g, (all, origin, mass, tensor) => {
    const [r, p, y] = (/ rpy="([^"]*)"/.exec(origin)?.[1] ?? '0 0 0').split(' ').map(Number)
    const of = (key) => Number(new RegExp(`${key}="([^"]*)"`).exec(tensor)[1])
    const I = [[of('ixx'), of('ixy'), of('ixz')], [of('ixy'), of('iyy'), of('iyz')], [of('ixz'), of('iyz'), of('izz')]]
    const [cr, sr, cp, sp, cy, sy] = [Math.cos(r), Math.sin(r), Math.cos(p), Math.sin(p), Math.cos(y), Math.sin(y)]
    const R = [
      [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
      [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
      [-sp, cp * sr, cp * cr],
    ]
    const T = R.map((row) => R.map((other) => row.reduce((sum, x, i) => sum + x * other.reduce((s, z, j) => s + I[i][j] * z, 0), 0)))
    const words = ['xx', 'xy', 'xz', 'yy', 'yz', 'zz'].map((key) => `i${key}="${T['xyz'.indexOf(key[0])]['xyz'.indexOf(key[1])]}"`)
    return `<origin${origin.replace(/ rpy="[^"]*"/, '')}/>${mass}<inertia ${words.join(' ')}/>`
  })
}

// Each file has its own folder: MuJoCo keeps meshes by their path, with the pose that the last file
// gave them.
function loadModel(file) {
  const home = `/${file.name}`
  const path = `${home}/robot`
  mujoco.FS.mkdir(home)
  for (const [name, content] of Object.entries(meshes)) {
    mujoco.FS.writeFile(`${home}/${name}`, content)
  }
  mujoco.FS.writeFile(path, file.mjcf ? file.text : turnInertias(file.text))
  try {
    return { m: mujoco.MjModel.loadFromXML(path) }
  } catch (error) {
    return { why: reason(error) }
  } finally {
    mujoco.FS.unlink(path)
  }
}

function compare(file, robot) {
  if (file.refused) {
    if (!robot.error || !file.refused.test(robot.error)) {
      differ('refusal', file, NaN, `not refused by ${file.refused}: ${robot.error ?? 'imported'}`)
    }
    return
  }
  const { m, why } = loadModel(file)
  if (!m) {
    differ('import', file, NaN, `MuJoCo: ${why}`)
    return
  }
  // A robot needs a drive, and none of this one's actuators turns a joint
  const undriven = /no joint that a drive can turn/.test(robot.error ?? '') && m.nu > 0
  if (undriven) {
    m.delete()
    return
  }
  if (robot.error) {
    differ('import', file, NaN, robot.error)
    m.delete()
    return
  }
  const data = new mujoco.MjData(m)
  robot.notes ??= []
  for (const joint of robot.joints) {
    joint.id = mujoco.mj_name2id(m, JOINT, joint.name)
  }
  robot.joints.filter((joint) => joint.id < 0).forEach((joint) => differ('import', file, NaN, `MuJoCo has no joint ${joint.name}`))
  if (!wrong) {
    // Joints that import has fixed stay where an equality has them
    robot.locked = []
    for (let id = 0; id < m.njnt; id++) {
      if (m.jnt_type[id] !== 0 && !robot.joints.some((joint) => joint.id === id)) {
        let at = m.qpos0[m.jnt_qposadr[id]]
        for (let e = 0; e < m.neq; e++) {
          if (m.eq_type[e] === 2 && m.eq_active0[e] && m.eq_obj1id[e] === id && m.eq_obj2id[e] < 0) {
            at += m.eq_data[11 * e]
          }
        }
        robot.locked.push([id, at])
      }
    }
    robot.armature = [...m.dof_armature]
    m.dof_armature.fill(0)
    m.dof_simplenum.fill(0) // whose inertia MuJoCo keeps
    m.opt.gravity.set([0, 0, -9.81])
    m.opt.disableflags |= 1 // constraints, whose solver prints
    compareJoints(m, robot, file)
    comparePoses(m, robot, file)
    compareCouplings(m, robot, file)
    compareDynamics(m, data, robot, file)
    compareReport(robot, file)
  }
  data.delete()
  m.delete()
}

mkdirSync(folder, { recursive: true })
for (const [name, content] of Object.entries(meshes)) {
  writeFileSync(join(folder, name), content)
}
const files = Array.from({ length: Number(count) }, (_, n) => generate(Number(seed), n))
for (const file of files) {
  file.mjcf = file.name.endsWith('.xml')
  writeFileSync(join(folder, file.name), file.text)
}
const run = spawnSync(dump, [join(folder, 'out')], {
  input: files.map((file) => join(folder, file.name) + '\n').join(''), encoding: 'utf8', maxBuffer: 1 << 30,
})
const robots = run.stdout.trim().split('\n')
for (const [i, file] of files.entries()) {
  wrong = false
  try {
    compare(file, JSON.parse(robots[i] ?? '{"error":"import_dump ended"}'))
  } catch (error) {
    differ('import', file, NaN, `${error.stack}`)
  }
  for (const feature of file.features) {
    const row = table.get(feature) ?? [0, 0]
    table.set(feature, [row[0] + 1, row[1] + (wrong ? 1 : 0)])
  }
}
if (!kept) {
  rmSync(folder, { recursive: true })
}

const kinds = Object.keys(TOLERANCE)
console.log(`1..${kinds.length}`)
for (const [feature, [all, bad]] of [...table].sort()) {
  console.log(`# ${feature}: ${all} files, ${bad} differ`)
}
for (const [i, kind] of kinds.entries()) {
  const list = failures[kind]
  console.log(`${list.length ? 'not ok' : 'ok'} ${i + 1} - ${kind} of ${count} generated files are those of MuJoCo ${mujoco.mj_versionString()}, to ${TOLERANCE[kind]} (${worst[kind].toExponential(1)})`)
  list.slice(0, Number(process.env.HIL_DIFFERENCES ?? 8)).forEach((line) => console.log(`#   ${line}`))
  if (list.length) {
    console.log(`#   ${list.length} differences`)
  }
}
process.exitCode = kinds.some((kind) => failures[kind].length) ? 1 : 0
