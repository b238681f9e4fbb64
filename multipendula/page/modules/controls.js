// Sliders with their numbers: what can be changed, and by how much.

import { motionsIn, numbersOf, placed } from "./carriers.js";
import { slowestOf } from "./modes.js";
import { digits } from "./numbers.js";
import { rounded } from "./stage.js";
import { pushedAt } from "./system.js";

const STEPS = 600;

// A slider from `low` to `high` on a logarithmic scale, or on a linear one from 0.
class Slider {
  // `there` tells whether it applies at all.
  constructor(box, { label, unit, read, write, range, linear = false, there = () => true }) {
    Object.assign(this, { read, write, range, linear, unit, there });
    const id = `slider-${Slider.count++}`;
    const name = document.createElement("label");
    name.htmlFor = id;
    name.append(label, " ");
    const small = document.createElement("small");
    small.textContent = unit;
    name.append(small);
    this.bar = Object.assign(document.createElement("input"), { type: "range", id, min: 0, max: STEPS, step: 1 });
    this.number = Object.assign(document.createElement("input"), { type: "number", step: "any", min: 0 });
    this.number.setAttribute("aria-label", `${label}, ${unit}`);
    this.refusal = Object.assign(document.createElement("p"), { className: "refused", id: `${id}-refused`, hidden: true });
    this.refusal.setAttribute("role", "alert");
    this.label = label;
    this.bar.addEventListener("input", () => this.enter(rounded(this.valueAt(Number(this.bar.value) / STEPS))));
    this.number.addEventListener("change", () => this.typed());
    this.name = name;
    box.append(name, this.bar, this.number, this.refusal);
  }

  // A number from the keys: what is none, or has no meaning here, is refused beside it.
  typed() {
    const text = this.number.value;
    const value = Number(text);
    if (text === "" || !Number.isFinite(value)) this.refuse("a number is needed");
    else if (value < 0 || (!value && !this.linear)) this.refuse(`it must be ${this.linear ? "0 or more" : "above 0"}`);
    else this.enter(value);
  }

  enter(value) {
    this.accept();
    Slider.entering = this;
    this.write(value);
    Slider.entering = null;
    this.show();
  }

  // Said beside the number, which stays as it was, and read to those who do not see it.
  refuse(why) {
    const value = `${written(this.read())} ${this.unit}`.trim();
    this.refusal.textContent = `${this.label}: ${why}. It stays ${value}.`;
    this.refusal.hidden = false;
    this.number.setAttribute("aria-invalid", "true");
    this.number.setAttribute("aria-describedby", this.refusal.id);
    this.show(true);
  }

  accept() {
    if (this.refusal.hidden) return;
    this.refusal.hidden = true;
    this.refusal.textContent = "";
    this.number.removeAttribute("aria-invalid");
    this.number.removeAttribute("aria-describedby");
  }

  static count = 0;
  static entering = null; // whose number is being tried

  ends() {
    const value = this.read();
    if (!this.limits || value < this.limits[0] || value > this.limits[1]) this.limits = this.range(value);
    return this.limits;
  }

  valueAt(part) {
    const [low, high] = this.ends();
    return this.linear ? low + part * (high - low) : low * (high / low) ** part;
  }

  show(always = false) {
    for (const part of [this.name, this.bar, this.number]) part.hidden = !this.there();
    const value = this.read();
    const [low, high] = this.ends();
    const part = this.linear ? (value - low) / (high - low) : Math.log(value / low) / Math.log(high / low);
    this.bar.value = Math.round(STEPS * part);
    this.bar.setAttribute("aria-valuetext", `${digits(value)} ${this.unit}`);
    if (always || document.activeElement !== this.number) this.number.value = written(value);
  }

  forget() {
    this.limits = null;
  }
}

// Four digits, as short as a field needs them.
const written = (value) => {
  const own = Number(value.toPrecision(4));
  return own >= 1e6 || (own && own < 1e-4) ? own.toExponential().replace("e+", "e") : String(own);
};
const decade = (value) => [value / 10, value * 10];

