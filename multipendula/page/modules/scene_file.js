// A scene and a state as the text of a scene file, and as a link that holds them.

import { MOST_LINKS } from "./system.js";

// The scene file; `y` (with `system`) gives the start, the scene's own is left out then.
export function sceneFile(scene, system = null, y = null) {
  const moved = y && (y[0] || y[system.size]);
  const lines = moved ? [`# A scene file holds no start of the cart: it was at ${y[0]} m with ${y[system.size]} m/s.`] : [];
  if (scene.title) lines.push(`title = ${quoted(scene.title)}`);
  lines.push(`gravity = ${real(scene.gravity)}`, "", "[support]", ...entries(scene.support));
  for (const pendulum of y ? separated(scene, system, y) : scene.pendulum) lines.push("", "[[pendulum]]", ...pendulumLines(pendulum));
  return `${lines.join("\n")}\n`;
}

function pendulumLines({ count = 1, equilibrium, links, start }) {
  const lines = count > 1 ? [`count = ${count}`] : [];
  if (equilibrium) lines.push(`equilibrium = [${equilibrium.map(quoted).join(", ")}]`);
  lines.push("links = [", ...repeated(links).map((link) => `  ${inline(link)},`), "]");
  if (start) lines.push(`start = ${inline(start)}`);
  return lines;
}

// Equal links in a row as one with a count.
function repeated(links) {
  const found = [];
  for (const link of links) {
    const last = found.at(-1);
    if (last && JSON.stringify(last.link) === JSON.stringify(link)) last.count++;
    else found.push({ link, count: 1 });
  }
  return found.map(({ link, count }) => (count > 1 ? { ...link, count } : link));
}

// The pendula with the state as their start: copies that move alike stay one entry.
function separated(scene, system, y) {
  const degrees = (values) => [...values].map((value) => (value * 180) / Math.PI);
  const found = [];
  for (const { entry, first, links } of system.chains) {
    const [from, to] = [1 + first, 1 + first + links.length];
    const start = { angles_deg: degrees(y.slice(from, to)), rates_deg: degrees(y.slice(system.size + from, system.size + to)) };
    if (start.rates_deg.every((rate) => !rate)) delete start.rates_deg;
    const last = found.at(-1);
    if (last?.entry === entry && JSON.stringify(last.pendulum.start) === JSON.stringify(start)) last.pendulum.count++;
    else found.push({ entry, pendulum: { ...scene.pendulum[entry], count: 1, start } });
  }
  return found.map(({ pendulum }) => pendulum);
}

function entries(part) {
  return Object.entries(part).map(([key, value]) => `${key} = ${written(value, key)}`);
}

function inline(part) {
  return `{ ${entries(part).join(", ")} }`;
}

function written(value, key) {
  if (typeof value === "string") return quoted(value);
  if (Array.isArray(value)) return `[${value.map((item) => written(item)).join(", ")}]`;
  if (typeof value === "object") return inline(value);
  return key === "count" ? String(value) : real(value);
}

function real(value) {
  const text = Object.is(value, -0) ? "0" : String(value);
  return /[.e]/.test(text) ? text : `${text}.0`;
}

function quoted(text) {
  return JSON.stringify(text).replaceAll("\u007f", "\\u007f");
}

// ------------------------------------------------------------------------------------------------ links

export function packed(state) {
  const bytes = new TextEncoder().encode(JSON.stringify(state));
  return btoa(String.fromCharCode(...bytes)).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
}

// The state in a link, checked: anyone may have written it.  null where it is none.
export function unpacked(text) {
  try {
    const bytes = Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (letter) => letter.charCodeAt(0));
    const state = JSON.parse(new TextDecoder().decode(bytes));
    return isState(state) ? state : null;
  } catch {
    return null;
  }
}

const isReal = (value) => typeof value === "number" && Number.isFinite(value);
const isPositive = (value) => isReal(value) && value > 0;
const isAmount = (value) => value === undefined || (isReal(value) && value >= 0);
const isList = (value, n, test) => Array.isArray(value) && value.length === n && value.every(test);

function isState({ scene, y, drive, selected }) {
  if (!isScene(scene)) return false;
  const links = scene.pendulum.reduce((total, pendulum) => total + (pendulum.count ?? 1) * pendulum.links.length, 0);
  const aside = drive === undefined || (isAmount(drive.amount) && isPositive(drive.frequency));
  const chosen = selected === undefined || (Number.isInteger(selected) && selected >= 0 && selected < links);
  return links <= MOST_LINKS && aside && chosen && (y === undefined || isList(y, 2 * (links + 1), isReal));
}

export function isScene(scene) {
  const { title = "", gravity, support, pendulum } = scene;
  if (typeof title !== "string" || title.length > 200 || !isPositive(gravity) || !Array.isArray(pendulum)) return false;
  const held = support.kind === "fixed" || (support.kind === "cart" && isPositive(support.mass)) || (support.kind === "moved" && isSine(support.motion));
  if (!held || !isAmount(support.damping) || !isAmount(support.stiffness)) return false;
  return pendulum.length > 0 && pendulum.length <= MOST_LINKS && pendulum.every(isPendulum);
}

function isSine({ kind, amplitude, frequency_hz, phase_deg = 0, direction = "horizontal" }) {
  return kind === "sine" && isReal(amplitude) && amplitude >= 0 && isPositive(frequency_hz) && isReal(phase_deg) && ["horizontal", "vertical"].includes(direction);
}

function isPendulum({ count = 1, links, equilibrium, start }) {
  if (!Number.isInteger(count) || count < 1 || count > MOST_LINKS) return false;
  if (!Array.isArray(links) || !links.length || links.length > MOST_LINKS || !links.every(isLink)) return false;
  const n = links.length;
  const ways = equilibrium === undefined || isList(equilibrium, n, (way) => way === "up" || way === "down");
  const begun = start === undefined || (isList(start.angles_deg, n, isReal) && (start.rates_deg === undefined || isList(start.rates_deg, n, isReal)));
  return ways && begun && !(links.at(-1).kind === "body" && links.at(-1).centre === 0);
}

function isLink({ kind, mass, length, centre, inertia, damping, stiffness, drag, quadratic_drag, drive }) {
  const body = kind === "bob" || kind === "rod" || (kind === "body" && isReal(centre) && centre >= 0 && isReal(inertia) && inertia >= 0 && centre + inertia > 0);
  const driven = drive === undefined || (drive.kind === "van-der-pol" && isPositive(drive.strength) && isPositive(drive.angle_deg)) || (drive.kind === "escapement" && isPositive(drive.impulse) && isAmount(drive.angle_deg));
  return body && isPositive(mass) && isPositive(length) && [damping, stiffness, drag, quadratic_drag].every(isAmount) && driven;
}
