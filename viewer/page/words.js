// SPDX-License-Identifier: Apache-2.0
// Translates abbreviations in the names of joints and signals into words. A search for "elbow
// torque" thus finds torque_LElbj_nm.

const PARTS = {
  l: 'left', r: 'right', fl: 'front left', fr: 'front right', hl: 'hind left', hr: 'hind right',
  lf: 'left front', rf: 'right front', lh: 'left hind', rh: 'right hind', rl: 'rear left', rr: 'rear right',
  sh: 'shoulder', shld: 'shoulder', elb: 'elbow', elbj: 'elbow', forearm: 'forearm', wr: 'wrist', wrj: 'wrist',
  ank: 'ankle', kn: 'knee', haa: 'hip abduction', hfe: 'hip flexion', kfe: 'knee flexion', torso: 'torso waist',
  sag: 'sagittal pitch', lat: 'lateral roll', plate: 'plate', yaw: 'yaw', abd: 'abduction',
  q: 'angle position', qm: 'motor angle position', qd: 'velocity speed rate', qmd: 'motor velocity speed rate',
  v: 'voltage', i: 'current', a: 'current', nm: 'torque moment', n: 'force', c: 'temperature', w: 'power',
  fx: 'force x', fy: 'force y', fz: 'force z', tx: 'torque moment x', ty: 'torque moment y', tz: 'torque moment z',
  pa: 'pressure', rad: 'angle',
};

/** Returns a name followed by the words for its parts, in lower case. */
export function describe(name) {
  const parts = name.replace(/([a-z0-9])([A-Z])/g, '$1 $2').replace(/([A-Z])([A-Z][a-z])/g, '$1 $2')
    .toLowerCase().split(/[^a-z0-9]+/);
  return [name.toLowerCase(), ...parts.map((part) => PARTS[part] ?? part)].join(' ');
}
