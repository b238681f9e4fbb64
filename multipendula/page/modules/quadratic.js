// Modes with dampers: (λ² + λ Z + κ) a = 0 in the undamped modes' own coordinates, κ diagonal and Z symmetric.
//
// First all eigenvalues of the first-order system of (√|κ| a, a'), by Hessenberg form and shifted QR (EISPACK hqr; Golub &
// Van Loan, Matrix Computations, 7.5), then each vector by inverse iteration, from which λ follows anew: a symmetric
// problem has a' as its left vector, so that the root of a'(λ² + λ Z + κ)a is wrong by the square of the vector's error.

import { dot, gathered, zeros } from "./matrices.js";

const EPS = 2 ** -52;
const [TOGETHER, MOST_ROUNDS, NULL] = [1e-9, 3, 1e-7];

// Eigenvalues { re, im }, im >= 0, with their vectors as columns of the undamped modes, { a: re, b: im }: one entry for
// each distinct one with `vectors`.  Those that are 0 are omitted: every κ = 0 has one.
export function dampedOf(kappa, Z) {
  const values = eigenvaluesOf(firstOrder(kappa, Z)).filter(({ im }) => im >= 0);
  const sorted = values.toSorted((one, other) => Math.hypot(one.re, one.im) - Math.hypot(other.re, other.im));
  const isNear = (value, first) => Math.hypot(value.re - first.re, value.im - first.im) <= TOGETHER * Math.hypot(first.re, first.im);
  return gathered(sorted, isNear).flatMap((group) => solved(kappa, Z, group));
}

function firstOrder(kappa, Z) {
  const n = kappa.length;
  const places = kappa.flatMap((value, i) => (value ? [i] : []));
  const size = n + places.length;
  const A = zeros(size);
  places.forEach((i, at) => {
    const scale = Math.sqrt(Math.abs(kappa[i]));
    A[at][places.length + i] = scale;
    A[places.length + i][at] = -Math.sign(kappa[i]) * scale;
  });
  for (let i = 0; i < n; i++) for (let j = 0; j < n; j++) A[places.length + i][places.length + j] = -Z[i][j];
  return A;
}

// One entry for a group whose vectors are independent; one each where they are not, as at critical damping.
function solved(kappa, Z, group) {
  const count = group.length;
  if (count === 1) return [refined(kappa, Z, group[0])];
  const [{ re, im }] = group;
  const vectors = nullVectors(kappa, Z, re, im, count);
  if (!vectors) return group.map((value) => refined(kappa, Z, value));
  return [{ ...rootOf(kappa, Z, re, im, vectors[0]), vectors }];
}

function refined(kappa, Z, { re, im }) {
  let value = { re, im };
  let vector = null;
  for (let round = 0; round < MOST_ROUNDS; round++) {
    [vector] = nullVectors(kappa, Z, value.re, value.im, 1, vector && [vector]) ?? [vector ?? started(kappa.length, 0)];
    const next = rootOf(kappa, Z, value.re, value.im, vector);
    const change = Math.hypot(next.re - value.re, next.im - value.im);
    if (!(change <= 1e-3 * Math.hypot(re, im))) break;
    value = next;
    if (change <= 8 * EPS * Math.hypot(re, im)) break;
  }
  return { ...value, vectors: [vector] };
}

// The root next to λ of a'(λ² + λ Z + κ)a = 0; for a real λ with real numbers.
function rootOf(kappa, Z, re, im, { a, b }) {
  const [m, d, k] = [null, Z, kappa].map((S) => {
    const applied = (x) => (S === null ? x : S === kappa ? x.map((value, i) => value * kappa[i]) : S.map((row) => dot(row, x)));
    const [sa, sb] = [applied(a), applied(b)];
    return { re: dot(a, sa) - dot(b, sb), im: dot(a, sb) + dot(b, sa) };
  });
  const root = squareRoot(minus(times(d, d), times({ re: 4, im: 0 }, times(m, k))));
  const aligned = root.re * d.re + root.im * d.im >= 0 ? root : { re: -root.re, im: -root.im };
  const large = times({ re: -0.5, im: 0 }, { re: d.re + aligned.re, im: d.im + aligned.im });
  const roots = [over(large, m), over(k, large)].filter(({ re: x, im: y }) => Number.isFinite(x) && Number.isFinite(y));
  const far = (own) => Math.hypot(own.re - re, own.im - im);
  const nearest = roots.length > 1 && far(roots[1]) < far(roots[0]) ? roots[1] : (roots[0] ?? { re, im });
  return im ? nearest : { re: nearest.re, im: 0 };
}

