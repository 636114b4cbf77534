// SPDX-License-Identifier: Apache-2.0
// Writes random robot files, MJCF and URDF, within what docs/import.md claims. Each file is
// {name, text, features, refused}: features name what is in it, refused is a pattern of the error
// that import must give.

// splitmix64 in doubles' range is enough here: mulberry32
export function dice(seed) {
  let s = seed >>> 0
  const unit = () => {
    s = (s + 0x6d2b79f5) >>> 0
    let t = s
    t = Math.imul(t ^ (t >>> 15), t | 1)
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61)
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296
  }
  unit()
  const d = {
    unit,
    real: (low, high) => low + (high - low) * unit(),
    whole: (low, high) => low + Math.floor((high - low + 1) * unit()),
    chance: (share) => unit() < share,
    of: (list) => list[Math.floor(unit() * list.length)],
    reals: (count, most) => Array.from({ length: count }, () => d.real(-most, most)),
  }
  return d
}

const number = (x) => (Number.isInteger(x) ? String(x) : String(+x.toPrecision(6)))
const text = (value) => (Array.isArray(value) ? value.map(number).join(' ') : typeof value === 'number' ? number(value) : String(value))

// A writer of XML, one element a line.
class Writer {
  constructor() {
    this.lines = []
    this.depth = 0
  }
  put(tag, attributes, close) {
    const words = Object.entries(attributes ?? {})
      .filter(([, value]) => value !== undefined)
      .map(([key, value]) => ` ${key}="${text(value)}"`)
    this.lines.push(' '.repeat(this.depth) + `<${tag}${words.join('')}${close}>`)
  }
  leaf(tag, attributes) {
    this.put(tag, attributes, '/')
  }
  open(tag, attributes) {
    this.put(tag, attributes, '')
    this.depth++
  }
  shut(tag) {
    this.depth--
    this.lines.push(' '.repeat(this.depth) + `</${tag}>`)
  }
}

// ---- meshes: a tetrahedron, and an L that is not convex ----

export const meshes = {
  'convex.obj':
    'v 0.3 0 0\nv 0 0.2 0\nv 0 0 0.25\nv -0.1 -0.1 -0.1\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n',
  'notched.obj':
    'v 0 0 0\nv 0.2 0 0\nv 0.2 0.1 0\nv 0.1 0.1 0\nv 0.1 0.2 0\nv 0 0.2 0\n' +
    'v 0 0 0.1\nv 0.2 0 0.1\nv 0.2 0.1 0.1\nv 0.1 0.1 0.1\nv 0.1 0.2 0.1\nv 0 0.2 0.1\n' +
    'f 1 4 2\nf 2 4 3\nf 1 6 4\nf 4 6 5\nf 7 8 10\nf 8 9 10\nf 7 10 12\nf 10 11 12\n' +
    'f 1 2 8\nf 1 8 7\nf 2 3 9\nf 2 9 8\nf 3 4 10\nf 3 10 9\nf 4 5 11\nf 4 11 10\n' +
    'f 5 6 12\nf 5 12 11\nf 6 1 7\nf 6 7 12\n',
}

// ---- MJCF ----

// What import must refuse by name, and the pattern of its error.
const REFUSED = {
  ball: /ball/,
  connect: /connect/,
  weld: /weld/,
  replicate: /replicate/,
  composite: /composite/,
  'global coordinates': /coordinate/,
  'fitted shape': /mesh/,
  'shell of a geom': /shell/,
}

class Mjcf {
  constructor(seed) {
    this.d = dice(seed)
    this.w = new Writer()
    this.features = new Set()
    this.joints = [] // {name, type, driven}
    this.sites = []
    this.free = false
    this.classes = []
    this.count = 0
    this.refused = this.d.chance(0.06) ? this.d.of(Object.keys(REFUSED)) : null
  }

  note(feature) {
    this.features.add(feature)
  }

  some(share, feature, value) {
    if (!this.d.chance(share)) {
      return undefined
    }
    this.note(feature)
    return value()
  }

  angle(radian) {
    return this.degrees ? (radian * 180) / Math.PI : radian
  }

  // A place: pos and one of the five ways of turning.
  place(share = 0.8) {
    const d = this.d
    const at = {}
    if (d.chance(share)) {
      at.pos = d.reals(3, 0.4)
    }
    switch (d.whole(0, 6)) {
      case 0:
        this.note('quat')
        at.quat = d.reals(4, 1)
        break
      case 1:
        this.note('axisangle')
        at.axisangle = [...d.reals(3, 1), this.angle(d.real(-3, 3))]
        break
      case 2:
        this.note('euler')
        at.euler = d.reals(3, 3).map((x) => this.angle(x))
        break
      case 3:
        this.note('xyaxes')
        at.xyaxes = d.reals(6, 1)
        break
      case 4:
        this.note('zaxis')
        at.zaxis = d.chance(0.2) ? d.of([[0, 0, -1], [0, 0, 2], [1, 0, 0]]) : d.reals(3, 1)
        break
      default:
    }
    return at
  }

