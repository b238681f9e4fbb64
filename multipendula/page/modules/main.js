// The page: its parts joined, and a frame after the other.

import { Challenges } from "./challenges.js";
import { Controls } from "./controls.js";
import { energiesOf } from "./equations.js";
import { mannerOf } from "./shapes.js";
import { degrees, digits, scientific } from "./numbers.js";
import { drawScene, drawStrip, hueOf, paint } from "./picture.js";
import { Player, SPAN } from "./player.js";
import { Recording } from "./recording.js";
import { packed, sceneFile, unpacked } from "./scene_file.js";
import { Sound } from "./sound.js";
import { Stage } from "./stage.js";
import { ModeTable } from "./table.js";

const SAMPLES = 4000; // of the strip
const TRAIL = 70; // frames
const MANNERS = { swings: "swings", grows: "grows", decays: "decays without a swing", shifts: "shifts everything alike" };
const element = (id) => document.getElementById(id);

function begin() {
  const given = JSON.parse(element("data").textContent);
  const word = location.hash.slice(1);
  const known = given.known && { scene: JSON.stringify(given.scene), rows: given.known };
  const held = word ? linked(word, given.scene, known) : null;
  const player = held ?? new Player(given.scene, given.recording ? new Recording(given.recording) : null, known);
  const stage = new Stage(element("scene"), player);
  const table = new ModeTable(element("rows"), { frequency: element("head-f"), damped: element("note-damped"), beat: element("note-beat"), angle: element("note-angle"), star: element("note-star"), outdated: element("outdated") }, player);
  const boxes = { chooser: element("chooser"), link: element("of-link"), cart: element("of-cart"), time: element("of-time"), scene: element("of-scene"), drive: element("of-drive") };
  const controls = new Controls(boxes, player);
  const page = new LivePage({ player, stage, table, controls, challenges: new Challenges(element("tasks"), player), sound: new Sound(), given });
  if (word && !held) page.say("The link holds no scene: this is the page's own.");
  page.start();
  if (!held && !player.recording && !matchMedia("(prefers-reduced-motion: reduce)").matches) player.begin();
}

// What the link holds, null where it is not this page's scene with other numbers, or one that cannot be computed.
function linked(word, own, known) {
  const held = unpacked(word, own);
  try {
    const player = held && new Player(held.scene, null, known);
    if (player) restore(player, held);
    return player;
  } catch {
    return null;
  }
}

function restore(player, { y, drive, selected }) {
  if (drive) Object.assign(player.drive, { amount: drive.amount || player.drive.amount, frequency: drive.frequency, on: drive.on === true });
  if (selected !== undefined) player.selected = selected;
  if (y) player.place(Float64Array.from([...y, 0]));
}

class LivePage {
  constructor(parts) {
    Object.assign(this, parts, { trails: [], strip: [], colours: {}, last: 0, count: 0 });
  }

