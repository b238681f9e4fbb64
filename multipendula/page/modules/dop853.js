// Explicit Runge-Kutta of order 8 with error estimates of order 5 and 3: DOP853 of Hairer, Norsett & Wanner, Solving
// Ordinary Differential Equations I, 2nd ed., with their coefficients and SciPy's control of the step.

import { DOP853, LIMITS } from "./tableau.js";

// The next step over this one, after one with this error over the tolerance.
export function factorOf(error) {
  const { safety, shrinks, grows, power } = LIMITS;
  if (!error) return grows;
  const factor = safety * (Number.isFinite(error) ? error : 1e9) ** power;
  return error < 1 ? Math.min(grows, factor) : Math.max(shrinks, factor);
}

// An integrator of y' = f(t, y), f(t, y, out).  The last `uncounted` numbers of y do not control the step.
export class Integrator {
  constructor(f, y, { tolerance = 1e-10, uncounted = 0, time = 0 } = {}) {
    Object.assign(this, { f, y: Float64Array.from(y), tolerance, counted: y.length - uncounted, time, calls: 0 });
    this.next = 1e-3;
    this.stages = Array.from({ length: 12 }, () => new Float64Array(y.length));
    this.trial = new Float64Array(y.length);
  }

  // One step of length h from the present state into `trial`; the size of its error over the tolerance.  `watch(s, y)`
  // is shown the state at every stage.
  attempt(h, watch = null) {
    const { stages, trial, y, time } = this;
    const { A, B, C, E3, E5 } = DOP853;
    for (let s = 0; s < 12; s++) {
      for (let i = 0; i < y.length; i++) {
        let slope = 0;
        for (let k = 0; k < s; k++) slope += A[s][k] * stages[k][i];
        trial[i] = y[i] + h * slope;
      }
      watch?.(s, trial);
      this.f(time + C[s] * h, trial, stages[s]);
    }
    this.calls += 12;
    let [third, fifth] = [0, 0];
    for (let i = 0; i < y.length; i++) {
      let [slope, e3, e5] = [0, 0, 0];
      for (let s = 0; s < 12; s++) {
        slope += B[s] * stages[s][i];
        e3 += E3[s] * stages[s][i];
        e5 += E5[s] * stages[s][i];
      }
      trial[i] = y[i] + h * slope;
      if (i < this.counted) {
        const scale = this.tolerance * (1 + Math.max(Math.abs(y[i]), Math.abs(trial[i])));
        third += (e3 / scale) ** 2;
        fifth += (e5 / scale) ** 2;
      }
    }
    if (!fifth && !third) return 0;
    return (Math.abs(h) * fifth) / Math.sqrt((fifth + 0.01 * third) * this.counted);
  }

  // One accepted step that does not pass `end`; `watch(h)` may shorten it to where something happens.
  step(end, watch) {
    for (let tries = 0; tries < 60; tries++) {
      const left = end - this.time;
      const h = Math.min(this.next, left);
      const error = this.attempt(h);
      if (error < 1) {
        const grown = h * factorOf(error);
        this.next = h < this.next ? Math.max(this.next, grown) : grown;
        const taken = watch ? watch(h) : h;
        this.y.set(this.trial);
        this.time = taken === left ? end : this.time + taken;
        return;
      }
      this.next = h * factorOf(error);
    }
    throw new Error("the step became too small");
  }

  // To the time `end`.
  advance(end, watch) {
    while (this.time < end) this.step(end, watch);
  }
}
