"use strict";
// The address of the page holds what is seen: #t=0.6&paused&speed=2&cam=…&layers=…&runs=a,b&run=a&tab=velocity&theme=dark
// &hide=table&pin=cube&of=robot%20–%20scene&multiples&signals=[…]
const OptiPlanAddress = (() => {
  const numbers = (text) => text.split(",").map(Number);

  // What the address says, as `get` and `has` of URLSearchParams; `list` has names between commas, which may hold commas themselves.
  function parsed() {
    const text = (location.hash || location.search).slice(1), wish = new URLSearchParams(text);
    wish.list = (key) => text.split("&").filter((one) => one.startsWith(key + "=")).flatMap((one) => one.slice(key.length + 1).split(",")).filter(Boolean).map((one) => new URLSearchParams("=" + one).get(""));
    return wish;
  }

  const joined = (found) => found.map(encodeURIComponent).join();

  // Signals as the address holds them; one that cannot be read is none.
  function signals(text) {
    try { return JSON.parse(text).filter(({ kind, a }) => ["rate", "sum", "difference"].includes(kind) && typeof a === "string"); } catch { return []; }
  }

  // Does what the address says; what it does not mention stays as it is.
  function obey(app, wish = parsed()) {
    const { clock, scene, layers, dock, data } = app;
    if (wish.has("theme")) document.documentElement.dataset.theme = wish.get("theme") === "dark" ? "dark" : "light";
    if (wish.has("run")) app.select(Math.max(0, data.runs.findIndex((run) => run.label === wish.get("run"))));
    if (wish.has("runs")) {
      const names = wish.list("runs");
      data.runs.forEach((run, k) => { app.shown[k] = names.includes(run.label); if (app.shown[k]) app.robots[k] = true; });
      if (!wish.has("run")) app.select(Math.max(0, app.shown.indexOf(true)));
      app.update();
    }
    if (app.arrange && wish.has("arrange")) app.arrange(wish.get("arrange"));
    if (wish.has("signals")) dock.signal(signals(wish.get("signals")));
    if (wish.has("multiples")) { dock.multiples = true; dock.draw(); }
    if (wish.has("of")) dock.look(wish.get("of"));
    if (scene && (wish.has("hide") || wish.has("pin"))) app.picked.wish = { hidden: wish.list("hide"), pinned: wish.list("pin") };
    if (wish.has("tab") && [...dock.tabs.children].some((tab) => tab.dataset.name === wish.get("tab"))) dock.choose(wish.get("tab"));
    const panel = [...document.getElementById("panels").children].find((button) => button.dataset.panel === wish.get("panel"));
    if (panel) panel.click();
    if (wish.has("layers")) layers.wanted(wish.list("layers"));
    if (wish.has("speed")) clock.setSpeed(Number(wish.get("speed")));
    if (scene && wish.has("cam")) {
      const six = numbers(wish.get("cam"));
      if (six.length === 6 && six.every(Number.isFinite)) Object.assign(scene, { camera: six, turned: true });
    }
    if (wish.has("t") || wish.has("paused")) clock.playing = false;
    if (wish.has("t")) clock.seek(Number(wish.get("t")) || 0); else clock.tell();
    write(app);
    app.written = location.hash;
  }

  // Writes what is seen into the address, without an entry in the history.
  function write(app) {
    const { clock, scene, layers, dock, data } = app, parts = [];
    if (document.body.classList.contains("bare")) parts.push("scene");
    if (!clock.playing) parts.push(`t=${+clock.time.toFixed(4)}`, "paused");
    if (clock.speed !== 1) parts.push(`speed=${clock.speed}`);
    if (scene && scene.turned) parts.push(`cam=${scene.camera.map((x) => +x.toFixed(3)).join()}`);
    if (layers.wish) parts.push(`layers=${layers.wish.join()}`);
    if (data.runs.length > 1) parts.push(`run=${encodeURIComponent(data.runs[app.selected].label)}`);
    if (app.arrangement && app.arrangement.mode !== "together") parts.push(`arrange=${app.arrangement.mode}`);
    if (app.chosen) parts.push(`runs=${data.runs.filter((_, k) => app.shown[k]).map((run) => encodeURIComponent(run.label)).join()}`);
    if (dock.quantity !== (data.runs.length > 3 ? "table" : "velocity")) parts.push(`tab=${encodeURIComponent(dock.quantity)}`);
    if (scene && app.picked && app.picked.hidden.size) parts.push(`hide=${joined(app.picked.wish.hidden)}`);
    if (scene && app.picked && app.picked.pins.size) parts.push(`pin=${joined(app.picked.wish.pinned)}`);
    if (dock.run && dock.run.only) parts.push(`of=${encodeURIComponent(dock.run.only)}`);
    if (document.body.dataset.panel !== "card") parts.push(`panel=${document.body.dataset.panel}`);
    if (dock.multiples) parts.push("multiples");
    if (dock.signals.length) parts.push(`signals=${encodeURIComponent(JSON.stringify(dock.signals))}`);
    if (document.documentElement.dataset.theme) parts.push(`theme=${document.documentElement.dataset.theme}`);
    const hash = parts.length ? "#" + parts.join("&") : "";
    if (hash === location.hash) return;
    try { history.replaceState(null, "", hash || location.pathname + location.search); } catch { return; } // some frames forbid it
    app.written = location.hash;
  }

  return { parsed, obey, write };
})();
