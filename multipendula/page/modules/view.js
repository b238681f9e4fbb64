// Where everything is seen: pivots apart on the support, metres as pixels, and what is under a finger.

import { clamp } from "./numbers.js";
import { sum } from "./system.js";

export class View {
  constructor(system) {
    this.system = system;
    this.reach = Math.max(...system.chains.map(({ links }) => sum(links.map((link) => Math.max(link.l, link.c)))));
    const n = system.chains.length;
    this.gap = this.reach * Math.min(0.85, 2.2 / n);
    this.pivots = system.chains.map((_, i) => (i - (n - 1) / 2) * this.gap);
    this.shift = [0, 0]; // of a moved support, along the rail and down
    this.half = this.pivots.at(-1) + 0.16 * this.reach;
    this.forget();
  }

  // Back to the usual frame.
  forget() {
    const up = this.system.links.some((link) => link.s < 0);
    this.extent = { up: (up ? 1.15 : 0.32) * this.reach, down: 1.12 * this.reach, side: this.half + 0.55 * this.reach };
    this.camera = 0;
  }

  fit(width, height) {
    [this.width, this.height] = [width, height];
    const { up, down, side } = this.extent;
    this.scale = Math.min(width / (2 * side), height / (up + down));
    this.top = (height - this.scale * (up + down)) / 2 + this.scale * up;
  }

  // The frame grows with what moves, and follows a cart that leaves it.
  follow(places, x) {
    const { extent, reach } = this;
    const slack = 0.3 * reach;
    if (Math.abs(x - this.camera) > slack) this.camera = x - Math.sign(x - this.camera) * slack;
    for (const { joints } of places) {
      for (const [along, down] of joints) {
        extent.up = Math.max(extent.up, 0.12 * reach - down);
        extent.down = Math.max(extent.down, down + 0.12 * reach);
        extent.side = Math.max(extent.side, Math.abs(along - this.camera) + 0.12 * reach);
      }
    }
  }

  // Joints (from the pivot down) and centres of every chain in metres, along the rail and down.
  places(y) {
    return this.system.chains.map(({ first, links }, number) => {
      let at = [y[0] + this.pivots[number] + this.shift[0], this.shift[1]];
      const [joints, centres] = [[at], []];
      links.forEach((link, i) => {
        const [s, c] = [Math.sin(y[1 + first + i]), Math.cos(y[1 + first + i])];
        centres.push([at[0] + link.c * s, at[1] + link.c * c]);
        at = [at[0] + link.l * s, at[1] + link.l * c];
        joints.push(at);
      });
      return { joints, centres };
    });
  }

  pixel([along, down]) {
    return [this.width / 2 + (along - this.camera) * this.scale, this.top + down * this.scale];
  }

  metre([x, y]) {
    return [(x - this.width / 2) / this.scale + this.camera, (y - this.top) / this.scale];
  }

  // What is under a point: { link } by its number in the scene, { cart: true }, or null.
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
    if (best.link !== undefined) return { link: best.link };
    const [x, top] = this.pixel([y[0], 0]);
    const onCart = Math.abs(point[0] - x) < this.half * this.scale && Math.abs(point[1] - top) < Math.max(22, near);
    return this.system.cart && onCart ? { cart: true } : null;
  }

  // The state in which the end of a link is as near to a point (m) as its chain allows: cyclic coordinate descent.
  pulled(y, number, [along, down]) {
    const found = Float64Array.from(y);
    const chain = this.system.chains.findLast((one) => one.first <= number);
    const [index, own] = [this.system.chains.indexOf(chain), number - chain.first];
    for (let round = 0; round < 12; round++) {
      for (let i = own; i >= 0; i--) {
        const { joints } = this.places(found)[index];
        const pivot = joints[i];
        const tip = joints[own + 1];
        const turn = Math.atan2(along - pivot[0], down - pivot[1]) - Math.atan2(tip[0] - pivot[0], tip[1] - pivot[1]);
        const least = Math.atan2(Math.sin(turn), Math.cos(turn)) * (own ? 0.5 : 1);
        for (let k = i; k <= own; k++) found[1 + chain.first + k] += least;
      }
    }
    found.fill(0, this.system.size);
    return found;
  }

  radius(link) {
    const heaviest = Math.max(...this.system.links.map(({ m }) => m));
    return clamp(0.075 * this.reach * this.scale * Math.cbrt(link.m / heaviest), 4.5, 30);
  }
}
