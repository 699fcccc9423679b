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
// Filters: a set chooses its own tables and figures and the rows of its problems; planners are rows, columns and lines.
const sets = document.getElementById("set");
function showSet() {
  const chosen = sets ? sets.value : "";
  for (const view of document.querySelectorAll("[data-view]")) view.hidden = view.dataset.view !== chosen;
  for (const part of document.querySelectorAll("[data-set]")) part.hidden = chosen !== "" && part.dataset.set !== chosen;
}
if (sets) sets.addEventListener("change", showSet);
for (const box of document.querySelectorAll("[data-show]")) {
  const k = box.dataset.show;
  box.addEventListener("change", () => {
    const parts = [...document.querySelectorAll(`[data-column="${k}"]`), ...document.querySelectorAll(`figure svg [id$="-planner${k}"]`)];
    for (const name of document.querySelectorAll(`td .planner[data-planner="${k}"]`)) parts.push(name.closest("tr"));
    for (const part of parts) part.classList.toggle("off", !box.checked);
  });
}
// Comparison of what is ticked, of one problem at a time.
const bar = document.getElementById("compare");
for (const pick of document.querySelectorAll(".pick")) pick.addEventListener("change", () => compare(pick));
function compare(last) {
  const row = last && last.closest("tr");
  for (const other of document.querySelectorAll(".pick:checked")) if (other.closest("tr") !== row) other.checked = false;
  const picked = row ? [...row.querySelectorAll(".pick:checked")] : [];
  bar.hidden = picked.length === 0;
  if (bar.hidden) return;
  const open = document.getElementById("compare-open"), labels = picked.map((pick) => pick.dataset.run);
  open.textContent = picked.length > 1 ? `compare these ${picked.length} on ${row.dataset.problem}` : `open ${labels[0]} on ${row.dataset.problem}`;
  open.hidden = !row.dataset.page;
  if (row.dataset.page) open.href = `${row.dataset.page}#runs=${labels.map(encodeURIComponent).join(",")}`;
  const quote = (text) => (/^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", `'"'"'`)}'`);
  const runs = picked.map((pick) => JSON.parse(pick.dataset.actual)); // folder, label there, seed, repetition
  const same = runs.filter((run) => [0, 2, 3].every((k) => run[k] === runs[0][k])), [folder, , seed, repetition] = runs[0];
  const words = ["optiplan", "bench", "show", folder, row.dataset.problem, same.map((run) => run[1]).join(","), seed, repetition];
  bar.querySelector("code").textContent = words.map((word) => quote(String(word))).join(" ");
}
document.getElementById("compare-clear").addEventListener("click", () => compare(null));
// Tips that fingers and keys can reach, too.
const tip = document.getElementById("tip");
for (const place of document.querySelectorAll("[data-tip]")) {
  const show = () => {
    tip.textContent = place.dataset.tip;
    tip.hidden = false;
    const at = place.getBoundingClientRect(), own = tip.getBoundingClientRect();
    tip.style.left = `${Math.max(4, Math.min(at.left, innerWidth - own.width - 4))}px`;
    tip.style.top = `${at.bottom + own.height + 8 < innerHeight ? at.bottom + 4 : Math.max(4, at.top - own.height - 4)}px`;
  };
  const hide = () => { tip.hidden = true; };
  place.addEventListener("pointerenter", show);
  place.addEventListener("focus", show);
  place.addEventListener("pointerleave", hide);
  place.addEventListener("blur", hide);
}
addEventListener("keydown", (event) => { if (event.key === "Escape") tip.hidden = true; });
