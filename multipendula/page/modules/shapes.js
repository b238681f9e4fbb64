// One mode of a problem, undamped or from undamped ones: |l| (rad/s), damping ratio, rate Re l and turn |Im l| (1/s), its
// shape x and with dampers `twist`, the imaginary part of it.

import { zeros } from "./matrices.js";
import { dampedOf } from "./quadratic.js";

const [UNSTABLE, UNDAMPED, UNSEEN] = [-1e-12, 1e-14, 1e-20];

// What a row does when it is let go: "swings", "grows", "decays" (overdamped), or "shifts" everything.
export function mannerOf({ omega, growing, ratio }) {
  if (!omega) return "shifts";
  if (growing) return "grows";
  return ratio >= 1 ? "decays" : "swings";
}

export function undampedMode(x, form) {
  const [inertia, stiffness] = form(x);
  const square = stiffness / inertia;
  const omega = Math.sqrt(Math.abs(square));
  return { omega, ratio: square < 0 ? -1 : 0, rate: square < 0 ? omega : 0, turn: square > 0 ? omega : 0, x, twist: null };
}

// Damped modes from undamped ones, which are orthogonal; `form` are x'Mz, x'Kz, x'Dz.  Those with a `free` square are at
// 0, and left out; those without a damper are as they were.
export function dampedModes(vectors, form, free = (square) => !square) {
  const scaled = vectors.map((x) => {
    const size = Math.sqrt(form(x)[0]);
    return x.map((value) => value / size);
  });
  const drains = scaled.map((x) => form(x)[2]);
  const noise = UNSEEN * Math.max(...drains);
  const isFree = scaled.map((x) => free(form(x)[1]));
  const [damped, apart] = [true, false].map((on) => scaled.filter((_, i) => drains[i] > noise === on && (on || !isFree[i])));
  const kappa = damped.map((x) => (free(form(x)[1]) ? 0 : form(x)[1]));
  const Z = zeros(damped.length);
  damped.forEach((x, i) => damped.slice(0, i + 1).forEach((z, j) => (Z[i][j] = Z[j][i] = form(x, z)[2])));
  const mixed = (part) => {
    const x = new Float64Array(scaled[0].length);
    damped.forEach((own, i) => own.forEach((value, k) => (x[k] += part[i] * value)));
    return x;
  };
  const modes = dampedOf(kappa, Z).flatMap(({ re, im, vectors: own }) => own.map(({ a, b }) => dampedMode(re, im, mixed(a), mixed(b), form)));
  return [...modes, ...apart.map((x) => ({ ...undampedMode(x, form), twist: x.map(() => 0) }))];
}

// |l| and the damping ratio from the shape: |l|^2 = k/m and -2 Re l = d/m of one that turns, a root of a real one.
function dampedMode(re, im, x, twist, form) {
  const [m, k, d] = form(x).map((value, i) => value + form(twist)[i]);
  if (im) {
    const omega = Math.sqrt(k / m);
    const ratio = d / (2 * Math.sqrt(k * m));
    const tidy = ratio < UNDAMPED ? 0 : ratio;
    return { omega, ratio: tidy, rate: -tidy * omega, turn: omega * Math.sqrt((1 - tidy) * (1 + tidy)), x, twist };
  }
  const real = Math.hypot(...x) >= Math.hypot(...twist) ? x : twist;
  const [inertia, stiffness, drag] = form(real);
  const large = -(drag + Math.sqrt(Math.max(0, drag ** 2 - 4 * inertia * stiffness))) / 2;
  const roots = [large / inertia, stiffness / large].filter(Number.isFinite);
  const rate = roots.reduce((best, root) => (Math.abs(root - re) < Math.abs(best - re) ? root : best), roots[0] ?? re);
  return { omega: Math.abs(rate), ratio: -Math.sign(rate), rate, turn: 0, x: real, twist: real.map(() => 0) };
}

// A shape and its imaginary part, turned until the first of its largest angles is 1; a translation moves by 1 m.
export function aligned(shape, twist = null, lead = 1, sizes = null) {
  const at = (i) => (sizes ? sizes[i] : i < lead ? 0 : 1);
  const size = shape.map((value, i) => at(i) * Math.hypot(value, twist?.[i] ?? 0));
  const largest = Math.max(...size);
  const first = largest ? size.findIndex((value) => value >= (1 - 1e-9) * largest) : 0;
  const scale = largest ? at(first) : 1;
  const [p, q] = [shape[first] * scale, (twist?.[first] ?? 0) * scale];
  const square = p * p + q * q;
  if (!twist) return [shape.map((value) => value / p), null];
  return [shape.map((value, i) => (value * p + twist[i] * q) / square), shape.map((value, i) => (twist[i] * p - value * q) / square)];
}

export const decayOf = ({ ratio }) => ratio < UNSTABLE ? "unstable" : ratio >= 1 ? "overdamped" : "";

// Real parts where the largest of complex numbers is real.
export function inPhase(x, y) {
  const sizes = x.map((value, i) => Math.hypot(value, y?.[i] ?? 0));
  const at = sizes.indexOf(Math.max(...sizes));
  if (!y || !sizes[at]) return x.map((value) => value * (y ? 1 : Math.sign(x[at]) || 1));
  return x.map((value, i) => (value * x[at] + y[i] * y[at]) / sizes[at]);
}
