// A scene and a state as the text of a scene file, and as a link that holds them.

import { coordinatesOf, isStructure } from "./carriers.js";
import { degrees } from "./numbers.js";

// The scene file; `y` (with `system`) gives the start, the scene's own is left out then.
export function sceneFile(scene, system = null, y = null) {
  const { pendula, remark } = hanging(scene, system, y);
  const head = Array.isArray(scene.support) ? "[[support]]" : "[support]";
  const parts = [
    ...[scene.support].flat().map((support, k) => [head, y ? begun(support, k, system, y) : support]),
    ...(scene.ground ? [["[ground]", scene.ground]] : []),
    ...["spring", "force"].flatMap((key) => (scene[key] ?? []).map((part) => [`[[${key}]]`, part])),
  ];
  const lines = [...remark, ...(scene.title ? [`title = ${quoted(scene.title)}`] : []), `gravity = ${real(scene.gravity)}`];
  for (const [name, part] of parts) lines.push("", name, ...entries(part));
  for (const pendulum of pendula) lines.push("", "[[pendulum]]", ...pendulumLines(pendulum));
  return `${lines.join("\n")}\n`;
}

// The pendula of a file.  Copies that springs or forces name stay one entry, without a start, which a remark says.
function hanging(scene, system, y) {
  const named = [...(scene.spring ?? []).flatMap(({ between }) => between), ...(scene.force ?? []).map(({ on }) => on)].join(" ");
  const apart = y ? separated(scene, system, y) : scene.pendulum;
  const together = apart.length === scene.pendulum.length || !named.includes("pendulum[");
  const remark = together ? [] : ["# Springs or forces name pendula whose copies are apart: the file has no start of these."];
  return { pendula: together ? apart : scene.pendulum, remark };
}

// A support with its part of a state as its start.
function begun(support, number, { size, cart }, y) {
  const coordinates = isStructure() ? coordinatesOf() : cart ? [{ carrier: 0, kind: "cart" }] : [];
  const own = coordinates.flatMap(({ carrier, kind }, i) => (carrier === number ? [{ kind, place: y[i], rate: y[size + i] }] : []));
  if (own.every(({ place, rate }) => !place && !rate)) return { ...support, start: undefined };
  const [first, second, third] = own;
  const starts = {
    tilt: () => ({ angle_deg: degrees(first.place), rate_deg: degrees(first.rate) }),
    platform: () => ({
      ...{ sway: first.place, heave: second.place, roll_deg: degrees(third.place) },
      ...{ sway_rate: first.rate, heave_rate: second.rate, roll_rate_deg: degrees(third.rate) },
    }),
    modal: () => ({ displacements: own.map(({ place }) => place), rates: own.map(({ rate }) => rate) }),
  };
  const start = starts[first.kind]?.() ?? { displacement: first.place, rate: first.rate };
  return { ...support, start };
}

function pendulumLines({ count = 1, equilibrium, links, start, on, position }) {
  const lines = count > 1 ? [`count = ${count}`] : [];
  if (on !== undefined) lines.push(`on = ${quoted(on)}`);
  if (position) lines.push(`position = ${written(position)}`);
  if (equilibrium) lines.push(`equilibrium = [${equilibrium.map(quoted).join(", ")}]`);
  lines.push("links = [", ...repeated(links).map((link) => `  ${inline(link)},`), "]");
  if (start) lines.push(`start = ${inline(start)}`);
  return lines;
}

// Equal links in a row as one with a count.
function repeated(links) {
  const runs = [];
  for (const link of links) {
    const last = runs.at(-1);
    if (last && JSON.stringify(last.link) === JSON.stringify(link)) last.count++;
    else runs.push({ link, count: 1 });
  }
  return runs.map(({ link, count }) => (count > 1 ? { ...link, count } : link));
}