  // What has no effect on the robot here, so that the report must list it.
  unread(pairs, share = 0.08) {
    const out = {}
    for (const [key, value] of Object.entries(pairs)) {
      if (this.d.chance(share)) {
        out[key] = typeof value === 'function' ? value() : value
      }
    }
    return out
  }

  klass() {
    if (!this.classes.length || !this.d.chance(0.3)) {
      return undefined
    }
    this.note('class')
    return this.d.of(this.classes)
  }

  compiler() {
    const d = this.d
    const angle = d.of([undefined, 'degree', 'radian', 'radian'])
    this.degrees = angle !== 'radian'
    this.autolimits = !d.chance(0.25)
    this.fromgeom = this.refused === 'fitted shape' ? 'true' : d.of([undefined, undefined, 'auto', 'true', 'false'])
    this.note(`inertiafromgeom ${this.fromgeom ?? 'auto'}`)
    this.note(`angle ${angle ?? 'default'}`)
    const sequence = ['x', 'y', 'z'].sort(() => d.unit() - 0.5)
    const own = {
      angle,
      eulerseq: this.some(0.5, 'eulerseq', () =>
        d.chance(0.5) ? sequence.map((c) => (d.chance(0.5) ? c : c.toUpperCase())).join('') : d.of(['XYZ', 'zyx', 'zxz'])),
      autolimits: this.autolimits ? d.of([undefined, 'true']) : 'false',
      inertiafromgeom: this.fromgeom,
      inertiagrouprange: this.some(0.2, 'inertiagrouprange', () => [0, d.whole(2, 4)]),
      settotalmass: this.some(0.1, 'settotalmass', () => d.real(1, 9)),
      meshdir: this.some(0.3, 'meshdir', () => '.'),
      coordinate: this.refused === 'global coordinates' ? 'global' : undefined,
    }
    if (this.fromgeom === 'false') {
      own.inertiagrouprange = undefined
    }
    this.range = own.inertiagrouprange ?? [0, 5]
    Object.assign(own, this.unread({ boundmass: 1e-9, boundinertia: 1e-12, balanceinertia: 'true', fitaabb: 'true' }, 0.06))
    const twice = d.chance(0.2)
    if (twice) {
      // Several sections add up
      const second = { eulerseq: own.eulerseq, inertiagrouprange: own.inertiagrouprange }
      delete own.eulerseq
      delete own.inertiagrouprange
      this.note('two sections')
      this.w.leaf('compiler', own)
      this.w.leaf('compiler', second)
    } else if (Object.values(own).some((x) => x !== undefined)) {
      this.w.leaf('compiler', own)
    }
  }

  defaults() {
    const d = this.d
    const names = ['a', 'b', 'c'].slice(0, d.whole(0, 3))
    if (!names.length) {
      return
    }
    this.note('default')
    const body = () => {
      if (d.chance(0.6)) {
        this.w.leaf('geom', {
          density: d.chance(0.5) ? d.real(300, 2000) : undefined,
          size: d.chance(0.3) ? [0.05, 0.06, 0.07] : undefined,
          type: d.chance(0.3) ? d.of(['box', 'ellipsoid', 'capsule']) : undefined,
          [d.of(['quat', 'axisangle'])]: d.chance(0.2) ? d.reals(4, 1) : undefined,
          contype: d.chance(0.3) ? d.whole(0, 1) : undefined,
          rgba: d.chance(0.2) ? [1, 0, 0, 1] : undefined,
          ...this.unread({ friction: [1, 0.1, 0.1], condim: 4 }),
        })
      }
      if (d.chance(0.6)) {
        this.w.leaf('joint', {
          axis: d.chance(0.5) ? d.reals(3, 1) : undefined,
          pos: d.chance(0.2) ? d.reals(3, 0.1) : undefined,
          armature: d.chance(0.3) ? d.real(0.01, 0.1) : undefined,
          damping: d.chance(0.3) ? d.real(0.1, 1) : undefined,
          ...this.unread({ margin: 0.01, solreflimit: [0.02, 1] }),
        })
      }
      if (d.chance(0.3)) {
        this.w.leaf('motor', { gear: [d.real(-30, 30)], ...this.limits('ctrl', [-1, 1], 0.5) })
      }
      if (d.chance(0.3)) {
        this.w.leaf('position', { kp: d.real(10, 100), ...this.limits('force', [-20, 30], 0.5) })
      }
      if (d.chance(0.2)) {
        this.w.leaf('general', { gear: [d.real(1, 3)], ...this.limits('force', [-15, 12], 1) })
      }
      if (d.chance(0.2)) {
        this.w.leaf('equality', { active: d.of(['true', 'false']) })
      }
      if (d.chance(0.3)) {
        this.w.leaf('site', { quat: d.chance(0.5) ? d.reals(4, 1) : undefined, type: 'box' })
      }
    }
    this.w.open('default', d.chance(0.5) ? { class: 'main' } : undefined)
    if (d.chance(0.5)) {
      body()
    }
    for (const [i, name] of names.entries()) {
      this.w.open('default', { class: name })
      body()
      this.classes.push(name)
      if (i === 1) {
        this.note('class in a class')
        this.w.open('default', { class: 'inner' })
        body()
        this.w.shut('default')
        this.classes.push('inner')
      }
      this.w.shut('default')
    }
    this.w.shut('default')
  }

