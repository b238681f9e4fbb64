// The scene and the strip below it, drawn.

import { degrees } from "./numbers.js";

export function paint(canvas, colours, draw) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const ink = canvas.getContext("2d");
  ink.setTransform(ratio, 0, 0, ratio, 0, 0);
  ink.clearRect(0, 0, width, height);
  ink.lineCap = ink.lineJoin = "round";
  draw(ink, width, height, colours);
}

export function drawScene(ink, view, { y, predicted, trails, selected, tool, colours }) {
  if (view.followed) drawMarks(ink, view, colours);
  drawSupports(ink, view, y, colours, tool);
  if (predicted) drawPredicted(ink, view, predicted, colours);
  const places = view.places(y);
  places.forEach(({ joints, centres }, number) => {
    const { first, links } = view.system.chains[number];
    const colour = hueOf(view.system, number, colours);
    drawTrail(ink, view, trails[number] ?? [], colour);
    const points = joints.map((joint) => view.pixel(joint));
    const middles = centres.map((centre) => view.pixel(centre));
    links.forEach((link, i) => drawLink(ink, view, link, points[i], points[i + 1], middles[i], colour, colours));
    links.forEach((link, i) => drawMass(ink, view, link, points[i + 1], middles[i], colour, colours));
    links.forEach((link, i) => {
      if (first + i === selected) drawHandle(ink, view, link, points[i], points[i + 1], middles[i], tool, colours);
    });
    dot(ink, points[0], 2.6, colours.ink);
  });
}

// Pendula differ in colour; those beyond the hues begin again.
export const hueOf = (system, number, colours) => colours.hues[number % colours.hues.length];

// Marks at the foot every quarter of the longest pendulum, by which a support that is followed is seen to move.
function drawMarks(ink, view, colours) {
  ink.strokeStyle = colours.line;
  ink.lineWidth = 1;
  const step = view.reach / 4;
  const [from, to] = [0, view.width].map((x) => view.metre([x, 0])[0] / step);
  for (let k = Math.ceil(from); k < to; k++) {
    const [x] = view.pixel([k * step, 0]);
    line(ink, [[x, view.height], [x, view.height - (k % 4 ? 5 : 10)]]);
  }
}

// The pieces of supports: what is still below, then bodies, what holds them, springs and dots.
const LAYERS = [["guide", "hatch", "ground"], ["body", "line"], ["spring"], ["dot"]];
const WIDTHS = { guide: 1, hatch: 1, ground: 2, body: 1.5, line: 2, spring: 1.5 };

function drawSupports(ink, view, y, colours, tool) {
  const pieces = view.pieces(y);
  for (const layer of LAYERS) {
    for (const piece of pieces) if (layer.includes(piece.role)) drawPiece(ink, view, piece, colours);
  }
  if (tool !== "mass") return;
  ink.fillStyle = colours.accent;
  for (const { role, points } of pieces) {
    if (role !== "body" || points.length > 8) continue; // no wheels
    const [x, top] = view.pixel(points[1]);
    ink.fillRect(x - 5, top - 5, 10, 10);
  }
}

function drawPiece(ink, view, { role, closed, points }, colours) {
  const seen = points.map((point) => view.pixel(point));
  if (role === "dot") return dot(ink, seen[0], 3.5, colours.paper, colours.ink);
  ink.strokeStyle = { line: colours.ink, spring: colours.muted }[role] ?? colours.line;
  ink.lineWidth = WIDTHS[role];
  ink.fillStyle = colours.cart;
  path(ink, seen);
  if (closed) ink.closePath();
  if (role === "body") ink.fill();
  ink.stroke();
}

function drawPredicted(ink, view, y, colours) {
  ink.setLineDash([5, 5]);
  ink.lineWidth = 1.5;
  ink.strokeStyle = colours.muted;
  for (const { joints } of view.places(y)) {
    line(ink, joints.map((joint) => view.pixel(joint)));
  }
  ink.setLineDash([]);
  for (const { joints } of view.places(y)) {
    for (const joint of joints.slice(1)) {
      ink.beginPath();
      ink.arc(...view.pixel(joint), 4, 0, 7);
      ink.stroke();
    }
  }
}

function drawTrail(ink, view, trail, colour) {
  ink.strokeStyle = colour;
  ink.lineWidth = 2;
  ink.lineCap = "butt";
  for (let i = 1; i < trail.length; i++) {
    ink.globalAlpha = (0.55 * i) / trail.length;
    line(ink, [view.pixel(trail[i - 1]), view.pixel(trail[i])]);
  }
  ink.globalAlpha = 1;
  ink.lineCap = "round";
}

function drawLink(ink, view, link, from, to, centre, colour, colours) {
  ink.strokeStyle = link.kind === "rod" ? colour : colours.ink;
  ink.lineWidth = link.kind === "rod" ? Math.max(4, 0.5 * view.radius(link)) : 2;
  line(ink, [from, to]);
  if (link.kind === "body") line(ink, [from, centre]);
}

