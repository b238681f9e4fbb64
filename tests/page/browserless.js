// As much of a browser as the page's own script needs: elements that keep what they are given, a canvas that writes down
// what is drawn, and frames that come when asked.

const listenersOf = new WeakMap();

class FakeElement {
  constructor(id = "") {
    Object.assign(this, { id, children: [], attributes: {}, dataset: {}, style: {}, textContent: "", value: "1", checked: false, hidden: false });
    Object.assign(this, { clientWidth: 800, clientHeight: 500, width: 0, height: 0 });
    listenersOf.set(this, {});
    const names = new Set();
    this.classList = { add: (name) => names.add(name), remove: (name) => names.delete(name), toggle: (name, on) => (on ? names.add(name) : names.delete(name)) };
  }
  append(...parts) {
    this.children.push(...parts);
  }
  replaceChildren(...parts) {
    this.children = parts;
  }
  before(...parts) {
    this.beside = parts;
  }
  setAttribute(name, value) {
    this.attributes[name] = value;
  }
  removeAttribute(name) {
    delete this.attributes[name];
  }
  addEventListener(name, listener) {
    (listenersOf.get(this)[name] ??= []).push(listener);
  }
  fire(name, event = {}) {
    const given = { target: this, preventDefault() {}, ...event };
    for (const listener of listenersOf.get(this)[name] ?? []) listener(given);
  }
  click() {
    this.fire("click");
  }
  closest() {
    return this;
  }
  getBoundingClientRect() {
    return { left: 0, top: 0 };
  }
  focus() {}
  setPointerCapture() {}
  getContext() {
    return (this.ink ??= new Ink());
  }
}

// Strokes and fills with the points of their paths; an error for a point that is no number.
class Ink {
  constructor() {
    this.drawn = [];
    this.path = [];
  }
  beginPath() {
    this.path = [];
  }
  point(...place) {
    if (!place.every(Number.isFinite)) throw new Error(`no place: ${place}`);
    this.path.push(place);
  }
  moveTo(x, y) {
    this.point(x, y);
  }
  lineTo(x, y) {
    this.point(x, y);
  }
  arc(x, y, radius) {
    this.point(x, y, radius);
  }
  roundRect(...box) {
    this.point(...box);
  }
  fillRect(...box) {
    this.point(...box);
  }
  rect(...box) {
    this.point(...box);
  }
  stroke() {
    this.drawn.push(["stroke", this.strokeStyle, this.path]);
  }
  fill() {
    this.drawn.push(["fill", this.fillStyle, this.path]);
  }
  closePath() {}
  clearRect() {
    this.drawn = [];
  }
  setTransform() {}
  setLineDash() {}
  fillText() {}
  save() {}
  restore() {}
  clip() {}
}

// `given` are the data of the page and the end of its address.
const elements = {};
const frames = [];
const element = (id) => (elements[id] ??= new FakeElement(id));
element("data").textContent = JSON.stringify(given.data);
globalThis.document = {
  title: "",
  documentElement: element("root"),
  getElementById: element,
  createElement: (tag) => new FakeElement(tag),
  querySelectorAll: () => [],
  addEventListener() {},
};
globalThis.window = { devicePixelRatio: 1 };
globalThis.location = { hash: given.hash, href: "page.html" };
globalThis.matchMedia = (wish) => ({ matches: wish.includes("motion"), addEventListener() {} });
globalThis.getComputedStyle = () => ({ getPropertyValue: (name) => name, fontSize: "16px" });
globalThis.Option = class extends FakeElement {
  constructor(text, value) {
    super();
    Object.assign(this, { textContent: text, value });
  }
};
globalThis.requestAnimationFrame = (draw) => frames.push(draw);

// So many frames of 20 ms.
let clock = 0;
function pass(count) {
  for (let k = 0; k < count; k++) frames.shift()((clock += 20));
}