  // A range with the word that switches it, which MuJoCo needs without autolimits.
  limits(what, range, share) {
    if (!this.d.chance(share)) {
      return {}
    }
    return { [`${what}range`]: range, [`${what}limited`]: this.autolimits ? undefined : 'true' }
  }

  assets() {
    const d = this.d
    this.mesh = []
    this.hulls = []
    if (!d.chance(0.35) && this.refused !== 'fitted shape') {
      return
    }
    this.note('mesh')
    this.w.open('asset')
    for (const name of ['convex', 'notched']) {
      const how = this.d.of([undefined, 'exact', 'convex', 'convex', 'legacy', 'shell'])
      if (how) {
        this.note(`mesh inertia ${how}`)
      }
      const own = d.chance(0.5) ? undefined : `${name}-mesh`
      const scale = this.some(0.5, 'scale of a mesh', () => [d.real(0.5, 1.5), d.real(0.5, 1.5), d.real(0.5, 1.5)])
      this.w.leaf('mesh', {
        name: own,
        file: `${name}.obj`,
        scale,
        inertia: how,
        refpos: this.some(0.3, 'refpos of a mesh', () => [d.real(-0.1, 0.1), d.real(-0.1, 0.1), d.real(-0.1, 0.1)]),
        refquat: scale && scale[0] !== scale[1] ? undefined : this.some(0.3, 'refquat of a mesh', () => [1, d.real(-1, 1), d.real(-1, 1), 0]),
        ...this.unread({ maxhullvert: how === 'convex' ? undefined : 20, smoothnormal: 'true' }),
      })
      this.mesh.push(own ?? name)
      if (how === 'convex') {
        this.hulls.push(own ?? name)
      }
    }
    if (d.chance(0.5)) {
      this.w.leaf('texture', { name: 't', type: '2d', builtin: 'flat', width: 8, height: 8 })
      this.w.leaf('material', { name: 'm', rgba: [0.1, 0.2, 0.3, 1], ...this.unread({ shininess: 0.3, texture: 't' }) })
      this.material = true
    }
    this.w.shut('asset')
  }

  geom(weighs) {
    const d = this.d
    let type = d.of(['sphere', 'box', 'ellipsoid', 'capsule', 'cylinder', 'mesh', undefined])
    const own = { class: this.klass() }
    if (type === 'mesh' && !this.mesh.length) {
      type = 'box'
    }
    own.type = type
    if (this.refused === 'shell of a geom' && weighs && this.fromgeom !== 'false') {
      own.shellinertia = 'true'
      own.group = 0
      this.shell = true
    }
    this.note(`geom ${type ?? 'by default'}`)
    if (type === 'mesh') {
      own.mesh = d.of(this.mesh)
    } else if (['box', 'ellipsoid', 'capsule', 'cylinder'].includes(type) && d.chance(0.5)) {
      this.note(`${type} fromto`)
      own.fromto = d.chance(0.3) ? [0, 0, 0, ...d.of([[0.1, 0.1, 0.1], [0, 0, -0.2], [0.2, 0, 0], [0, 0, 0.3]])] : d.reals(6, 0.3)
      own.size = [d.real(0.02, 0.06)]
    } else {
      own.size = [d.real(0.03, 0.1), d.real(0.03, 0.1), d.real(0.03, 0.1)]
    }
    if (!own.fromto) {
      Object.assign(own, this.place())
    }
    if (d.chance(0.3)) {
      this.note('mass of a geom')
      own.mass = d.chance(0.1) && !weighs ? 0 : d.real(0.2, 2)
    } else if (d.chance(0.4)) {
      this.note('density')
      own.density = d.chance(0.1) && !weighs ? 0 : d.real(300, 3000)
    }
    own.group ??= weighs ? undefined : this.some(0.3, 'group', () => d.whole(0, 5))
    own.contype = d.chance(0.2) ? d.whole(0, 1) : undefined
    own.conaffinity = d.chance(0.2) ? d.whole(0, 1) : undefined
    own.material = this.material && d.chance(0.3) ? 'm' : undefined
    own.rgba = d.chance(0.2) ? [0.1, 0.2, 0.3, 1] : undefined
    own.name = d.chance(0.3) ? `g${this.count++}` : undefined
    Object.assign(own, this.unread({
      friction: [0.8], condim: 3, solref: [0.01, 1], solimp: [0.9, 0.95, 0.001], margin: 0.001,
      gap: 0, priority: 1, solmix: 2, user: undefined, fluidshape: 'ellipsoid',
    }))
    this.w.leaf('geom', own)
  }

