// What is prescribed in time: motions of a support, then forces, each a function of the time in its derivative 0, 1 or 2.
//
// Sines and sweeps have their numbers in the scene; a record and a random process come with the page (`prescribed`).

import { countUpTo } from "./numbers.js";
import { prescribed } from "./prescribed.js";
import { sine } from "./steps.js";

const TURN = 2 * Math.PI;

export const isRecorded = () => prescribed !== null;

// The times (s) at which steps end, and the longest step; none for sines.
export const breaksOf = () => prescribed?.breaks ?? [];
export const longestStep = () => prescribed?.shortest ?? Infinity;

// A function (time, order) for a motion or force of the scene, number k of all.
export function courseOf(part, k) {
  const source = prescribed?.sources[k] ?? { kind: part.kind };
  return { sine: ofSine, sweep: ofSweep, record: ofRecord, random: ofRandom, constant: ofConstant }[source.kind](part, source);
}

function ofSine({ amplitude, frequency_hz, phase_deg = 0 }) {
  const constants = sine.constants([amplitude, TURN * frequency_hz, (phase_deg * Math.PI) / 180, 1, 0]);
  const moved = new Float64Array(6);
  return (time, order) => {
    sine.moved(constants, null, [time], null, moved);
    return moved[2 * order];
  };
}

const ofConstant = ({ amplitude }) => (time, order) => (order ? 0 : amplitude);

function ofSweep({ amplitude, from_hz, to_hz, duration }) {
  const numbers = { amplitude, first: TURN * from_hz, last: TURN * to_hz, duration };
  const { turning, velocity, acceleration } = prescribed.sweep;
  return (time, order) => (order ? [velocity, acceleration][order - 1](numbers, time) : amplitude * Math.sin(turning(numbers, time)[1]));
}

// A polynomial from knot to knot.
function ofRecord(part, { orders }) {
  return (time, order) => {
    const { knots, origins, coefficients } = orders[order];
    const piece = countUpTo(knots, time);
    return coefficients[piece].reduceRight((value, coefficient) => value * (time - origins[piece]) + coefficient, 0);
  };
}

// Re sum (i omega)^order c e^(i omega t).
function ofRandom(part, { omega, real, imaginary }) {
  return (time, order) => {
    let total = 0;
    omega.forEach((rate, k) => {
      const [c, s] = [Math.cos(rate * time), Math.sin(rate * time)];
      const parts = [real[k] * c - imaginary[k] * s, -rate * (real[k] * s + imaginary[k] * c), -rate * rate * (real[k] * c - imaginary[k] * s)];
      total += parts[order];
    });
    return total;
  };
}

// A function of the time for the inputs that the equations of a scene have first: the time, or the values of all courses.
export function leadingOf(motions, forces, count) {
  if (!count) return () => [];
  if (!prescribed) return (time) => [time];
  const each = [...motions, ...(forces ?? [])].map((part, k) => courseOf(part, k));
  return (time) => prescribed.courses.map(([k, order]) => each[k](time, order));
}

// How many of these are of forces, the last ones.
export const forcesAmong = () => prescribed?.forces ?? 0;
