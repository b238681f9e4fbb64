// M, K and D of the linearized scene in the coordinates (x, deviations of the angles), as in `modal.assembly.dense`.
//
// `weights` are how many equal copies each chain stands for.  Both quadratic forms are also sums of squares, without
// the cancellation that a product with the matrix has.

export function zeros(n, columns = n) {
  return Array.from({ length: n }, () => new Float64Array(columns));
}

export function matricesOf(chains, cart, gravity, weights) {
  const n = 1 + chains.reduce((total, chain) => total + chain.links.length, 0);
  const [M, K, D] = [zeros(n), zeros(n), zeros(n)];
  if (cart) [M[0][0], K[0][0], D[0][0]] = [cart.mass, cart.stiffness, cart.damping];
  let at = 1;
  chains.forEach(({ links }, number) => {
    const weight = weights[number];
    links.forEach((link, i) => {
      const own = at + i;
      M[0][0] += weight * link.m;
      M[own][own] += weight * (link.J + link.l ** 2 * link.below);
      K[own][own] += weight * gravity * link.s * link.b;
      M[0][own] = M[own][0] = weight * link.s * link.b;
      for (let j = 0; j < i; j++) M[own][at + j] = M[at + j][own] = weight * links[j].s * links[j].l * link.s * link.b;
      couple(K, own, i, weight * link.stiffness);
      couple(D, own, i, weight * link.damping);
    });
    at += links.length;
  });
  return { M, K, D };
}

function couple(matrix, own, i, value) {
  matrix[own][own] += value;
  if (!i) return;
  matrix[own - 1][own - 1] += value;
  matrix[own][own - 1] -= value;
  matrix[own - 1][own] -= value;
}

// x'Mx as a sum of squares of the velocities.
export function inertiaForm(chains, cart, weights, x) {
  let [total, at] = [cart ? cart.mass * x[0] ** 2 : 0, 1];
  chains.forEach(({ links }, number) => {
    let speed = x[0];
    for (const link of links) {
      const turn = link.s * x[at++];
      total += weights[number] * (link.m * (speed + link.c * turn) ** 2 + link.I * turn ** 2);
      speed += link.l * turn;
    }
  });
  return total;
}

// x'Kx.
export function stiffnessForm(chains, cart, gravity, weights, x) {
  let [total, at] = [cart ? cart.stiffness * x[0] ** 2 : 0, 1];
  chains.forEach(({ links }, number) => {
    let above = 0;
    for (const link of links) {
      const own = x[at++];
      total += weights[number] * (gravity * link.s * link.b * own ** 2 + link.stiffness * (own - above) ** 2);
      above = own;
    }
  });
  return total;
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