  joint(type, many) {
    const d = this.d
    const name = `j${this.joints.length}`
    if (type === 'free') {
      this.note('free joint')
      this.free = true
      if (d.chance(0.5)) {
        this.w.leaf('freejoint', { name: 'root', ...this.unread({ group: 3 }) })
      } else {
        this.w.leaf('joint', { name: 'root', type: 'free' })
      }
      return
    }
    this.note(`joint ${type}`)
    const unit = type === 'slide' ? (x) => x : (x) => this.angle(x)
    const own = {
      name,
      class: this.klass(),
      type: type === 'hinge' ? d.of([undefined, 'hinge']) : type,
      axis: many || d.chance(0.8) ? d.reals(3, 2) : undefined,
      pos: this.some(0.4, 'anchor of a joint', () => d.reals(3, 0.2)),
      ref: this.some(0.2, 'ref', () => unit(d.real(-0.5, 0.5))),
      range: d.chance(0.75) ? [unit(d.real(-2, -0.6)), unit(d.real(0.6, 2))] : undefined,
      damping: this.some(0.4, 'damping', () => d.real(0.1, 2)),
      armature: this.some(0.4, 'armature', () => d.real(0.001, 0.2)),
      frictionloss: this.some(0.2, 'frictionloss', () => d.real(0.01, 0.3)),
      stiffness: this.some(0.2, 'stiffness', () => d.real(0.5, 20)),
      springref: this.some(0.2, 'springref', () => unit(d.real(-0.5, 0.5))),
      actuatorfrcrange: this.some(0.2, 'actuatorfrcrange', () => [d.real(-40, -5), d.real(5, 40)]),
    }
    // Without autolimits MuJoCo refuses a range that no word switches on or off
    if (own.range) {
      own.limited = this.autolimits ? d.of([undefined, undefined, 'auto', 'true', 'false']) : d.of(['true', 'false'])
      this.note(`limited ${own.limited ?? 'by default'}`)
    }
    if (own.actuatorfrcrange) {
      own.actuatorfrclimited = this.autolimits ? d.of([undefined, 'true', 'false']) : d.of(['true', 'false'])
    }
    Object.assign(own, this.unread({
      margin: 0.01, solreflimit: [0.02, 1], solimplimit: [0.9, 0.95, 0.001], solreffriction: [0.02, 1], group: 1,
      actuatorgravcomp: 'true', springdamper: [0.1, 1],
    }, 0.05))
    this.w.leaf('joint', own)
    this.joints.push({ name, type })
  }

  inertial() {
    const d = this.d
    const own = { pos: d.reals(3, 0.2), mass: d.real(0.2, 3) }
    const [a, b, c] = [d.real(0.01, 0.05), d.real(0.01, 0.05), d.real(0.01, 0.05)]
    if (d.chance(0.3)) {
      this.note('fullinertia')
      const x = d.real(-0.004, 0.004)
      own.fullinertia = [a + b, b + c, a + c, x, -x, x / 2]
    } else {
      this.note('diaginertia')
      own.diaginertia = [a + b, b + c, a + c]
      Object.assign(own, this.place(), { pos: own.pos })
    }
    this.w.leaf('inertial', own)
  }

  site() {
    const d = this.d
    const own = { name: `s${this.sites.length}`, class: this.klass() }
    if (d.chance(0.25)) {
      this.note('site fromto')
      Object.assign(own, { type: d.of(['capsule', 'box', 'cylinder', 'ellipsoid']), fromto: d.reals(6, 0.3), size: [0.01] })
    } else {
      Object.assign(own, this.place())
    }
    Object.assign(own, this.unread({ rgba: [1, 0, 0, 1], group: 3 }))
    this.sites.push(own.name)
    this.w.leaf('site', own)
  }

  matter(root) {
    const d = this.d
    const moves = true
    const own = this.fromgeom !== 'true' && (this.fromgeom === 'false' || d.chance(0.5))
    const inertial = own || d.chance(0.2)
    if (inertial) {
      this.inertial()
    }
    if (!inertial || this.fromgeom === 'true') {
      this.geom(moves)
    }
    for (let i = d.whole(0, 2); i > 0; i--) {
      this.geom(false)
    }
    for (let i = d.whole(0, 1); i > 0; i--) {
      this.site()
    }
    if (d.chance(0.08)) {
      this.w.leaf('camera', { name: `c${this.count++}`, pos: d.reals(3, 1) })
    }
    if (d.chance(0.08)) {
      this.w.leaf('light', { pos: d.reals(3, 1) })
    }
    void root
  }

  // Content inside a frame at times, whose place it shares.
  framed(write) {
    const d = this.d
    if (!d.chance(0.15)) {
      write()
      return
    }
    this.note('frame')
    this.w.open('frame', { ...this.place(), childclass: this.klass() })
    if (d.chance(0.3)) {
      this.note('frame in a frame')
      this.w.open('frame', this.place())
      write()
      this.w.shut('frame')
    } else {
      write()
    }
    this.w.shut('frame')
  }

