// Where everything is seen: pivots apart on the support, metres as pixels, and what is under a finger.

import { coordinatesOf, piecesAt, pivotsAt } from "./carriers.js";
import { clamp } from "./numbers.js";
import { atRest } from "./system.js";

const ON = 12; // pixels
const BESIDE = 0.1; // of a link, and of the sine between two, up to which they look like one
const SLACK = 0.5; // of the longest pendulum, by which supports may leave the middle
const [STEP, WEAK] = [1e-5, 1e-9]; // of a difference, over the longest pendulum; added to squares that may be 0

export class View {
  constructor(system) {
    this.system = system;
    this.reach = system.reach;
    this.shift = [0, 0]; // of a moved support, along the rail and down
    this.forget();
  }

  // Back to the usual frame: all that is drawn at rest.
  forget() {
    this.followed = 0;
    const rest = atRest(this.system);
    const places = this.places(rest, [0, 0]);
    this.middle = middleOf(places);
    const points = [...places.flatMap(({ joints, centres }) => [...joints, ...centres]), ...this.pieces(rest, [0, 0]).flatMap((piece) => piece.points)];
    const [along, down] = [0, 1].map((k) => points.map((point) => point[k]));
    this.camera = (Math.min(...along) + Math.max(...along)) / 2;
    const room = 0.2 * this.reach;
    const side = Math.max(...along) - this.camera + 2 * room;
    this.extent = { up: room - Math.min(...down), down: Math.max(...down) + room, side };
  }

  fit(width, height) {
    [this.width, this.height] = [width, height];
    const { up, down, side } = this.extent;
    this.scale = Math.min(width / (2 * side), height / (up + down));
    this.top = (height - this.scale * (up + down)) / 2 + this.scale * up;
  }

  // The frame grows with what moves, and follows supports that leave it.
  follow(places) {
    const { extent, reach } = this;
    const ahead = middleOf(places) - this.middle - this.followed;
    const beyond = Math.sign(ahead) * Math.max(0, Math.abs(ahead) - SLACK * reach);
    this.camera += beyond;
    this.followed += beyond;
    for (const { joints } of places) {
      for (const [along, down] of joints) {
        extent.up = Math.max(extent.up, 0.12 * reach - down);
        extent.down = Math.max(extent.down, down + 0.12 * reach);
        extent.side = Math.max(extent.side, Math.abs(along - this.camera) + 0.12 * reach);
      }
    }
  }

  // Joints (from the pivot down) and centres of every chain in metres, along the rail and down.
  places(y, shift = this.shift) {
    const { system } = this;
    const pivots = pivotsAt(y);
    return system.chains.map(({ first, links }, number) => {
      let at = [pivots[number][0] + shift[0], pivots[number][1] + shift[1]];
      const [joints, centres] = [[at], []];
      links.forEach((link, i) => {
        const [s, c] = [Math.sin(y[system.lead + first + i]), Math.cos(y[system.lead + first + i])];
        centres.push([at[0] + link.c * s, at[1] + link.c * c]);
        at = [at[0] + link.l * s, at[1] + link.l * c];
        joints.push(at);
      });
      return { joints, centres };
    });
  }

  // Whether links of two pendula lie on each other.
  overlaps(y) {
    const rods = this.places(y).flatMap(({ joints }, chain) => joints.slice(1).map(([x, z], i) => ({ chain, from: joints[i], step: [x - joints[i][0], z - joints[i][1]] })));
    const lies = ({ from: [x, z], step: [p, q] }, { from: [u, v], step: [r, s] }) => {
      const [along, aside] = [[r, s], [s, -r]].map(([a, b]) => ((x + p / 2 - u) * a + (z + q / 2 - v) * b) / (r * r + s * s));
      const sine = (p * s - q * r) / Math.hypot(p, q) / Math.hypot(r, s);
      return along > 0 && along < 1 && Math.abs(aside) < BESIDE && Math.abs(sine) < BESIDE;
    };
    return rods.some((one) => rods.some((other) => one.chain !== other.chain && lies(one, other)));
  }

  // The lines and outlines of supports and springs: { role, carrier, closed, points } in metres along the rail and down.
  pieces(y, shift = this.shift) {
    const joints = this.places(y, [0, 0]).map((one) => one.joints);
    return piecesAt(y, joints).map((piece) => ({ ...piece, points: piece.points.map(([along, down]) => [along + shift[0], down + shift[1]]) }));
  }

  pixel([along, down]) {
    return [this.width / 2 + (along - this.camera) * this.scale, this.top + down * this.scale];
  }

  metre([x, y]) {
    return [(x - this.width / 2) / this.scale + this.camera, (y - this.top) / this.scale];
  }

