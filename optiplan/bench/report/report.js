"use strict";
// Sorting: numbers by size, words by alphabet, what is not there always last.
function sortable(table) {
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
const linesOf = (k) => document.querySelectorAll(`figure svg [id$="-planner${k}"]`);
function pointed(name) {
  name.addEventListener("mouseenter", () => {
    document.body.classList.add("single");
    for (const line of linesOf(name.dataset.planner)) line.classList.add("chosen");
  });
  name.addEventListener("mouseleave", () => {
    document.body.classList.remove("single");
    for (const line of linesOf(name.dataset.planner)) line.classList.remove("chosen");
  });
}
// Makes new parts of the page work.
function prepare(root) {
  root.querySelectorAll("table.sortable").forEach(sortable);
  root.querySelectorAll(".planner").forEach(pointed);
  showPlanners();
}
// Parts that are not seen at first come packed: sets, problems, pairs.
async function unpack(place) {
  const text = place.dataset.packed;
  if (!text) return;
  delete place.dataset.packed;
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const plain = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  place.insertAdjacentHTML("beforeend", await new Response(plain).text());
  prepare(place);
}
for (const place of document.querySelectorAll("details[data-packed]")) place.addEventListener("toggle", () => unpack(place));
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
  for (const view of document.querySelectorAll("[data-view]")) {
    view.hidden = view.dataset.view !== chosen;
    if (!view.hidden) unpack(view);
  }
  for (const part of document.querySelectorAll("[data-set]")) part.hidden = chosen !== "" && part.dataset.set !== chosen;
}
if (sets) sets.addEventListener("change", showSet);
const shows = [...document.querySelectorAll("[data-show]")];
function showPlanner(box) {
  const k = box.dataset.show, parts = [...document.querySelectorAll(`[data-column="${k}"]`), ...linesOf(k)];
  for (const name of document.querySelectorAll(`td .planner[data-planner="${k}"]`)) parts.push(name.closest("tr"));
  for (const part of parts) part.classList.toggle("off", !box.checked);
}
function showPlanners() {
  for (const box of shows) if (!box.checked) showPlanner(box);
}
for (const box of shows) box.addEventListener("change", () => showPlanner(box));
prepare(document);
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