  body(depth, top) {
    const d = this.d
    const name = `b${this.bodies++}`
    this.w.open('body', {
      name,
      ...this.place(),
      childclass: this.klass(),
      ...this.unread({ gravcomp: 0.5, user: undefined }, 0.04),
    })
    const free = top && this.wantsFree && !this.free
    const count = free ? 0 : d.of([0, 1, 1, 1, 1, 2, 3])
    if (free) {
      this.joint('free')
    }
    if (this.refused === 'ball' && top) {
      this.w.leaf('joint', { type: 'ball' })
    }
    for (let i = 0; i < count; i++) {
      this.framed(() => this.joint(d.chance(0.2) ? 'slide' : 'hinge', count > 1))
    }
    this.note(`${count} joints of a body`)
    this.framed(() => this.matter(top))
    if (this.refused === 'replicate' && top) {
      this.w.open('replicate', { count: 2, offset: [0.1, 0, 0] })
      this.w.leaf('site', {})
      this.w.shut('replicate')
    }
    for (let i = depth > 3 ? 0 : d.whole(0, 2); i > 0 && this.bodies < 9; i--) {
      this.framed(() => this.body(depth + 1, false))
    }
    this.w.shut('body')
  }

  world() {
    const d = this.d
    this.bodies = 0
    this.wantsFree = d.chance(0.4) || this.refused === 'fitted shape'
    this.w.open('worldbody')
    if (d.chance(0.3)) {
      this.w.leaf('geom', { type: 'plane', size: [1, 1, 0.1] })
    }
    if (d.chance(0.2)) {
      this.w.leaf('light', { pos: [0, 0, 3] })
    }
    const first = () => {
      this.body(0, true)
      // Every file has at least this joint and mass
      this.w.open('body', { name: 'end', pos: [0.1, 0.2, 0.3] })
      this.w.leaf('joint', { name: 'last', axis: [0, 1, 0], range: this.degrees ? [-60, 60] : [-1, 1], limited: 'true' })
      this.joints.push({ name: 'last', type: 'hinge' })
      this.w.leaf('inertial', { pos: [0.1, 0, 0], mass: 1, diaginertia: [0.02, 0.02, 0.02] })
      this.w.leaf('geom', { name: 'tip', type: 'sphere', size: [0.05], mass: 1 })
      this.w.shut('body')
      if (this.refused === 'composite') {
        this.w.leaf('composite', { type: 'grid', count: [2, 2, 1], spacing: 0.1 })
      }
    }
    this.w.open('body', { name: 'trunk', pos: [0, 0, 1] })
    if (this.wantsFree) {
      this.joint('free')
    }
    this.w.leaf('inertial', { pos: [0, 0, 0.1], mass: 2, diaginertia: [0.03, 0.04, 0.05] })
    this.pair = this.some(0.2, 'pair', () => 'hull')
    this.w.leaf('geom', { name: this.pair, type: 'box', size: [0.1, 0.1, 0.1], mass: 2 })
    // MuJoCo has no hull of a mesh without a geom
    for (const mesh of this.hulls) {
      this.w.leaf('geom', { type: 'mesh', mesh, mass: 0.3 })
    }
    if (this.refused === 'fitted shape') {
      this.w.leaf('geom', { type: 'box', mesh: this.mesh[0], mass: 1, group: 0 })
    }
    this.site()
    first()
    this.w.shut('body')
    this.w.shut('worldbody')
  }

  actuators() {
    const d = this.d
    if (d.chance(0.2)) {
      return
    }
    this.w.open('actuator')
    for (let i = d.whole(1, 6); i > 0; i--) {
      const kind = d.of(['motor', 'motor', 'position', 'velocity', 'general', 'damper', 'intvelocity', 'cylinder'])
      const joint = d.of(this.joints).name
      const own = { class: this.klass() }
      this.note(`actuator ${kind}`)
      own[d.chance(0.1) ? 'jointinparent' : 'joint'] = joint
      if (own.jointinparent) {
        this.note('jointinparent')
      }
      own.gear = this.some(0.5, 'gear', () => (d.chance(0.3) ? [d.real(-20, 20), 0, 0, 0, 0, 0] : [d.real(-20, 20)]))
      const low = () => (d.chance(0.1) ? 0 : d.real(-20, -1))
      own.ctrlrange = this.some(0.5, 'ctrlrange', () => [low(), d.real(1, 20)])
      own.forcerange = this.some(0.5, 'forcerange', () => [low(), d.real(1, 20)])
      if (kind === 'damper') {
        own.ctrlrange = [0, 5]
        own.kv = d.real(0.1, 2)
      } else if (kind === 'position') {
        own.kp = d.real(5, 100)
        own.kv = d.chance(0.3) ? 1 : undefined
      } else if (kind === 'velocity') {
        own.kv = d.real(0.1, 5)
      } else if (kind === 'intvelocity') {
        own.actrange = [-3, 3]
      } else if (kind === 'cylinder') {
        own.area = d.real(1, 4)
      } else if (kind === 'general') {
        own.gainprm = d.chance(0.6) || this.classes.length ? [d.real(0.5, 5)] : undefined
        own.biastype = d.of([undefined, 'none', 'affine'])
        own.biasprm = own.biastype === 'affine' ? [0, -10, -1] : undefined
        own.dyntype = d.of([undefined, undefined, 'filter', 'integrator'])
        own.dynprm = own.dyntype === 'filter' ? [0.05] : undefined
        own.actrange = own.dyntype === 'integrator' ? [-3, 2] : undefined
        this.note(`general ${own.dyntype ?? 'direct'} ${own.biastype ?? 'none'}`)
      }
      for (const range of ['ctrl', 'force', 'act']) {
        const always = (kind === 'damper' && range === 'ctrl') || (kind === 'intvelocity' && range === 'act')
        if (own[`${range}range`] && !always) {
          const words = range === 'act' ? ['true'] : ['true', 'false']
          own[`${range}limited`] = d.of(this.autolimits ? [undefined, undefined, ...words] : words)
        }
      }
      Object.assign(own, this.unread({ name: `m${i}`, group: 2, lengthrange: [0, 1], cranklength: undefined }))
      this.w.leaf(kind, own)
    }
    if (d.chance(0.1)) {
      this.w.leaf('motor', { site: d.of(this.sites), gear: [0, 0, 1, 0, 0, 0] })
      this.note('actuator of a site')
    }
    this.w.shut('actuator')
  }