// `count` independent vectors that λ² + λ Z + κ takes to nothing, null where there are not so many.
function nullVectors(kappa, Z, re, im, count, given = null) {
  const n = kappa.length;
  const G = Z.map((row, i) => {
    const [x, y] = [Float64Array.from(row, (value) => re * value), Float64Array.from(row, (value) => im * value)];
    x[i] += re * re - im * im + kappa[i];
    y[i] += 2 * re * im;
    return { x, y };
  });
  const largest = Math.max(...G.map(({ x, y }) => Math.max(...x.map((value, j) => Math.hypot(value, y[j])))));
  const solve = factored(G.map(({ x, y }) => ({ x: x.slice(), y: y.slice() })), largest);
  let vectors = given ?? Array.from({ length: count }, (_, c) => started(n, c));
  for (let round = 0; round < (given ? 1 : 2); round++) vectors = orthonormal(vectors.map(solve));
  if (vectors.some(({ a }) => !a.every(Number.isFinite))) return null;
  if (count > 1 && vectors.some((vector) => misfit(G, vector) > NULL * largest)) return null;
  return vectors;
}

const started = (n, c) => ({ a: Float64Array.from({ length: n }, (_, i) => Math.cos(1 + i * (c + 1.7))), b: Float64Array.from({ length: n }, (_, i) => Math.sin(2 + i * (c + 0.6))) });

const misfit = (G, { a, b }) => Math.hypot(...G.flatMap(({ x, y }) => [dot(x, a) - dot(y, b), dot(x, b) + dot(y, a)]));

// A function that solves G z = right, by elimination with pivots; one that is lost to rounding is taken as tiny.
function factored(G, largest) {
  const n = G.length;
  const order = [...G.keys()];
  for (let k = 0; k < n; k++) {
    let best = k;
    for (let i = k + 1; i < n; i++) if (Math.hypot(G[i].x[k], G[i].y[k]) > Math.hypot(G[best].x[k], G[best].y[k])) best = i;
    [G[k], G[best]] = [G[best], G[k]];
    [order[k], order[best]] = [order[best], order[k]];
    const pivot = G[k];
    if (!(Math.hypot(pivot.x[k], pivot.y[k]) > EPS * EPS * largest)) [pivot.x[k], pivot.y[k]] = [EPS * (largest || 1), 0];
    const size = pivot.x[k] ** 2 + pivot.y[k] ** 2;
    for (let i = k + 1; i < n; i++) {
      const { x, y } = G[i];
      const [p, q] = [(x[k] * pivot.x[k] + y[k] * pivot.y[k]) / size, (y[k] * pivot.x[k] - x[k] * pivot.y[k]) / size];
      [x[k], y[k]] = [p, q];
      if (!p && !q) continue;
      for (let j = k + 1; j < n; j++) {
        x[j] -= p * pivot.x[j] - q * pivot.y[j];
        y[j] -= p * pivot.y[j] + q * pivot.x[j];
      }
    }
  }
  return ({ a, b }) => {
    const [u, v] = [order.map((i) => a[i]), order.map((i) => b[i])];
    const take = (i, k, p, q) => ((u[i] -= p * u[k] - q * v[k]), (v[i] -= p * v[k] + q * u[k]));
    for (let i = 0; i < n; i++) for (let k = 0; k < i; k++) take(i, k, G[i].x[k], G[i].y[k]);
    for (let i = n - 1; i >= 0; i--) {
      for (let k = i + 1; k < n; k++) take(i, k, G[i].x[k], G[i].y[k]);
      const { re, im } = over({ re: u[i], im: v[i] }, { re: G[i].x[i], im: G[i].y[i] });
      [u[i], v[i]] = [re, im];
    }
    return { a: Float64Array.from(u), b: Float64Array.from(v) };
  };
}

