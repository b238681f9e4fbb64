// What the pages need beyond their markup: keys reach all that scrolls, and screen readers tell its parts apart.

const WIDE = "pre, .math-wrapper, .table-wrapper, .cell_output .text_html";
const SENTENCE = 60;
const NAMES = { PRE: "Code or output", DIV: "Table or formula" };

/** What is wider than its place takes the focus, so that it scrolls by keys. */
function reachable() {
  for (const one of document.querySelectorAll(WIDE)) {
    const scrolls = one.scrollWidth > one.clientWidth + 1 && getComputedStyle(one).overflowX !== "visible";
    if (scrolls === one.hasAttribute("data-scrolls")) continue;
    one.toggleAttribute("data-scrolls", scrolls);
    if (scrolls) {
      one.tabIndex = 0;
      one.setAttribute("role", "group");
      one.setAttribute("aria-label", `${NAMES[one.tagName]}, scrolls sideways`);
    } else for (const name of ["tabindex", "role", "aria-label"]) one.removeAttribute(name);
  }
}

for (const one of document.querySelectorAll("p.caption[role=heading]")) one.ariaLevel = "2";
for (const one of document.querySelectorAll("details.hide > summary")) one.removeAttribute("aria-label");
// Signatures of several lines are lists of definitions in the markup, but define nothing.
for (const one of document.querySelectorAll("dt.sig dl")) {
  const lines = document.createElement("div");
  lines.className = "arguments";
  for (const line of one.children) {
    const plain = document.createElement("div");
    plain.append(...line.childNodes);
    lines.append(plain);
  }
  one.replaceWith(lines);
}
// A table whose last column is sentences is read row by row on a phone, every cell after the heading of its column.
for (const table of document.querySelectorAll("article table.docutils")) {
  const last = [...table.querySelectorAll("td:last-child")];
  if (!last.some((cell) => cell.textContent.length > SENTENCE)) continue;
  table.classList.add("of-words");
  const heads = [...table.querySelectorAll("thead th")].map((head) => head.textContent.trim());
  table.setAttribute("role", "table");
  for (const row of table.rows) {
    row.setAttribute("role", "row");
    [...row.cells].forEach((cell, place) => {
      cell.setAttribute("role", cell.tagName === "TH" ? "columnheader" : "cell");
      cell.dataset.head = heads[place] ?? "";
      cell.classList.toggle("without-words", !cell.textContent.trim());
    });
  }
}
document.querySelector(".sidebar-drawer")?.setAttribute("aria-label", "Manual");
document.querySelector(".toc-drawer")?.setAttribute("aria-label", "On this page");

reachable();
addEventListener("load", () => (window.MathJax?.startup?.promise ?? Promise.resolve()).then(reachable));
addEventListener("resize", reachable);
