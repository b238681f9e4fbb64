// What is wider than the window scrolls, and takes the focus so that it scrolls by keys too.

const WIDE = "pre, div.math, .table-wrapper, .cell_output .text_html, .highlight";
const NAMES = { PRE: "Code or output", DIV: "Table or formula" };

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

reachable();
addEventListener("load", () => (window.MathJax?.startup?.promise ?? Promise.resolve()).then(reachable));
addEventListener("resize", reachable);