function orthonormal(vectors) {
  const basis = [];
  for (const vector of vectors) {
    const largest = Math.max(...vector.a.map(Math.abs), ...vector.b.map(Math.abs));
    let [a, b] = [vector.a.map((value) => value / largest), vector.b.map((value) => value / largest)];
    for (let round = 0; round < 2; round++) {
      for (const own of basis) {
        const [p, q] = [dot(own.a, a) + dot(own.b, b), dot(own.a, b) - dot(own.b, a)];
        [a, b] = [a.map((value, i) => value - p * own.a[i] + q * own.b[i]), b.map((value, i) => value - p * own.b[i] - q * own.a[i])];
      }
      const size = Math.hypot(...a, ...b);
      [a, b] = [a.map((value) => value / size), b.map((value) => value / size)];
    }
    basis.push({ a, b });
  }
  return basis;
}

const times = (z, w) => ({ re: z.re * w.re - z.im * w.im, im: z.re * w.im + z.im * w.re });
const minus = (z, w) => ({ re: z.re - w.re, im: z.im - w.im });

function over(z, w) {
  const scale = Math.max(Math.abs(w.re), Math.abs(w.im));
  const [x, y] = [w.re / scale, w.im / scale];
  const size = scale * (x * x + y * y);
  return { re: (z.re * x + z.im * y) / size, im: (z.im * x - z.re * y) / size };
}

function squareRoot({ re, im }) {
  const size = Math.hypot(re, im);
  const large = Math.sqrt((size + Math.abs(re)) / 2);
  if (!large) return { re: 0, im: 0 };
  const small = im / 2 / large;
  return re >= 0 ? { re: large, im: small } : { re: Math.abs(small), im: im >= 0 ? large : -large };
}

// ------------------------------------------------------------------------------------------ all eigenvalues

export function eigenvaluesOf(A) {
  const H = hessenberg(A.map((row) => Float64Array.from(row)));
  const norm = H.reduce((total, row) => total + row.reduce((sum, value) => sum + Math.abs(value), 0), 0);
  const eigenvalues = [];
  let [n, rounds, shift] = [H.length - 1, 0, 0];
  while (n >= 0) {
    const low = smallBelow(H, n, norm);
    if (low === n) {
      eigenvalues.push({ re: H[n][n] + shift, im: 0 });
      [n, rounds] = [n - 1, 0];
    } else if (low === n - 1) {
      eigenvalues.push(...pairOf(H, n, shift));
      [n, rounds] = [n - 2, 0];
    } else {
      if (rounds === 60) throw new Error("the eigenvalues do not converge");
      shift = swept(H, low, n, rounds++, shift);
    }
  }
  return eigenvalues;
}

function hessenberg(A) {
  const n = A.length;
  for (let k = 0; k < n - 2; k++) {
    const scale = A.slice(k + 1).reduce((total, row) => total + Math.abs(row[k]), 0);
    if (!scale) continue;
    const v = new Float64Array(n);
    for (let i = k + 1; i < n; i++) v[i] = A[i][k] / scale;
    const alpha = (v[k + 1] > 0 ? -1 : 1) * Math.sqrt(dot(v, v));
    v[k + 1] -= alpha;
    const half = dot(v, v) / 2;
    if (!half) continue;
    for (let j = k; j < n; j++) {
      let f = 0;
      for (let i = k + 1; i < n; i++) f += v[i] * A[i][j];
      for (let i = k + 1; i < n; i++) A[i][j] -= (f / half) * v[i];
    }
    for (const row of A) {
      const f = dot(v, row) / half;
      for (let j = k + 1; j < n; j++) row[j] -= f * v[j];
    }
    for (let i = k + 2; i < n; i++) A[i][k] = 0;
  }
  return A;
}