export class Controls {
  constructor(boxes, player) {
    Object.assign(this, { player, chooser: boxes.chooser });
    const link = () => {
      const { entry, index } = player.home(player.selected);
      return player.scene.pendulum[entry].links[index];
    };
    const ofLink = (key) => ({ read: () => link()[key], write: (value) => player.changeLink(player.selected, key, value), range: decade });
    const ofAir = (key) => ({ ...ofLink(key), linear: true, read: () => link()[key] ?? 0, range: (value) => [0, 2 * value || 1] });
    this.ofLink = [
      new Slider(boxes.link, { label: "Mass", unit: "kg", ...ofLink("mass") }),
      new Slider(boxes.link, { label: "Length", unit: "m", ...ofLink("length") }),
    ];
    const { links, structure } = player.system;
    const hasAir = (key) => !structure && links.some(({ [key]: value }) => value);
    if (hasAir("drag")) this.ofLink.push(new Slider(boxes.link, { label: "Drag", unit: "N s/m", ...ofAir("drag") }));
    if (hasAir("quadratic")) this.ofLink.push(new Slider(boxes.link, { label: "Quadratic drag", unit: "N s²/m²", ...ofAir("quadratic_drag") }));
    this.others = [
      new Slider(boxes.scene, {
        label: "Gravity",
        unit: "m/s²",
        read: () => player.scene.gravity,
        write: (value) => player.change((scene) => (scene.gravity = value)),
        range: decade,
      }),
      new Slider(boxes.scene, {
        label: "Damping",
        unit: "% critical",
        linear: true,
        read: () => this.dampingOf(),
        write: (value) => this.damp(value),
        range: (value) => [0, Math.max(10, value * 2)],
      }),
      new Slider(boxes.scene, {
        label: "Mode amplitude",
        unit: "°",
        linear: true,
        read: () => player.amplitude,
        write: (value) => {
          player.amplitude = Math.min(value, 170);
          this.show();
        },
        range: (value) => [0.5, Math.max(90, value)],
      }),
    ];
    if (player.system.cart) {
      this.others.unshift(
        new Slider(boxes.cart, {
          label: "Cart mass",
          unit: "kg",
          read: () => player.scene.support.mass,
          write: (value) => player.change((scene) => (scene.support.mass = value)),
          range: (value) => [value / 100, value * 100],
        }),
      );
    }
    if (player.system.structure) this.ofCarriers(boxes.cart);
    this.ofFriction(boxes);
    this.ofTime(boxes);
    this.others.push(
      new Slider(boxes.drive, {
        label: pushedAt(player.system).unit === "N" ? "Force" : "Moment",
        unit: pushedAt(player.system).unit,
        read: () => player.drive.amount,
        write: (amount) => player.drives({ amount }),
        range: decade,
      }),
      new Slider(boxes.drive, {
        label: "Frequency",
        unit: "Hz",
        read: () => player.drive.frequency,
        write: (frequency) => player.drives({ frequency }),
        range: decade,
      }),
    );
    this.chooser.addEventListener("change", () => player.choose(Number(this.chooser.value)));
    this.name();
  }

  // Dry friction where the scene has some: on the rail, and of the chosen link.
  ofFriction(boxes) {
    const { player } = this;
    for (const [key, unit] of [["friction", "N"], ["friction_coefficient", ""]]) {
      const { support } = player.scene;
      if (!player.system.cart || !support[key]) continue;
      const label = unit ? "Rail friction" : "Rail friction coefficient";
      const change = (value) => player.change((scene) => (scene.support[key] = value));
      this.others.unshift(new Slider(boxes.cart, { label, unit, read: () => player.scene.support[key], write: change, range: decade }));
    }
    if (!player.system.links.some(({ friction }) => friction)) return;
    const own = () => player.system.links[player.selected].friction;
    const change = (value) => player.changeLink(player.selected, "friction", value);
    this.ofLink.push(new Slider(boxes.link, { label: "Friction", unit: "N m", read: () => own() || 1, write: change, range: decade, there: () => own() > 0 }));
  }