  // What is under a point: { link } by its number in the scene, { carrier, piece, corner }, or null.
  under(point, y, near) {
    let best = { distance: near };
    this.places(y).forEach(({ joints, centres }, number) => {
      const { first, links } = this.system.chains[number];
      links.forEach((link, i) => {
        for (const place of [joints[i + 1], centres[i]]) {
          const [px, py] = this.pixel(place);
          const distance = Math.hypot(point[0] - px, point[1] - py);
          if (distance < best.distance) best = { distance, link: first + i };
        }
      });
    });
    // On a body a bob near it is not meant.
    const carrier = this.carrierUnder(point, y, near);
    return best.link !== undefined && !(carrier?.inside && best.distance > ON) ? { link: best.link } : carrier;
  }

  // The carrier whose body or line is there, with the corner of it that is nearest.
  carrierUnder(point, y, near) {
    let best = null;
    this.pieces(y).forEach(({ role, carrier, closed, points }, piece) => {
      if (carrier < 0 || !["body", "line", "dot"].includes(role)) return;
      const seen = points.map((place) => this.pixel(place));
      const inside = closed && within(point, seen);
      seen.forEach(([px, py], corner) => {
        const distance = Math.hypot(point[0] - px, point[1] - py);
        if ((inside || distance < near) && distance < (best?.distance ?? Infinity)) best = { carrier, piece, corner, distance, inside };
      });
    });
    return best;
  }

  // The state in which a corner of a carrier is as near to a point (m) as its coordinates allow, with the least motion
  // of them: Newton's steps by differences.
  dragged(y, { carrier, piece, corner }, target) {
    const state = Float64Array.from(y).fill(0, this.system.size);
    const own = coordinatesOf().flatMap((one, i) => (one.carrier === carrier ? [{ i, scale: one.unit === "rad" ? 1 : this.reach }] : []));
    const at = (state) => this.pieces(state)[piece].points[corner];
    for (let round = 0; round < 4; round++) {
      const place = at(state);
      const left = target.map((value, k) => value - place[k]);
      const slopes = own.map(({ i, scale }) => {
        const ends = [-STEP, STEP].map((step) => {
          const moved = Float64Array.from(state);
          moved[i] += step * scale;
          return at(moved);
        });
        return [0, 1].map((k) => (ends[1][k] - ends[0][k]) / (2 * STEP));
      });
      const [xx, xz, zz] = [[0, 0], [0, 1], [1, 1]].map(([k, j]) => slopes.reduce((total, slope) => total + slope[k] * slope[j], 0));
      const weak = WEAK * (xx + zz);
      const size = (xx + weak) * (zz + weak) - xz * xz;
      if (!size) break;
      const push = [((zz + weak) * left[0] - xz * left[1]) / size, ((xx + weak) * left[1] - xz * left[0]) / size];
      own.forEach(({ i, scale }, k) => (state[i] += scale * (slopes[k][0] * push[0] + slopes[k][1] * push[1])));
    }
    return state;
  }

  // The state in which the end of a link is as near to a point (m) as its chain allows: cyclic coordinate descent.
  pulled(y, number, [along, down]) {
    const state = Float64Array.from(y);
    const chain = this.system.chains.findLast((one) => one.first <= number);
    const [index, own] = [this.system.chains.indexOf(chain), number - chain.first];
    for (let round = 0; round < 12; round++) {
      for (let i = own; i >= 0; i--) {
        const { joints } = this.places(state)[index];
        const pivot = joints[i];
        const tip = joints[own + 1];
        const turn = Math.atan2(along - pivot[0], down - pivot[1]) - Math.atan2(tip[0] - pivot[0], tip[1] - pivot[1]);
        const least = Math.atan2(Math.sin(turn), Math.cos(turn)) * (own ? 0.5 : 1);
        for (let k = i; k <= own; k++) state[this.system.lead + chain.first + k] += least;
      }
    }
    state.fill(0, this.system.size);
    return state;
  }

  // By the mass, but so that the bobs of a long chain do not touch.
  radius(link) {
    const { links, chains } = this.system;
    const size = this.reach * this.scale;
    const most = clamp((0.4 * size) / Math.max(...chains.map((chain) => chain.links.length)), 3, 30);
    return clamp(0.075 * size * Math.cbrt(link.m / Math.max(...links.map(({ m }) => m))), Math.min(4.5, most), most);
  }
}

const middleOf = (places) => places.reduce((total, { joints }) => total + joints[0][0], 0) / places.length;

// Whether a point is inside an outline.
function within([x, y], points) {
  return points.reduce((inside, [x1, y1], k) => {
    const [x0, y0] = points.at(k - 1);
    return y0 > y !== y1 > y && x < x0 + ((y - y0) * (x1 - x0)) / (y1 - y0) ? !inside : inside;
  }, false);
}
