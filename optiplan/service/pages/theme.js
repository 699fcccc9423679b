"use strict";
// Light or dark: as the system wishes, or as it was chosen here last.
(() => {
  const KEPT = "optiplan.theme", root = document.documentElement, kept = localStorage.getItem(KEPT);
  if (kept) root.dataset.theme = kept;
  document.getElementById("theme").addEventListener("click", () => {
    root.dataset.theme = getComputedStyle(root).colorScheme === "dark" ? "light" : "dark";
    localStorage.setItem(KEPT, root.dataset.theme);
    dispatchEvent(new Event("optiplan:theme"));
  });
})();