function smallBelow(H, n, norm) {
  let low = n;
  for (; low > 0; low--) {
    const size = Math.abs(H[low - 1][low - 1]) + Math.abs(H[low][low]) || norm;
    if (Math.abs(H[low][low - 1]) <= EPS * size) {
      H[low][low - 1] = 0;
      break;
    }
  }
  return low;
}

function pairOf(H, n, shift) {
  const p = (H[n - 1][n - 1] - H[n][n]) / 2;
  const w = H[n][n - 1] * H[n - 1][n];
  const q = p * p + w;
  const x = H[n][n] + shift;
  if (q < 0) return [1, -1].map((side) => ({ re: x + p, im: side * Math.sqrt(-q) }));
  const z = p + (p >= 0 ? 1 : -1) * Math.sqrt(q);
  return [x + z, z ? x - w / z : x].map((re) => ({ re, im: 0 }));
}

// One double step of QR on the rows from `low` to `n`.
function swept(H, low, n, rounds, before) {
  let shift = before;
  let [x, y, w] = [H[n][n], H[n - 1][n - 1], H[n][n - 1] * H[n - 1][n]];
  if (rounds % 10 === 9) {
    for (let i = 0; i <= n; i++) H[i][i] -= x;
    shift += x;
    const s = Math.abs(H[n][n - 1]) + Math.abs(H[n - 1][n - 2]);
    [x, y, w] = [0.75 * s, 0.75 * s, -0.4375 * s * s];
  }
  let m = n - 2;
  let [p, q, r] = [0, 0, 0];
  for (; m >= low; m--) {
    const z = H[m][m];
    [r, q] = [x - z, y - z];
    p = (r * q - w) / H[m + 1][m] + H[m][m + 1];
    q = H[m + 1][m + 1] - z - r - q;
    r = H[m + 2][m + 1];
    const s = Math.abs(p) + Math.abs(q) + Math.abs(r);
    [p, q, r] = [p / s, q / s, r / s];
    if (m === low) break;
    const left = Math.abs(H[m][m - 1]) * (Math.abs(q) + Math.abs(r));
    if (left < EPS * Math.abs(p) * (Math.abs(H[m - 1][m - 1]) + Math.abs(z) + Math.abs(H[m + 1][m + 1]))) break;
  }
  for (let i = m + 2; i <= n; i++) {
    H[i][i - 2] = 0;
    if (i > m + 2) H[i][i - 3] = 0;
  }
  for (let k = m; k < n; k++) {
    const last = k === n - 1;
    let size = 1;
    if (k !== m) {
      [p, q, r] = [H[k][k - 1], H[k + 1][k - 1], last ? 0 : H[k + 2][k - 1]];
      size = Math.abs(p) + Math.abs(q) + Math.abs(r);
      if (!size) continue;
      [p, q, r] = [p / size, q / size, r / size];
    }
    const s = (p < 0 ? -1 : 1) * Math.hypot(p, q, r);
    if (!s) continue;
    if (k !== m) H[k][k - 1] = -s * size;
    else if (low !== m) H[k][k - 1] = -H[k][k - 1];
    p += s;
    const [a, b, c] = [p / s, q / s, r / s];
    [q, r] = [q / p, r / p];
    for (let j = k; j <= n; j++) {
      const f = H[k][j] + q * H[k + 1][j] + (last ? 0 : r * H[k + 2][j]);
      H[k][j] -= f * a;
      H[k + 1][j] -= f * b;
      if (!last) H[k + 2][j] -= f * c;
    }
    for (let i = low; i <= Math.min(n, k + 3); i++) {
      const f = a * H[i][k] + b * H[i][k + 1] + (last ? 0 : c * H[i][k + 2]);
      H[i][k] -= f;
      H[i][k + 1] -= f * q;
      if (!last) H[i][k + 2] -= f * r;
    }
  }
  return shift;
}
