// The table of modes: what screen readers read, and what sets a mode swinging.

import { mannerOf } from "./shapes.js";
import { digits } from "./numbers.js";

export class ModeTable {
  constructor(body, heads, player) {
    Object.assign(this, { body, heads, player, lines: [] });
  }

  // New numbers in the same lines, new lines only where their number has changed.
  show() {
    const { player, body, heads } = this;
    const damped = player.rows.some((row) => row.ratio && !row.growing);
    body.closest("table").classList.toggle("damped", damped);
    const [beats, angles] = ["beat", "onePercent"].map((key) => player.rows.some((row) => Number.isFinite(row[key])));
    body.closest("table").classList.toggle("beatless", !beats);
    body.closest("table").classList.toggle("angleless", !angles);
    [heads.beat.hidden, heads.angle.hidden, heads.star.hidden] = [!beats, !angles, !player.rows.some((row) => row.resonant)];
    heads.frequency.textContent = damped ? "|λ|/2π (Hz)" : "f (Hz)";
    heads.damped.hidden = !damped;
    heads.outdated.hidden = !player.known || player.isKnown;
    if (this.lines.length !== player.rows.length) {
      this.lines = player.rows.map((_, number) => this.line(number));
      body.replaceChildren(...this.lines.map(({ line }) => line));
    }
    player.rows.forEach((row, number) => this.fill(this.lines[number], row, number));
  }

  line(number) {
    const line = document.createElement("tr");
    const head = document.createElement("th");
    head.scope = "row";
    const button = document.createElement("button");
    button.type = "button";
    const [name, words, bar] = ["b", "span", "i"].map((tag) => document.createElement(tag));
    button.append(name, words);
    bar.setAttribute("aria-hidden", "true");
    head.append(button, bar);
    const cells = ["f", "T", "beat", "angle", "ratio"].map((kind) => {
      const cell = document.createElement("td");
      cell.className = kind;
      return cell;
    });
    line.append(head, ...cells);
    line.addEventListener("click", () => this.player.swing(number));
    return { line, button, name, words, bar, cells };
  }

  fill({ line, button, name, words, cells }, row, number) {
    const chosen = this.player.row === number;
    const manner = mannerOf(row);
    const swings = manner === "swings";
    name.textContent = `${number + 1}${row.resonant ? "*" : ""}`;
    words.textContent = row.words;
    button.setAttribute("aria-pressed", String(chosen));
    line.classList.toggle("chosen", chosen);
    line.classList.toggle("grows", manner === "grows");
    const values = [
      swings ? digits(row.omega / (2 * Math.PI), 5) : manner === "shifts" ? "0" : manner,
      swings ? digits((2 * Math.PI) / row.turn, 5) : manner === "shifts" ? "–" : `${manner === "grows" ? "×" : "÷"}e in ${digits(1 / row.omega, 3)}`,
      digits(row.beat, 4),
      row.onePercent > 90 ? (row.kappa ? ">90" : "–") : digits(row.onePercent, 3),
      digits(row.ratio, 4),
    ];
    cells.forEach((cell, i) => (cell.textContent = values[i]));
  }

  // How far each mode swings now, as a bar below its name: full at 30 degrees.
  measure(amplitudes) {
    this.lines.forEach(({ bar }, i) => (bar.style.transform = `scaleX(${Math.min(1, (amplitudes[i] ?? 0) / 0.5236).toFixed(4)})`));
  }
}