  // What moves a support or acts in time.
  ofTime(boxes) {
    const { player } = this;
    const several = motionsIn(player.scene).length > 1;
    const swing = { linear: true, range: (value) => [0, 2 * value || player.view.reach / 10] };
    const of = (within, key) => ({ read: () => within(player.scene)[key], write: (value) => player.change((scene) => (within(scene)[key] = value)) });
    motionsIn(player.scene).forEach(({ direction, kind }, k) => {
      if (kind !== "sine" && kind !== "sweep") return;
      const [within, whose] = [(scene) => motionsIn(scene)[k], several ? (direction === "vertical" ? "Upward " : "Sideways ") : "Support "];
      this.others.push(
        new Slider(boxes.cart, { label: `${whose}amplitude`, unit: "m", ...of(within, "amplitude"), ...swing }),
        ...this.frequencies(boxes.cart, `${whose}frequency`, kind, (key) => of(within, key)),
      );
    });
    (player.scene.force ?? []).forEach(({ on, direction, kind }, k) => {
      if (kind !== "sine" && kind !== "sweep") return;
      const within = (scene) => scene.force[k];
      const [what, unit] = direction === "torque" ? ["Torque", "N m"] : ["Force", "N"];
      this.others.push(
        new Slider(boxes.scene, { label: `${what} on ${on}`, unit, ...of(within, "amplitude"), range: decade }),
        ...this.frequencies(boxes.scene, "Its frequency", kind, (key) => of(within, key)),
      );
    });
  }

  // Of a sine one, of a sweep where it begins and ends.
  frequencies(box, label, kind, of) {
    const slider = (key, end = "") => new Slider(box, { label: `${label}${end}`, unit: "Hz", ...of(key), range: decade });
    return kind === "sine" ? [slider("frequency_hz")] : [slider("from_hz", ", first"), slider("to_hz", ", last")];
  }

  // The numbers of supports and springs: a list to choose one from, and its sliders.
  ofCarriers(box) {
    const { player } = this;
    this.parts = numbersOf(player.scene);
    if (!this.parts.length) return;
    const label = Object.assign(document.createElement("label"), { className: "select wide" });
    this.part = document.createElement("select");
    this.part.replaceChildren(...this.parts.map(({ name }, number) => new Option(name, String(number))));
    label.append("Support or spring ", this.part);
    box.before(label);
    const choose = () => {
      box.replaceChildren();
      this.ofPart = this.parts[Number(this.part.value)].numbers.map(
        ({ label, unit, place }) =>
          new Slider(box, {
            label,
            unit,
            read: () => placed(player.scene, place) ?? 0,
            write: (value) => player.change((scene) => (placed(scene, place.slice(0, -1))[place.at(-1)] = value)),
            ...(label.startsWith("Damping") ? { linear: true, range: (value) => [0, 2 * value || 1] } : { range: decade }),
          }),
      );
      for (const slider of this.ofPart) slider.show();
    };
    this.part.addEventListener("change", choose);
    this.part.value = "0";
    choose();
  }

  // The names of all links, in order.
  name() {
    const options = this.player.system.links.map((_, number) => {
      const { chain, index } = this.player.home(number);
      const place = this.player.system.chains.indexOf(chain) + 1;
      return new Option(`Pendulum ${place}, link ${index + 1}`, String(number));
    });
    this.chooser.replaceChildren(...options);
  }

  // Dampers at every joint: for a share of critical damping c they are 2 c g b/w of the slowest mode.
  damp(percent) {
    const { player } = this;
    const slowest = slowestOf(player.system);
    player.change((scene) => {
      for (const chain of player.system.chains) {
        chain.links.forEach((link, i) => {
          const value = rounded((2 * percent * player.system.gravity * link.b) / slowest / 100);
          const own = scene.pendulum[chain.entry].links[i];
          if (value) own.damping = value;
          else delete own.damping;
        });
      }
    });
  }

  // The share that the first joint has now.
  dampingOf() {
    const { player } = this;
    const [link] = player.system.links;
    return link.damping ? (50 * link.damping * slowestOf(player.system)) / (player.system.gravity * link.b) : 0;
  }

  // After another choice the sliders of a link have other limits.
  chose() {
    for (const slider of this.ofLink) {
      slider.forget();
      slider.accept();
    }
    this.show();
  }

  // Whether a number of a slider was refused by the scene, which is said beside it.
  refuse(why) {
    Slider.entering?.refuse(why);
    return Slider.entering !== null;
  }

  show() {
    this.chooser.value = String(this.player.selected);
    for (const slider of [...this.ofLink, ...this.others, ...(this.ofPart ?? [])]) slider.show();
  }
}
