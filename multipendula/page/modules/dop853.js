// Explicit Runge-Kutta of order 8 with error estimates of order 5 and 3: DOP853 of Hairer, Norsett & Wanner, Solving
// Ordinary Differential Equations I, 2nd ed., with their coefficients and SciPy's control of the step.

export const DOP853 = {
  A: [
    [],
    [0.05260015195876773],
    [0.0197250569845379, 0.0591751709536137],
    [0.02958758547680685, 0, 0.08876275643042054],
    [0.2413651341592667, 0, -0.8845494793282861, 0.924834003261792],
    [0.037037037037037035, 0, 0, 0.17082860872947386, 0.12546768756682242],
    [0.037109375, 0, 0, 0.17025221101954405, 0.06021653898045596, -0.017578125],
    [0.03709200011850479, 0, 0, 0.17038392571223998, 0.10726203044637328, -0.015319437748624402, 0.008273789163814023],
    [0.6241109587160757, 0, 0, -3.3608926294469414, -0.868219346841726, 27.59209969944671, 20.154067550477894, -43.48988418106996],
    [0.47766253643826434, 0, 0, -2.4881146199716677, -0.590290826836843, 21.230051448181193, 15.279233632882423, -33.28821096898486, -0.020331201708508627],
    [-0.9371424300859873, 0, 0, 5.186372428844064, 1.0914373489967295, -8.149787010746927, -18.52006565999696, 22.739487099350505, 2.4936055526796523, -3.0467644718982196],
    [2.273310147516538, 0, 0, -10.53449546673725, -2.0008720582248625, -17.9589318631188, 27.94888452941996, -2.8589982771350235, -8.87285693353063, 12.360567175794303, 0.6433927460157636],
  ],
  B: [0.054293734116568765, 0, 0, 0, 0, 4.450312892752409, 1.8915178993145003, -5.801203960010585, 0.3111643669578199, -0.1521609496625161, 0.20136540080403034, 0.04471061572777259],
  C: [0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726, 0.3333333333333333, 0.25, 0.3076923076923077, 0.6512820512820513, 0.6, 0.8571428571428571, 1.0],
  E3: [-0.18980075407240762, 0, 0, 0, 0, 4.450312892752409, 1.8915178993145003, -5.801203960010585, -0.4226823213237919, -0.1521609496625161, 0.20136540080403034, 0.02265179219836082],
  E5: [0.01312004499419488, 0, 0, 0, 0, -1.2251564463762044, -0.4957589496572502, 1.6643771824549864, -0.35032884874997366, 0.3341791187130175, 0.08192320648511571, -0.022355307863886294],
};

// An integrator of y' = f(t, y), f(t, y, out).  The last `uncounted` numbers of y do not control the step.
export class Integrator {
  constructor(f, y, { tolerance = 1e-10, uncounted = 0, time = 0 } = {}) {
    Object.assign(this, { f, y: Float64Array.from(y), tolerance, counted: y.length - uncounted, time, calls: 0 });
    this.next = 1e-3;
    this.stages = Array.from({ length: 12 }, () => new Float64Array(y.length));
    this.trial = new Float64Array(y.length);
  }

  // One step of length h from the present state into `trial`; the size of its error over the tolerance.
  attempt(h) {
    const { stages, trial, y, time } = this;
    const { A, B, C, E3, E5 } = DOP853;
    for (let s = 0; s < 12; s++) {
      for (let i = 0; i < y.length; i++) {
        let slope = 0;
        for (let k = 0; k < s; k++) slope += A[s][k] * stages[k][i];
        trial[i] = y[i] + h * slope;
      }
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
        const grown = h * (error ? Math.min(10, 0.9 * error ** (-1 / 8)) : 10);
        this.next = h < this.next ? Math.max(this.next, grown) : grown;
        const taken = watch ? watch(h) : h;
        this.y.set(this.trial);
        this.time = taken === left ? end : this.time + taken;
        return;
      }
      this.next = h * Math.max(0.2, 0.9 * (Number.isFinite(error) ? error : 1e9) ** (-1 / 8));
    }
    throw new Error("the step became too small");
  }

  // To the time `end`.
  advance(end, watch) {
    while (this.time < end) this.step(end, watch);
  }
}