  equalities() {
    const d = this.d
    const loop = this.refused === 'connect' || this.refused === 'weld'
    if (loop || (this.joints.length > 2 && d.chance(0.3))) {
      this.w.open('equality')
      if (this.refused === 'connect') {
        this.w.leaf('connect', { body1: 'trunk', body2: 'end', anchor: [0, 0, 0], active: 'true' })
      } else if (this.refused === 'weld') {
        this.w.leaf('weld', { body1: 'trunk', body2: 'end', active: 'true' })
      }
      if (d.chance(0.3)) {
        this.note('inactive weld')
        this.w.leaf('weld', { body1: 'trunk', body2: 'end', active: 'false' })
      }
      const [one, other] = [this.joints[0], this.joints[1]]
      if (loop) {
        this.w.shut('equality')
        return
      }
      if (d.chance(0.7) && one.type === other.type) {
        this.note('equality of two joints')
        this.w.leaf('joint', {
          joint1: one.name, joint2: other.name, active: d.of([undefined, 'true', 'false']), class: this.klass(),
          polycoef: d.of([undefined, [0, 1], [d.real(-0.1, 0.1), d.real(0.3, 1.5), 0, 0, 0]]),
          ...this.unread({ solref: [0.01, 1], name: 'e' }),
        })
      } else {
        this.note('equality of one joint')
        this.w.leaf('joint', { joint1: this.joints[2].name, polycoef: d.chance(0.5) ? [d.real(-0.2, 0.2), 0, 0, 0, 0] : undefined, class: this.klass() })
      }
      this.w.shut('equality')
    }
  }

  sensors() {
    const d = this.d
    if (!this.sites.length || d.chance(0.3)) {
      return
    }
    this.w.open('sensor')
    if (d.chance(0.7)) {
      const site = d.of(this.sites)
      this.note('imu')
      this.imu = site
      for (const kind of d.of([['gyro', 'accelerometer'], ['accelerometer'], ['gyro']])) {
        this.w.leaf(kind, { site, name: d.chance(0.5) ? `${kind}-0` : undefined, ...this.unread({ noise: 0.01, cutoff: 100 }) })
      }
    }
    if (d.chance(0.5)) {
      this.w.leaf('jointpos', { joint: 'last' })
    }
    for (const kind of ['force', 'torque', 'touch', 'velocimeter', 'magnetometer', 'rangefinder']) {
      if (d.chance(0.1)) {
        this.w.leaf(kind, { site: d.of(this.sites) })
      }
    }
    for (const kind of ['jointvel', 'jointlimitpos']) {
      if (d.chance(0.1)) {
        this.w.leaf(kind, { joint: 'last' })
      }
    }
    if (d.chance(0.1)) {
      this.w.leaf('framequat', { objtype: 'site', objname: d.of(this.sites) })
      this.w.leaf('subtreecom', { body: 'trunk' })
      this.w.leaf('clock')
    }
    this.w.shut('sensor')
  }

  keys() {
    const d = this.d
    if (d.chance(0.4)) {
      return
    }
    this.w.open('keyframe')
    for (let k = d.whole(1, 2); k > 0; k--) {
      const qpos = this.free ? [...d.reals(3, 1), 1, 0, 0, 0] : []
      this.note('keyframe')
      qpos.push(...this.joints.map(() => d.real(-0.2, 0.2)))
      this.w.leaf('key', {
        name: d.chance(0.8) ? `pose${k}` : undefined, qpos: d.chance(0.9) ? qpos : undefined,
        ...this.unread({ time: 1, qvel: () => Array((this.free ? 6 : 0) + this.joints.length).fill(0) }),
      })
    }
    this.w.shut('keyframe')
  }

