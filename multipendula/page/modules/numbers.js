// Numbers for the eye.

export function digits(value, count = 4) {
  if (value === Infinity) return "∞";
  if (!Number.isFinite(value)) return "–";
  if (!value) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) return scientific(value, Math.min(count, 3));
  return String(Number(value.toPrecision(count)));
}

export function scientific(value, count = 2) {
  const [front, power] = value.toExponential(count - 1).split("e");
  const raised = [...String(Number(power))].map((letter) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(letter)]);
  return `${front}·10${raised.join("")}`;
}

export const degrees = (value) => (value * 180) / Math.PI;

// How many of ascending values are at most `limit`.
export function countUpTo(values, limit) {
  let [low, high] = [0, values.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= limit) low = middle + 1;
    else high = middle;
  }
  return low;
}

export const clamp = (value, low, high) => Math.min(high, Math.max(low, value));
