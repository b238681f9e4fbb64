// The range of validity of a linear frequency, as derived in `modal.eigen.amplitude` and judged in `modal.modes.mode`.
//
// A swing is a mode of the scene or of one pendulum alone: the frequency omega (rad/s), the shape x (cart in m and every
// angle, largest angle 1) of chains that each stand for `weights` equal copies on a cart or none, its inertia x'Mx (with
// dampers that of the complex shape), and gravity.

import { inertiaOf } from "./matrices.js";
import { sum } from "./system.js";

export const LIGHT = 0.1; // damping ratio, and part of a shape out of phase, up to which a frequency has a range

const INSTANTS = [1, 3, 5, 7].map((odd) => (odd * Math.PI) / 16); // their mean is exact for products of four factors
const QUARTER = Array.from({ length: 33 }, (_, i) => (i * Math.PI) / 64);
const [PROMISED, UNSEEN, LEFT_OUT] = [0.03, 0.002, 0.03];
const [WIDTH, BESIDE, SURE, NEAREST] = [0.02, 0.1, 0.05, 3];

// Frequency of amplitude a: omega (1 + kappa a^2), of a shape whose part out of phase is `aside`; NaN where that is large.
export function kappaOf(swing, aside = null) {
  if (aside && largestIn(swing, aside) >= LIGHT * largestIn(swing, swing.x)) return NaN;
  const inertia = aside ? inertiaOf(swing.chains, swing.cart, swing.weights, swing.x) : swing.inertia;
  return (-4 * meanOf(swing, swing, 1, 0)) / (inertia * swing.omega ** 2);
}

// The largest angle (degrees) at which the frequency is 1 % off; NaN where kappa is.
export const onePercentOf = (kappa) => (Math.sqrt(0.01 / Math.abs(kappa)) * 180) / Math.PI;

// The largest angle of a shape, the cart's displacement over the natural unit of length being one: a power of 2 above the
// longest link.
function largestIn({ chains }, x) {
  const unit = 2 ** (1 + Math.floor(Math.log2(Math.max(...chains.flatMap(({ links }) => links.map(({ l }) => l))))));
  return Math.max(Math.abs(x[0]) / unit, ...x.slice(1).map(Math.abs));
}

// Whether a resonance makes the angle of 1 % of a row a guide; `partners` are other rows, ascending, that may answer.
export function isGuide({ kappa, swing }, partners) {
  const near = [1, 3, 1 / 3].some((ratio) => partners.some(({ omega }) => Math.abs(omega / (ratio * swing.omega) - 1) < WIDTH));
  if (near || !kappa) return near;
  const answers = [1, 3].flatMap((harmonic) => {
    const at = partners.filter(({ omega }) => omega < harmonic * swing.omega).length;
    const closest = partners.slice(Math.max(at - NEAREST, 0), at + NEAREST).flatMap(({ parts }) => parts);
    return closest.filter((other) => other.swing.chains === swing.chains).map((other) => answerOf(swing, other.swing, harmonic, kappa));
  });
  if (!answers.length) return false;
  const doubt = sum(answers.map((one) => (one.ratio < BESIDE ? 1 : SURE) * Math.abs(distortion(swing, [one]))));
  const error = ownOf(swing, kappa) * (1 + distortion(swing, answers)) - 1;
  return !(UNSEEN - PROMISED + doubt <= error && error <= PROMISED - (LEFT_OUT * 0.01) / Math.abs(kappa) - doubt);
}

// The fourth-order Lagrangian at one instant, without the copies of the cart's own.
function fourthOrder({ chains, weights, gravity }, angle, speed) {
  let [at, potential, inertial] = [1, 0, 0];
  chains.forEach(({ links }, number) => {
    let [none, one, two] = [0, 0, 0];
    for (const { s, l, b } of links) {
      const [own, rate] = [angle[at], speed[at++]];
      potential += weights[number] * s * b * own ** 4;
      inertial += weights[number] * s * b * rate * (speed[0] * own ** 2 + two - 2 * one * own + none * own ** 2);
      none += s * l * rate;
      one += s * l * rate * own;
      two += s * l * rate * own ** 2;
    }
  });
  return (gravity * potential) / 24 - inertial / 2;
}

// Its mean over a period of one swing and `ratio` of another in a harmonic of it.
function meanOf(swing, other, harmonic, ratio) {
  const mixed = (own, theirs) => swing.x.map((value, i) => own * value + theirs * ratio * other.x[i]);
  const means = INSTANTS.map((time) => {
    const speed = mixed(-swing.omega * Math.sin(time), -swing.omega * harmonic * Math.sin(harmonic * time));
    return fourthOrder(swing, mixed(Math.cos(time), Math.cos(harmonic * time)), speed);
  });
  return sum(means) / INSTANTS.length;
}

// The response of another swing at the angle of 1 %: its size, by how much it bends the frequency, and whether the
// frequencies meet below that angle.
function answerOf(swing, other, harmonic, kappa) {
  const a2 = Math.min(0.01 / Math.abs(kappa), (Math.PI / 2) ** 2);
  const [none, near, less, twice, minus] = [0, 1, -1, 2, -2].map((ratio) => meanOf(swing, other, harmonic, ratio));
  const first = (8 * (near - less) - (twice - minus)) / 12;
  const second = (16 * (near + less) - (twice + minus) - 30 * none) / 24;
  const [driven, free] = [(harmonic * swing.omega) ** 2, other.omega ** 2];
  const drifted = other.inertia * (free - driven * (1 + 2 * kappa * a2)) - 4 * second * a2;
  const size = (2 * first * a2) / drifted;
  const ratio = Math.abs(other.omega / swing.omega / harmonic - 1);
  return { harmonic, ratio, x: other.x, size, bend: (0.75 * first * size) / none, meets: (free - driven) * drifted <= 0 };
}

// The relative error of the angle of 1 % by these responses together.
function distortion(swing, answers) {
  const bent = 1 + sum(answers.map(({ bend }) => bend));
  if (bent <= 0 || answers.some(({ meets }) => meets)) return Infinity;
  let largest = 0;
  for (const time of QUARTER) {
    const waves = answers.map(({ harmonic, size }) => size * Math.cos(harmonic * time));
    for (let i = 1; i < swing.x.length; i++) {
      const moved = sum(answers.map(({ x }, at) => waves[at] * x[i]));
      largest = Math.max(largest, Math.abs(swing.x[i] * Math.cos(time) + moved));
    }
  }
  return largest / Math.sqrt(bent) - 1;
}

// The angle of 1 % over its first guess without other modes, with the share p of the potential in the mean.
function ownOf({ chains, weights, gravity, x, inertia, omega }, kappa) {
  const b = chains.flatMap(({ links }, number) => links.map((link) => weights[number] * link.s * link.b));
  const potential = (gravity * sum(b.map((value, i) => value * x[1 + i] ** 4))) / 64;
  const p = (-4 * potential) / (inertia * omega ** 2 * kappa);
  const r = 1 + Math.sign(kappa) * 0.01;
  const square = (1 - r ** 2) / (p + (1 - p) * r ** 2) / -2 / kappa;
  return Math.sqrt((Math.max(square, 0) * Math.abs(kappa)) / 0.01);
}
