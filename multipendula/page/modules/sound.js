// A tone for each mode: the frequencies of the table, all raised alike, so that the lowest is heard.

import { mannerOf } from "./shapes.js";

const [LOWEST, HIGHEST, MOST_TONES] = [196, 5000, 16]; // Hz, Hz

export class Sound {
  start(rows) {
    this.stop();
    this.context ??= new AudioContext();
    this.context.resume();
    const swinging = rows.map((row, number) => ({ row, number })).filter(({ row }) => mannerOf(row) === "swings");
    const raised = LOWEST / (swinging[0]?.row.omega ?? 1);
    this.tones = swinging.slice(0, MOST_TONES).map(({ row, number }) => this.tone(Math.min(HIGHEST, row.omega * raised), number));
  }

  tone(frequency, number) {
    const oscillator = new OscillatorNode(this.context, { frequency });
    const gain = new GainNode(this.context, { gain: 0 });
    oscillator.connect(gain).connect(this.context.destination);
    oscillator.start();
    return { oscillator, gain, number };
  }

  // Loudness by the modes' amplitudes (rad).
  play(amplitudes) {
    const whole = Math.max(0.2, Math.hypot(...amplitudes));
    for (const { gain, number } of this.tones ?? []) {
      gain.gain.setTargetAtTime((0.25 * amplitudes[number]) / whole, this.context.currentTime, 0.05);
    }
  }

  stop() {
    for (const { oscillator } of this.tones ?? []) oscillator.stop();
    this.tones = [];
  }
}