  start() {
    const { player } = this;
    element("title").textContent = player.scene.title || document.title;
    element("replay").hidden = !player.recording;
    element("left-out").textContent = this.given.notes.join(" ");
    element("left-out").hidden = !this.given.notes.length;
    player.listen((what) => this.heard(what));
    this.bindButtons();
    this.bindSwitches();
    this.dress();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.dress());
    for (const what of ["scene", "choice", "state", "drive"]) this.heard(what);
    requestAnimationFrame((now) => this.frame(now));
  }

  bindButtons() {
    const { player } = this;
    const actions = {
      play: () => player.toggle(),
      hang: () => player.hang(),
      kick: () => {
        player.kick();
        this.say("Kicked.");
      },
      theme: () => this.dress(this.isDark ? "light" : "dark"),
      wide: () => (document.fullscreenElement ? document.exitFullscreen() : element("whole").requestFullscreen()),
      file: () => this.copy(sceneFile(player.scene, player.system, player.isAtRest ? null : player.y), "Scene file copied."),
      link: () => this.copyLink(),
      back: () => player.step(-1),
      forth: () => player.step(1),
      again: () => player.replay(),
      tune: () => this.tune(),
    };
    for (const [id, action] of Object.entries(actions)) element(id).addEventListener("click", action);
  }

  bindSwitches() {
    const { player, sound, stage } = this;
    for (const radio of document.querySelectorAll("input[name=tool]")) {
      radio.addEventListener("change", () => (stage.tool = radio.value));
    }
    document.addEventListener("fullscreenchange", () => {
      element("wide").textContent = document.fullscreenElement ? "Leave full screen" : "Full screen";
    });
    element("speed").addEventListener("change", (event) => (player.speed = Number(event.target.value)));
    element("sound").addEventListener("change", (event) => (event.target.checked ? sound.start(player.rows) : sound.stop()));
    element("drive").addEventListener("change", (event) => {
      player.drives({ on: event.target.checked });
      if (player.drive.on && !player.playing) player.release();
    });
    element("scrub").addEventListener("input", (event) => {
      player.replaying = true;
      player.motion = null;
      player.seek((Number(event.target.value) / 1000) * player.recording.duration);
    });
  }

  // The theme: as the system has it, or as it was switched.
  dress(theme) {
    const root = document.documentElement;
    if (theme) root.dataset.theme = theme;
    this.isDark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    const style = getComputedStyle(root);
    const named = (name) => style.getPropertyValue(`--${name}`).trim();
    this.colours = Object.fromEntries(["ink", "muted", "line", "grid", "paper", "cart", "accent"].map((name) => [name, named(name)]));
    this.colours.hues = [1, 2, 3, 4, 5, 6].map((number) => named(`hue${number}`));
    element("theme").textContent = this.isDark ? "Light" : "Dark";
  }

  // What has changed is shown; numbers that run are shown by the frames.
  heard(what) {
    const { player, table, controls, sound } = this;
    if (what === "scene") {
      table.show();
      controls.show();
      if (element("sound").checked) sound.start(player.rows);
    }
    if (what === "choice") controls.chose();
    if (what === "drive") controls.show();
    if (what === "refused") {
      controls.show();
      const why = "with this number the scene is no equilibrium as drawn, or cannot be computed";
      if (!controls.refuse(why)) this.say(`W${why.slice(1)}: it stays as it was.`);
    }
    if (what === "lost") this.say("This motion is too fast to be computed: everything is brought to rest.");
    if (what === "mode" || what === "state") table.show();
    if (what === "mode") {
      const row = player.rows[player.row];
      this.say(`Mode ${player.row + 1} ${MANNERS[mannerOf(row)]}${row.multiplicity > 1 ? `, shape ${player.copy + 1} of ${row.multiplicity}` : ""}.`);
    }
    if (what === "state") {
      if (!player.playing || (player.motion && !player.motion.time)) Object.assign(this, { trails: [], strip: [] });
      element("play").textContent = player.playing ? "Pause" : "Play";
    }
    if (player.recording) element("again").disabled = player.replaying;
    element("drive").checked = player.drive.on;
  }

  frame(now) {
    const { player, sound } = this;
    player.frame((now - this.last) / 1000);
    if (player.system.support) player.view.shift = player.system.support(player.now).slice(0, 2);
    this.last = now;
    this.count++;
    this.remember();
    this.draw();
    if (this.count % 4 === 0) {
      this.tell();
      const solved = this.challenges.solved();
      if (solved) this.say(solved);
      const amplitudes = player.amplitudes;
      this.table.measure(amplitudes);
      if (element("sound").checked) sound.play(player.playing ? amplitudes : amplitudes.map(() => 0));
    }
    requestAnimationFrame((later) => this.frame(later));
  }

  remember() {
    const { player } = this;
    const places = player.view.places(player.y);
    player.view.follow(places);
    if (this.trails.length !== places.length) this.trails = places.map(() => []);
    if (!player.playing) return;
    places.forEach(({ joints }, i) => {
      this.trails[i].push(joints.at(-1));
      if (this.trails[i].length > TRAIL) this.trails[i].shift();
    });
    const { links, span } = player.watched;
    if (this.strip.at(-1)?.[0] > player.now || String(links) !== this.watched) this.strip = [];
    this.watched = String(links);
    if (this.strip.length && player.now - this.strip.at(-1)[0] < span / SAMPLES) return;
    const at = (y, link) => y[player.system.lead + link] - player.system.links[link].rest;
    const predicted = player.motion?.linear ? at(player.motion.predicted, player.selected) : NaN;
    this.strip.push([player.now, predicted, ...links.map((link) => at(player.y, link))]);
    while (this.strip[0][0] < player.now - span) this.strip.shift();
  }

  draw() {
    const { player, colours, trails, stage } = this;
    const shows = element("ghost").checked && player.motion?.linear && player.motion.apart < 2 * Math.PI;
    const predicted = shows ? player.motion.predicted : null;
    paint(element("scene"), colours, (ink, width, height) => {
      player.view.fit(width, height);
      drawScene(ink, player.view, { y: player.y, predicted, trails, selected: player.selected, tool: stage.tool, colours });
    });
    const hues = player.watched.links.map((link) => hueOf(player.system, player.home(link).pendulum, colours));
    const span = Math.max(SPAN, player.now - (this.strip[0]?.[0] ?? player.now));
    const now = Math.max(SPAN, player.now);
    paint(element("strip"), colours, (ink, width, height) => drawStrip(ink, width, height, { rows: this.strip, now, span, hues, colours }));
  }

  // The numbers that run.
  tell() {
    const { player, given } = this;
    const { kinetic, potential } = energiesOf(player.system, player.y);
    element("time").textContent = `${player.now.toFixed(2)} s`;
    element("energy").textContent = `${digits(kinetic + potential)} J`;
    element("kinetic").style.transform = `scaleX(${(kinetic / (kinetic + potential || 1)).toFixed(4)})`;
    const drift = player.replaying ? given.recording.drift : player.motion?.worst;
    element("drift").textContent = Number.isFinite(drift) ? (drift ? scientific(drift) : "0") : "–";
    const apart = player.motion?.linear ? degrees(player.motion.apart) : player.motion ? Infinity : NaN;
    element("apart").textContent = Number.isNaN(apart) ? "–" : apart > 360 ? "over 360°" : apart < 1e-3 ? "< 0.001°" : `${digits(apart, 3)}°`;
    element("behind").hidden = !player.behind;
    const { stuck } = player;
    element("sticking").hidden = !stuck;
    if (stuck) element("stuck").textContent = stuck.map((link) => (link < 0 ? "rail" : `link ${link + 1}`)).join(", ") || "nothing";
    element("strip-name").textContent = player.nameOf(...player.watched.links);
    if (player.replaying) element("scrub").value = Math.round((1000 * player.time) / (player.recording.duration || 1));
  }

  tune() {
    const { player } = this;
    const row = player.rows[player.row] ?? player.firstRow;
    if (row.omega) player.drives({ frequency: row.omega / (2 * Math.PI) });
  }

  say(words) {
    const status = element("status");
    status.textContent = words;
    status.classList.remove("gone");
    clearTimeout(this.saying);
    this.saying = setTimeout(() => status.classList.add("gone"), 4000);
  }

  // ------------------------------------------------------------------------------------------------ copies

  copyLink() {
    const { player } = this;
    const { on, amount, frequency } = player.drive;
    const y = player.isAtRest ? undefined : [...player.y.slice(0, -1)];
    const state = { scene: player.scene, y, drive: { on, amount, frequency }, selected: player.selected };
    history.replaceState(null, "", `#${packed(state)}`);
    this.copy(location.href, "Link copied: it holds the scene as it is now.");
  }

  // To the clipboard, or into a box to copy from where there is none.
  async copy(text, done) {
    try {
      await navigator.clipboard.writeText(text);
      this.say(done);
    } catch {
      element("paper").value = text;
      element("sheet").showModal();
      element("paper").select();
    }
  }
}

begin();
