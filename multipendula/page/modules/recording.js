// A saved motion: states at ascending times, cubic between them as in `nonlinear.postprocessing.resampling`.

import { countUpTo } from "./numbers.js";

export class Recording {
  // `times` and `rows` are base64 of little-endian 32-bit floats; a row is (x, angles, x', rates, work).
  constructor({ times, rows, width, begin }) {
    Object.assign(this, { times: floats(times), rows: floats(rows), width, begin });
  }

  get duration() {
    return this.times.at(-1) - this.times[0];
  }

  // The index of the last sample at or before a time since the beginning (s).
  indexAt(time) {
    return Math.max(0, countUpTo(this.times, time + this.times[0]) - 1);
  }

  at(time) {
    const { times, rows, width } = this;
    const i = this.indexAt(time);
    const n = (width - 1) / 2;
    const [one, other] = [rows.subarray(i * width, (i + 1) * width), rows.subarray((i + 1) * width, (i + 2) * width)];
    const y = Float64Array.from(one);
    if (!other.length) return y;
    const h = times[i + 1] - times[i];
    const s = Math.min(1, Math.max(0, (time + times[0] - times[i]) / h));
    for (let k = 0; k < n; k++) {
      const ends = (1 + 2 * s) * (1 - s) ** 2 * one[k] + s * s * (3 - 2 * s) * other[k];
      y[k] = ends + h * s * (1 - s) * ((1 - s) * one[n + k] - s * other[n + k]);
    }
    for (let k = n; k < width; k++) y[k] = (1 - s) * one[k] + s * other[k];
    return y;
  }
}

function floats(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return Float32Array.from({ length: bytes.length / 4 }, (_, i) => new DataView(bytes.buffer).getFloat32(4 * i, true));
}
