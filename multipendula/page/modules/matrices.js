// M, K and D of the linearized scene in the coordinates (x, deviations of the angles).

import { pairedIn } from "./carriers.js";
import { full } from "./steps.js";

export function dot(x, y) {
  let total = 0;
  for (let i = 0; i < x.length; i++) total += x[i] * y[i];
  return total;
}

export const zeros = (n, columns = n) => Array.from({ length: n }, () => new Float64Array(columns));

// The bilinear forms x'Mz, x'Kz and x'Dz of chains that each stand for `weights` equal copies (null: one).  With x = z
// they are sums of squares, without the cancellation that a product with the matrix has.
export function formsOf(chains, cart, weights, x, z) {
  const forms = cart ? [cart.mass, cart.stiffness, cart.damping].map((value) => value * x[0] * z[0]) : [0, 0, 0];
  let at = 1;
  chains.forEach(({ links }, number) => {
    const pair = Float64Array.of(x[0], z[0], 0, 0, 0);
    links.forEach(({ constants }, i) => {
      full.link.paired(constants, [x[at], z[at], i ? x[at - 1] : 0, i ? z[at - 1] : 0], pair, null, pair);
      at++;
    });
    for (let k = 0; k < 3; k++) forms[k] += (weights?.[number] ?? 1) * pair[2 + k];
  });
  return forms;
}

// The same of a whole system.
export function formsIn(system, x, z = x) {
  return system.structure ? pairedIn(system, x, z) : formsOf(system.chains, system.cart, null, x, z);
}

// Items in groups, each in the last one whose first item is the same.
export function gathered(items, isSame) {
  const groups = [];
  for (const item of items) {
    const group = groups.findLast(([first]) => isSame(item, first));
    if (group) group.push(item);
    else groups.push([item]);
  }
  return groups;
}

export const inertiaOf = (chains, cart, weights, x, z = x) => formsOf(chains, cart, weights, x, z)[0];

export function matricesOf(chains, cart, weights) {
  const n = 1 + chains.reduce((total, chain) => total + chain.links.length, 0);
  return matricesBy(n, (x, z) => formsOf(chains, cart, weights, x, z));
}

// Those of n coordinates from their bilinear forms.
export function matricesBy(n, forms) {
  const [M, K, D] = [zeros(n), zeros(n), zeros(n)];
  const units = zeros(n);
  units.forEach((unit, i) => (unit[i] = 1));
  for (let i = 0; i < n; i++) {
    for (let j = 0; j <= i; j++) {
      const values = forms(units[i], units[j]);
      [M, K, D].forEach((matrix, k) => (matrix[i][j] = matrix[j][i] = values[k]));
    }
  }
  return { M, K, D };
}

// The lower triangle L of M = L L'; an error where M is not positive definite.
export function cholesky(M) {
  const n = M.length;
  const L = zeros(n);
  for (let i = 0; i < n; i++) {
    for (let j = 0; j <= i; j++) {
      let value = M[i][j];
      for (let k = 0; k < j; k++) value -= L[i][k] * L[j][k];
      if (i === j && !(value > 0)) throw new Error("the mass matrix is singular");
      L[i][j] = i === j ? Math.sqrt(value) : value / L[j][j];
    }
  }
  return L;
}

export function forward(L, right) {
  const x = Float64Array.from(right);
  for (let i = 0; i < x.length; i++) {
    for (let k = 0; k < i; k++) x[i] -= L[i][k] * x[k];
    x[i] /= L[i][i];
  }
  return x;
}

export function backward(L, right) {
  const x = Float64Array.from(right);
  for (let i = x.length - 1; i >= 0; i--) {
    for (let k = i + 1; k < x.length; k++) x[i] -= L[k][i] * x[k];
    x[i] /= L[i][i];
  }
  return x;
}

// The vectors f of M f w^2 = K f, M positive definite.
export function eigen(M, K) {
  const L = cholesky(M);
  const half = K.map((line) => forward(L, line));
  const C = zeros(M.length).map((_, i) => forward(L, half.map((line) => line[i])));
  for (let i = 0; i < C.length; i++) for (let j = 0; j < i; j++) C[i][j] = C[j][i] = (C[i][j] + C[j][i]) / 2;
  return jacobi(C).vectors.map((vector) => backward(L, vector));
}

// Eigenvalues and eigenvectors (as rows) of a symmetric matrix, which is overwritten, by cyclic Jacobi rotations
// (Golub & Van Loan, Matrix Computations, 8.5).
export function jacobi(A) {
  const n = A.length;
  const vectors = zeros(n);
  for (let i = 0; i < n; i++) vectors[i][i] = 1;
  for (let sweep = 0; sweep < 60; sweep++) {
    let turned = false;
    for (let p = 0; p < n; p++) for (let q = p + 1; q < n; q++) turned = rotate(A, vectors, p, q) || turned;
    if (!turned) break;
  }
  return { values: A.map((row, i) => row[i]), vectors };
}

function rotate(A, vectors, p, q) {
  const off = A[p][q];
  if (Math.abs(off) <= 1e-17 * Math.sqrt(Math.abs(A[p][p] * A[q][q])) || Math.abs(off) < 1e-300) return false;
  const theta = (A[q][q] - A[p][p]) / (2 * off);
  const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.hypot(theta, 1));
  const c = 1 / Math.hypot(t, 1);
  const s = t * c;
  for (let k = 0; k < A.length; k++) {
    const [one, other] = [A[k][p], A[k][q]];
    A[k][p] = c * one - s * other;
    A[k][q] = s * one + c * other;
  }
  for (const rows of [A, vectors]) {
    const [one, other] = [rows[p], rows[q]];
    for (let k = 0; k < one.length; k++) {
      const value = one[k];
      one[k] = c * value - s * other[k];
      other[k] = s * value + c * other[k];
    }
  }
  A[p][q] = A[q][p] = 0;
  return true;
}
