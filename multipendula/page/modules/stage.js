// The hand on the scene: pull, lengthen, make heavier, by pointer and by keys.

import { placed, supportPlace } from "./carriers.js";
import { clamp } from "./numbers.js";

const NEAR = 34; // pixels
const TURN = Math.PI / 90;

export class Stage {
  constructor(canvas, player) {
    Object.assign(this, { canvas, player, tool: "pull", held: null });
    canvas.addEventListener("pointerdown", (event) => this.take(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", () => this.drop());
    canvas.addEventListener("pointercancel", () => this.drop());
    // A finger on a bob pulls it; anywhere else it scrolls the page.
    canvas.addEventListener("touchstart", (event) => this.touch(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  point(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  touch(event) {
    if (this.player.view.under(this.point(event.touches[0]), this.player.y, NEAR)) event.preventDefault();
  }

  take(event) {
    const { player } = this;
    const grabbed = player.view.under(this.point(event), player.y, NEAR);
    if (!grabbed) return;
    event.preventDefault();
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    const point = this.point(event);
    this.held = { ...grabbed, point, moved: false };
    if (grabbed.link !== undefined) player.choose(grabbed.link);
    this.held.place = grabbed.link === undefined ? supportPlace(player.scene, grabbed.carrier) : player.home(grabbed.link).place;
    this.held.first = placed(player.scene, this.held.place);
  }

  move(event) {
    const { held, player, canvas } = this;
    const point = this.point(event);
    if (!held) {
      canvas.style.cursor = player.view.under(point, player.y, NEAR) ? "grab" : "default";
      return;
    }
    canvas.style.cursor = "grabbing";
    if (!held.moved && Math.hypot(point[0] - held.point[0], point[1] - held.point[1]) < 3) return;
    held.moved = true;
    if (this.tool === "mass") this.weigh(point);
    else if (held.carrier !== undefined) this.haul(point);
    else if (this.tool === "length") this.lengthen(point);
    else player.place(player.view.pulled(player.y, held.link, player.view.metre(point)));
  }

  // Upwards is heavier: a factor of ten over 160 pixels.
  weigh(point) {
    const { held, player } = this;
    const factor = 10 ** ((held.point[1] - point[1]) / 160);
    if (held.first.mass) player.set([...held.place, "mass"], rounded(held.first.mass * factor));
  }

  lengthen(point) {
    const { held, player } = this;
    const { pendulum, index } = player.home(held.link);
    const pivot = player.view.places(player.y)[pendulum].joints[index];
    const [along, down] = player.view.metre(point);
    const length = clamp(Math.hypot(along - pivot[0], down - pivot[1]), 0.1 * held.first.length, 10 * held.first.length);
    player.set([...held.place, "length"], rounded(length));
  }

  // The held corner of a carrier goes with the hand.
  haul(point) {
    const { held, player } = this;
    const { view } = player;
    held.corner0 ??= view.pieces(player.y)[held.piece].points[held.corner];
    const [from, to] = [held.point, point].map((place) => view.metre(place));
    player.place(view.dragged(player.y, held, [0, 1].map((k) => held.corner0[k] + to[k] - from[k])));
  }

  drop() {
    const { held, player } = this;
    this.held = null;
    if (held?.moved && this.tool === "pull") player.release();
  }

  key(event) {
    const { player } = this;
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const turn = (event.shiftKey ? 5 : 1) * TURN;
    const actions = {
      ArrowLeft: () => this.tilt(-turn),
      ArrowRight: () => this.tilt(turn),
      ArrowUp: () => player.choose(player.selected - 1),
      ArrowDown: () => player.choose(player.selected + 1),
      Enter: () => player.release(),
      " ": () => player.toggle(),
      k: () => player.kick(),
      r: () => player.hang(),
    };
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  }

  tilt(turn) {
    const { player } = this;
    const y = Float64Array.from(player.y);
    y.fill(0, player.system.size);
    y[player.system.lead + player.selected] += turn;
    player.place(y);
  }
}

// Three digits, so that a scene file made by hand stays legible.
export const rounded = (value) => Number(value.toPrecision(3));
