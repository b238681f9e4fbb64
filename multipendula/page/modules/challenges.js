// Tasks that check themselves: the first three that a scene can be made to do.

import { coordinatesOf } from "./carriers.js";
import { mannerOf } from "./shapes.js";

const [PERIOD, WITHIN] = [30, 1]; // s
const [STILL, QUIET] = [0.01, 5]; // of the longest pendulum; s
const [SMALL, FAR] = [Math.PI / 18, Math.PI / 6]; // rad
const SOON = 20; // s

const TASKS = [
  {
    words: "Make two pendula beat with a period of 30 s ± 1 s.",
    isThere: ({ system }) => system.chains.length > 1 && (system.cart || system.structure),
    isDone: ({ rows }) => rows.some(({ beat }) => Math.abs(beat - PERIOD) <= WITHIN),
  },
  {
    words: "Swing beyond 10° for 5 s while the support stays still.",
    isThere: ({ system, rows }) => coordinatesOf().length > 0 && rows.some((row) => mannerOf(row) === "swings" && restsIn(system, row)),
    isDone: (player, memory) => {
      const { system, motion, y, view } = player;
      if (!motion || motion !== memory.motion || y.slice(0, system.lead).some((value) => Math.abs(value) > STILL * view.reach)) {
        Object.assign(memory, { motion, since: motion?.time ?? 0, largest: 0 });
      }
      memory.largest = Math.max(memory.largest, largestAngle(player));
      return memory.largest > SMALL && motion?.time - memory.since > QUIET;
    },
  },
  {
    words: "From rest, let the drive swing a link beyond 30°.",
    isThere: ({ system }) => system.links.every(({ s }) => s > 0),
    isDone: (player) => {
      const { motion, drive } = player;
      return Boolean(drive.on && motion && !motion.first.kinetic && !motion.first.potential && largestAngle(player) > FAR);
    },
  },
  {
    words: "Start so that linear is off by 30° within 20 s.",
    isThere: () => true,
    isDone: ({ motion }) => Boolean(motion?.linear && motion.time < SOON && motion.apart > FAR),
  },
  {
    words: "Let a link turn right over.",
    isThere: () => true,
    isDone: (player) => player.motion?.time > 0 && largestAngle(player) > Math.PI,
  },
];
const SHOWN = 3;

const restsIn = ({ lead }, { shapes: [x] }) => x.slice(0, lead).every((value) => Math.abs(value) < 1e-6);
const largestAngle = ({ system, y }) => Math.max(...system.links.map(({ rest }, i) => Math.abs(y[system.lead + i] - rest)));

export class Challenges {
  constructor(list, player) {
    this.player = player;
    this.tasks = TASKS.filter(({ isThere }) => isThere(player)).slice(0, SHOWN).map((task) => ({ ...task, memory: {}, line: document.createElement("li") }));
    for (const { line, words } of this.tasks) line.textContent = words;
    list.append(...this.tasks.map(({ line }) => line));
  }

  // The words of a task that has just been solved, by more than what the page does by itself.
  solved() {
    this.given ??= this.player.motion ?? "at rest";
    if (this.player.motion === this.given) return "";
    const task = this.tasks.find(({ line, isDone, memory }) => line.className !== "done" && isDone(this.player, memory));
    if (!task) return "";
    task.line.className = "done";
    return `Solved: ${task.words}`;
  }
}