  write() {
    const d = this.d
    this.w.open('mujoco', { model: 'generated' })
    this.compiler()
    if (d.chance(0.3)) {
      this.w.leaf('option', this.unread({ timestep: 0.001, integrator: 'implicitfast', gravity: [0, 0, -1.62], wind: [1, 0, 0] }, 0.5))
    }
    if (d.chance(0.1)) {
      this.w.leaf('statistic', { extent: 2 })
    }
    if (d.chance(0.1)) {
      this.w.open('visual')
      this.w.leaf('headlight', { ambient: [0.1, 0.1, 0.1] })
      this.w.shut('visual')
    }
    if (d.chance(0.1)) {
      this.w.leaf('size', { memory: '2M' })
    }
    if (d.chance(0.1)) {
      this.w.open('custom')
      this.w.leaf('numeric', { name: 'gain', data: [1, 2] })
      this.w.leaf('text', { name: 'by', data: 'dice' })
      this.w.shut('custom')
    }
    this.defaults()
    this.assets()
    this.world()
    if (d.chance(0.15)) {
      this.w.open('contact')
      this.w.leaf('exclude', { body1: 'trunk', body2: 'end' })
      if (this.pair) {
        this.w.leaf('pair', { geom1: this.pair, geom2: 'tip' })
      }
      this.w.shut('contact')
    }
    if (d.chance(0.1)) {
      this.w.open('tendon')
      this.w.open('fixed', { name: 'tendon' })
      this.w.leaf('joint', { joint: 'last', coef: 1 })
      this.w.shut('fixed')
      if (this.sites.length > 1) {
        this.w.open('spatial', { width: 0.01 })
        this.w.leaf('site', { site: this.sites[0] })
        this.w.leaf('site', { site: this.sites[1] })
        this.w.shut('spatial')
      }
      this.w.shut('tendon')
    }
    this.equalities()
    this.actuators()
    this.sensors()
    this.keys()
    this.w.shut('mujoco')
    if (this.refused === 'shell of a geom' && !this.shell) {
      this.refused = null
    }
    return { text: this.w.lines.join('\n') + '\n', features: [...this.features], refused: this.refused && REFUSED[this.refused], imu: this.imu }
  }
}

// ---- URDF ----

class Urdf {
  constructor(seed) {
    this.d = dice(seed)
    this.w = new Writer()
    this.features = new Set()
    this.joints = []
    this.sensors = []
  }

  origin() {
    const d = this.d
    if (d.chance(0.8)) {
      this.w.leaf('origin', { xyz: d.chance(0.8) ? d.reals(3, 0.4) : undefined, rpy: d.chance(0.8) ? d.reals(3, 3) : undefined })
    }
  }

  shape() {
    const d = this.d
    this.w.open('geometry')
    switch (d.whole(0, 4)) {
      case 0:
        this.w.leaf('box', { size: [0.1, 0.2, 0.1] })
        break
      case 1:
        this.w.leaf('sphere', { radius: 0.05 })
        break
      case 2:
        this.w.leaf('cylinder', { radius: 0.05, length: 0.1 })
        break
      case 3:
        this.features.add('urdf capsule')
        this.w.leaf('capsule', { radius: 0.05, length: 0.1 })
        break
      default:
        this.features.add('urdf mesh')
        this.w.leaf('mesh', { filename: 'convex.obj', scale: d.chance(0.5) ? [0.5, 1, 2] : undefined })
    }
    this.w.shut('geometry')
  }

  link(name, massless) {
    const d = this.d
    this.w.open('link', { name })
    if (!massless) {
      const [a, b, c, x] = [d.real(0.01, 0.05), d.real(0.01, 0.05), d.real(0.01, 0.05), d.real(-0.003, 0.003)]
      const full = d.chance(0.4)
      this.features.add(full ? 'urdf full inertia' : 'urdf diagonal inertia')
      this.w.open('inertial')
      this.origin()
      this.w.leaf('mass', { value: d.real(0.2, 4) })
      this.w.leaf('inertia', { ixx: a + b, iyy: b + c, izz: a + c, ixy: full ? x : 0, ixz: full ? -x : 0, iyz: full ? x / 2 : 0 })
      this.w.shut('inertial')
      for (const kind of ['visual', 'collision']) {
        if (d.chance(0.4)) {
          this.w.open(kind)
          this.origin()
          this.shape()
          if (kind === 'visual' && d.chance(0.3)) {
            this.w.open('material', { name: 'red' })
            this.w.leaf('color', { rgba: [1, 0, 0, 1] })
            this.w.shut('material')
          }
          this.w.shut(kind)
        }
      }
      if (d.chance(0.05)) {
        this.w.open('contact')
        this.w.leaf('lateral_friction', { value: 1 })
        this.w.shut('contact')
      }
    }
    this.w.shut('link')
  }