// The pendula with the state as their start: copies that move alike stay one entry.
function separated(scene, system, y) {
  const pendula = [];
  for (const { entry, first, links } of system.chains) {
    const [from, to] = [system.lead + first, system.lead + first + links.length];
    const start = { angles_deg: [...y.slice(from, to)].map(degrees), rates_deg: [...y.slice(system.size + from, system.size + to)].map(degrees) };
    if (start.rates_deg.every((rate) => !rate)) delete start.rates_deg;
    const last = pendula.at(-1);
    if (last?.entry === entry && JSON.stringify(last.pendulum.start) === JSON.stringify(start)) last.pendulum.count++;
    else pendula.push({ entry, pendulum: { ...scene.pendulum[entry], count: 1, start } });
  }
  return pendula.map(({ pendulum }) => pendulum);
}

function entries(part) {
  const there = Object.entries(part).filter(([, value]) => value !== undefined);
  return there.map(([key, value]) => `${key} = ${written(value, key)}`);
}

const inline = (part) => `{ ${entries(part).join(", ")} }`;

function written(value, key) {
  if (typeof value === "string") return quoted(value);
  if (Array.isArray(value)) return `[${value.map((item) => written(item)).join(", ")}]`;
  if (typeof value === "boolean") return String(value);
  if (typeof value === "object") return inline(value);
  return key === "count" || key === "seed" ? String(value) : real(value);
}

function real(value) {
  const text = Object.is(value, -0) ? "0" : String(value);
  return /[.e]/.test(text) ? text : `${text}.0`;
}

const quoted = (text) => JSON.stringify(text).replaceAll("\u007f", "\\u007f");

// ------------------------------------------------------------------------------------------------ links

export function packed(state) {
  const bytes = new TextEncoder().encode(JSON.stringify(state));
  return btoa(String.fromCharCode(...bytes)).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
}

// The state in a link, checked: anyone may have written it.  null where its scene differs from the page's `own` in more
// than numbers.
export function unpacked(text, own) {
  try {
    const bytes = Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (letter) => letter.charCodeAt(0));
    const state = JSON.parse(new TextDecoder().decode(bytes));
    return isState(state, own) ? state : null;
  } catch {
    return null;
  }
}

const isReal = (value) => typeof value === "number" && Number.isFinite(value);
const isPositive = (value) => isReal(value) && value > 0;
const isAmount = (value) => value === undefined || (isReal(value) && value >= 0);
const isList = (value, n, test) => Array.isArray(value) && value.length === n && value.every(test);

function isState({ scene, y, drive, selected }, own) {
  if (!isLike(scene, own)) return false;
  const links = scene.pendulum.reduce((total, pendulum) => total + (pendulum.count ?? 1) * pendulum.links.length, 0);
  const aside = drive === undefined || (isAmount(drive.amount) && isPositive(drive.frequency));
  const chosen = selected === undefined || (Number.isInteger(selected) && selected >= 0 && selected < links);
  return aside && chosen && (y === undefined || isList(y, 2 * (links + (isStructure() ? coordinatesOf().length : 1)), isReal));
}

// Numbers that a link may have without the page's own scene.
const mayAppear = (key) => key === "damping" || (!isStructure() && (key === "drag" || key === "quadratic_drag"));

// The same but for numbers, which keep their signs, and which are 0 where the own one is, unless they may appear.
function isLike(value, own, key = "") {
  if (typeof own === "number") return isReal(value) && (Math.sign(value) === Math.sign(own) || (mayAppear(key) && value >= 0));
  if (own === null || typeof own !== "object") return value === own;
  if (typeof value !== "object" || value === null || Array.isArray(value) !== Array.isArray(own)) return false;
  const keys = new Set([...Object.keys(own), ...Object.keys(value)]);
  return [...keys].every((one) => {
    if (mayAppear(one) && own[one] === undefined) return isAmount(value[one]);
    if (mayAppear(one) && value[one] === undefined) return typeof own[one] === "number";
    return isLike(value[one], own[one], mayAppear(key) ? key : one);
  });
}
