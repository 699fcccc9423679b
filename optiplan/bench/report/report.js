"use strict";
// Sorting: numbers by size, words by alphabet, what is not there always last.
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = Array.from(table.tHead.rows[0].cells);
  const rows = Array.from(table.tBodies[0].rows);
  heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => {
    // words begin at A, numbers at the largest; again turns it round
    const before = head.getAttribute("aria-sort");
    const words = head.classList.contains("words");
    const up = before ? before === "descending" : words;
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
    const key = (row) => row.cells[column].dataset.key;
    const compare = (a, b) => {
      const [x, y] = [key(a), key(b)];
      if (x === undefined || y === undefined) return (x === undefined) - (y === undefined);
      return (up ? 1 : -1) * (words ? x.localeCompare(y, undefined, { numeric: true }) : x - y);
    };
    table.tBodies[0].append(...rows.sort(compare));
  }));
}
// A planner pointed at is singled out in the figures.
for (const name of document.querySelectorAll(".planner")) {
  const lines = document.querySelectorAll(`figure svg [id$="-planner${name.dataset.planner}"]`);
  name.addEventListener("mouseenter", () => {
    document.body.classList.add("single");
    lines.forEach((line) => line.classList.add("chosen"));
  });
  name.addEventListener("mouseleave", () => {
    document.body.classList.remove("single");
    lines.forEach((line) => line.classList.remove("chosen"));
  });
}
// Copying, also from a file, where the clipboard's own interface may be shut.
for (const button of document.querySelectorAll(".copy")) {
  button.addEventListener("click", () => {
    const range = document.createRange();
    range.selectNodeContents(button.previousElementSibling);
    getSelection().removeAllRanges();
    getSelection().addRange(range);
    button.textContent = document.execCommand("copy") ? "copied" : "selected";
    setTimeout(() => { button.textContent = "copy"; }, 1500);
  });
}
document.getElementById("theme").addEventListener("click", () => {
  const root = document.documentElement;
  const dark = getComputedStyle(root).colorScheme === "dark";
  root.dataset.theme = dark ? "light" : "dark";
});