  joint(i, parent, child) {
    const d = this.d
    const type = child === 'end' ? 'revolute' : d.of(['revolute', 'revolute', 'continuous', 'prismatic', 'fixed'])
    const name = `j${i}`
    this.features.add(`urdf ${type}`)
    this.w.open('joint', { name, type })
    this.w.leaf('parent', { link: parent })
    this.w.leaf('child', { link: child })
    this.origin()
    if (type !== 'fixed' && d.chance(0.8)) {
      this.w.leaf('axis', { xyz: d.reals(3, 2) })
    }
    if (type !== 'fixed') {
      const range = type === 'continuous' ? {} : { lower: d.real(-2, -0.5), upper: d.real(0.5, 2) }
      this.w.leaf('limit', { ...range, effort: d.real(5, 60), velocity: d.real(1, 20) })
      if (d.chance(0.4)) {
        this.features.add('urdf dynamics')
        this.w.leaf('dynamics', { damping: d.real(0.1, 2), friction: d.chance(0.5) ? d.real(0.01, 0.3) : undefined })
      }
      const leader = this.joints.find((other) => other.type === type && !other.follows)
      if (leader && type !== 'fixed' && child !== 'end' && d.chance(0.15)) {
        this.features.add('urdf mimic')
        this.w.leaf('mimic', { joint: leader.name, multiplier: d.chance(0.7) ? d.real(0.3, 1.5) : undefined, offset: d.chance(0.5) ? d.real(-0.1, 0.1) : undefined })
        this.joints.push({ name, type, follows: leader.name })
      } else {
        this.joints.push({ name, type })
      }
      if (d.chance(0.1)) {
        this.w.leaf('safety_controller', { k_velocity: 10, k_position: 15, soft_lower_limit: -1, soft_upper_limit: 1 })
      }
      if (d.chance(0.1)) {
        this.w.leaf('calibration', { rising: 0 })
      }
    } else {
      this.joints.push({ name, type })
    }
    this.w.shut('joint')
  }

  write() {
    const d = this.d
    const count = d.whole(2, 9)
    this.w.open('robot', { name: 'generated', version: d.chance(0.2) ? '1.0' : undefined })
    this.w.open('mujoco')
    this.w.leaf('compiler', { fusestatic: 'false', discardvisual: 'true', balanceinertia: undefined })
    this.w.shut('mujoco')
    this.link('world', true)
    for (let i = 1; i < count; i++) {
      this.link(`l${i}`, false)
    }
    this.link('end', false)
    for (let i = 1; i < count; i++) {
      this.joint(i, i > 1 ? `l${d.whole(1, i - 1)}` : 'world', `l${i}`)
    }
    this.joint(count, `l${count - 1}`, 'end')
    if (d.chance(0.3)) {
      const frame = d.of([undefined, 'child', 'parent', 'sensor'])
      const measure = d.of([undefined, 'child_to_parent', 'parent_to_child'])
      this.features.add('urdf force-torque sensor')
      this.ft = { frame, measure }
      this.w.open('gazebo', { reference: `j${count}` })
      this.w.open('sensor', { name: 'wrist', type: 'force_torque' })
      this.w.lines.push('<update_rate>100</update_rate>')
      this.w.open('force_torque')
      if (frame) {
        this.w.lines.push(`<frame>${frame}</frame>`)
      }
      if (measure) {
        this.w.lines.push(`<measure_direction>${measure}</measure_direction>`)
      }
      this.w.shut('force_torque')
      this.w.shut('sensor')
      this.w.shut('gazebo')
    }
    if (d.chance(0.2)) {
      this.features.add('gazebo of a link')
      this.w.open('gazebo', { reference: 'end' })
      this.w.lines.push('<mu1>0.9</mu1>', '<selfCollide>true</selfCollide>')
      this.w.shut('gazebo')
    }
    if (d.chance(0.15)) {
      this.features.add('ros2_control')
      this.w.open('ros2_control', { name: 'bench', type: 'system' })
      this.w.open('joint', { name: `j${count}` })
      this.w.leaf('command_interface', { name: 'position' })
      this.w.shut('joint')
      this.w.shut('ros2_control')
    }
    if (d.chance(0.2)) {
      this.w.open('transmission', { name: 't' })
      this.w.lines.push('<type>transmission_interface/SimpleTransmission</type>')
      this.w.open('joint', { name: `j${count}` })
      this.w.shut('joint')
      this.w.open('actuator', { name: 'm' })
      this.w.lines.push('<hardwareInterface>EffortJointInterface</hardwareInterface>')
      this.w.lines.push('<mechanicalReduction>50</mechanicalReduction>')
      this.w.shut('actuator')
      this.w.shut('transmission')
    }
    this.w.shut('robot')
    return { text: this.w.lines.join('\n') + '\n', features: [...this.features], refused: null, ft: this.ft }
  }
}

// File number n of a seed; every fifth is a URDF.
export function generate(seed, n) {
  const own = Math.imul(seed * 65537 + n, 2654435761)
  return n % 5 === 4 ? { name: `${n}.urdf`, ...new Urdf(own).write() } : { name: `${n}.xml`, ...new Mjcf(own).write() }
}
