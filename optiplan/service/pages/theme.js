"use strict";
// Light or dark: as the system wishes, or as it was chosen here last.
(() => {
  const KEPT = "optiplan.theme", root = document.documentElement;
  const storage = (act) => { try { return act(localStorage); } catch { return null; } }; // some browsers keep nothing
  const kept = storage((all) => all.getItem(KEPT));
  if (kept) root.dataset.theme = kept;
  document.getElementById("theme").addEventListener("click", () => {
    root.dataset.theme = getComputedStyle(root).colorScheme === "dark" ? "light" : "dark";
    storage((all) => all.setItem(KEPT, root.dataset.theme));
    dispatchEvent(new Event("optiplan:theme"));
  });
})();