function drawMass(ink, view, link, to, centre, colour, colours) {
  if (link.kind === "rod") dot(ink, to, 2.6, colours.paper, colours.ink);
  else if (link.kind === "bob") dot(ink, to, view.radius(link), colour);
  else {
    dot(ink, centre, view.radius(link), colour);
    dot(ink, to, 2.6, colours.ink);
  }
}

function drawHandle(ink, view, link, from, to, centre, tool, colours) {
  const place = tool === "mass" ? centre : to;
  const radius = Math.max(11, (link.kind === "rod" ? 6 : view.radius(link)) + 6);
  ink.strokeStyle = colours.accent;
  ink.lineWidth = 2;
  ink.setLineDash(tool === "pull" ? [] : [4, 3]);
  ink.beginPath();
  ink.arc(...place, radius, 0, 7);
  ink.stroke();
  ink.setLineDash([]);
  if (tool === "pull") return;
  const [dx, dy] = tool === "length" ? unit(from, to) : [0, 1];
  for (const side of [-1, 1]) arrow(ink, place, [side * dx, side * dy], radius + 3, colours.accent);
}

function path(ink, points) {
  ink.beginPath();
  points.forEach((point, k) => ink[k ? "lineTo" : "moveTo"](...point));
}

function line(ink, points) {
  path(ink, points);
  ink.stroke();
}

function unit([x0, y0], [x1, y1]) {
  const size = Math.hypot(x1 - x0, y1 - y0) || 1;
  return [(x1 - x0) / size, (y1 - y0) / size];
}

function arrow(ink, [x, y], [dx, dy], from, colour) {
  ink.fillStyle = colour;
  ink.beginPath();
  ink.moveTo(x + dx * (from + 7), y + dy * (from + 7));
  ink.lineTo(x + dx * from - dy * 5, y + dy * from + dx * 5);
  ink.lineTo(x + dx * from + dy * 5, y + dy * from - dx * 5);
  ink.fill();
}

function dot(ink, place, radius, fill, edge = null) {
  ink.fillStyle = fill;
  ink.beginPath();
  ink.arc(...place, radius, 0, 7);
  ink.fill();
  if (!edge) return;
  ink.strokeStyle = edge;
  ink.lineWidth = 1.2;
  ink.stroke();
}

// Angles from rest over the last `span` seconds: rows of [time, predicted, angle, ...] in radians, the first predicted.
export function drawStrip(ink, width, height, { rows, now, span, hues, colours }) {
  const largest = rows.reduce((most, [, , ...angles]) => Math.max(most, ...angles.map(Math.abs)), 0);
  const most = niceCeiling(Math.max(5, degrees(largest)));
  const size = 0.75 * parseFloat(getComputedStyle(document.documentElement).fontSize);
  const [left, top, bottom] = [3.8 * size, 0.7 * size, height - 1.7 * size];
  const at = (time, value) => [left + ((time - now + span) / span) * (width - left - 8), top + ((bottom - top) * (1 - value / most)) / 2];
  ink.font = `${size}px system-ui, sans-serif`;
  ink.fillStyle = colours.muted;
  ink.strokeStyle = colours.grid;
  ink.lineWidth = 1;
  ink.textAlign = "right";
  ink.textBaseline = "middle";
  for (const value of [-most, 0, most]) {
    const [, y] = at(now, value);
    line(ink, [[left, y], [width - 8, y]]);
    ink.fillText(`${value < 0 ? "−" : ""}${Math.abs(value)}°`, left - 6, y);
  }
  ink.textAlign = "center";
  const step = [2, 5, 10, 20, 50, 100].find((each) => span / each < 8) ?? 200;
  for (let time = Math.ceil(Math.max(0, now - span) / step) * step; time <= now; time += step) {
    const [x] = at(time, 0);
    if (x > left + 8 && x < width - 2 * size) ink.fillText(`${time} s`, x, height - 0.7 * size);
  }
  ink.save();
  ink.beginPath();
  ink.rect(left, top - 2, width - left - 8, bottom - top + 4);
  ink.clip();
  const curve = (column, dash, stroke, thick) => {
    ink.setLineDash(dash);
    ink.strokeStyle = stroke;
    ink.lineWidth = thick;
    ink.beginPath();
    rows.forEach((row, i) => ink[i && Number.isFinite(rows[i - 1][column]) ? "lineTo" : "moveTo"](...at(row[0], degrees(row[column]))));
    ink.stroke();
    ink.setLineDash([]);
  };
  for (let k = hues.length - 1; k >= 0; k--) curve(2 + k, [], hues[k], k ? 1 : 2);
  curve(1, [5, 4], colours.muted, 1.5);
  ink.restore();
}

function niceCeiling(value) {
  return [5, 10, 15, 20, 30, 45, 60, 90, 120, 180, 360].find((one) => one >= value) ?? Math.ceil(value / 360) * 360;
}
