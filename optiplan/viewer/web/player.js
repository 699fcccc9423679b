"use strict";
// The page: one clock, which scene, curves, verdict and slider share. What a test or a script needs is window.optiplan.
(() => {
  const byId = (id) => document.getElementById(id), { make } = OptiPlanCurves, { millimetres } = OptiPlanFacts;
  const data = JSON.parse(byId("data").textContent), wish = OptiPlanAddress.parsed();
  const several = data.runs.length > 1, crowd = data.runs.length > 3, anyVerified = data.runs.some((run) => run.badge === "verified" && run.duration);
  const lasting = (runs) => Math.max(0, ...runs.map((run) => run.duration || 0));
  // Of many runs those are shown first that are verified: a refused one of a minute would stretch the clock of all.
  const shownFirst = (run) => run.row.duration !== null && (!crowd || !anyVerified || run.badge === "verified");
  const duration = lasting(data.runs.filter(shownFirst).length ? data.runs.filter(shownFirst) : data.runs);
  const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const SLOW = 70, LEAST_SHARPNESS = 0.6; // ms a frame, and share of the screen's pixels that is drawn at the least

  if (wish.has("theme")) document.documentElement.dataset.theme = wish.get("theme") === "dark" ? "dark" : "light";

  document.body.classList.toggle("bare", wish.has("scene")); // nothing but the scene

  // A motion that was refused is played up to where bodies touch.
  function endOf(run) {
    const contact = run.clearance && run.clearance.contacts[0], witness = run.witnesses.find((one) => one.time !== undefined);
    if (!run.duration || run.badge === "verified" || !contact) return run.duration || duration;
    return Math.min(run.duration, Math.max(contact[0], witness && witness.time >= contact[0] ? witness.time : contact[0]));
  }

  function makeScene() {
    try {
      return new OptiPlanScene.Scene(data, byId("pane"));
    } catch (error) {
      byId("trouble").textContent = OptiPlanShapes.undrawn(error, "verdict and curves are here");
      byId("trouble").hidden = false;
      byId("pane").replaceChildren();
      return null;
    }
  }

  const scene = makeScene(), best = OptiPlanFacts.sorted(data.runs).find(([run]) => run.path);
  const first = best ? best[1] : 0, clock = new OptiPlanClock.Clock(duration, several ? duration : endOf(data.runs[0] || { witnesses: [] }));
  clock.playing = !clock.still && !calm;
  if (scene) scene.failures = [];

  const app = {
    data, scene, clock, selected: first, alone: null, chosen: false,
    shown: data.runs.map(shownFirst), robots: data.runs.map((_, k) => !crowd || k === first),
    colour: (k) => (scene ? scene.runs[k].colour : OptiPlanCurves.COLOURS[k % OptiPlanCurves.COLOURS.length]),
    joint(name) { if (scene) scene.lightJoint(name); },
    solo(k) { app.alone = k === null || k < 0 ? null : k; show(); },
    update() { app.chosen = true; timed(); show(); app.dock.draw(); app.changed(); },
    looked() { posed = null; pose(); },
    select, changed: () => OptiPlanAddress.write(app),
  };
  app.layers = new OptiPlanLayers.Layers(byId("layers"), () => { fillLegend(); app.changed(); });
  app.comparison = new OptiPlanComparison.Comparison(app);
  app.dock = new OptiPlanDock.Dock(app, byId("dock"));
  app.steps = new OptiPlanSteps.Steps(clock);

  // Whether a run is drawn, its path or its robot: in turn only the selected one.
  const mode = () => (app.arrangement ? app.arrangement.mode : "together");

  // Which runs are drawn: those that are ticked, or the one that is pointed at.
  function show() {
    if (!scene) return;
    const failed = data.runs[app.selected] && data.runs[app.selected].row.duration === null; // is looked at alone
    const alone = app.alone === null && failed ? app.selected : app.alone;
    scene.runs.forEach((run, k) => {
      const path = alone !== null ? k === alone : mode() === "turn" ? k === app.selected : app.shown[k] !== false, robot = alone === null ? path && (app.robots[k] !== false || mode() === "turn") : path;
      run.figure.bodies.slice(1).forEach((body) => { body.visible = robot; });
      run.figure.bodies[0].visible = mode() === "together" ? k === 0 : robot; // what is bolted down is the same in every figure
      run.objects.group.visible = robot && scene.layers.obstacle.visible && (!data.several || mode() !== "together" || k === app.selected);
      if (run.path) run.path.visible = path;
      if (run.ellipsoids) run.ellipsoids.group.visible = robot;
    });
    if (app.arrangement && app.arrangement.mode === "beside") app.arrangement.set("beside");
    scene.dirty();
  }

  // The clock of the runs that are shown, and what stands along it: ticks and steps of the one that is selected.
  function timed() {
    const run = data.runs[app.selected];
    if (!run) return;
    if (several) clock.last(mode() === "turn" ? run.duration || clock.duration : lasting(data.runs.filter((_, k) => app.shown[k] || k === app.selected)));
    clock.end = run.row.duration === null ? Math.min(clock.duration, endOf(run)) : several ? clock.duration : clock.end;
    OptiPlanTimeline.mark(clock, run, jump);
    app.steps.fill(run, OptiPlanTimeline.place);
  }

  // Position by straight line, orientation by slerp between the two samples around t; at the end each run rests.
  const quaternions = scene && [new MeshCat.THREE.Quaternion(), new MeshCat.THREE.Quaternion()];
  function setPose(run, t) {
    const [before, after] = quaternions;
    const x = run.duration ? Math.min(1, t / run.duration) * (run.samples - 1) : 0;
    const k = Math.min(Math.floor(x), Math.max(0, run.samples - 2)), part = run.samples > 1 ? x - k : 0;
    for (let j = 0; j < data.bodies; j++) {
      const a = 7 * (k * data.bodies + j), b = run.samples > 1 ? a + 7 * data.bodies : a, body = run.figure.bodies[j + 1];
      for (let i = 0; i < 3; i++) body.position.setComponent(i, run.poses[a + i] + part * (run.poses[b + i] - run.poses[a + i]));
      before.fromArray(run.poses, a + 3);
      after.fromArray(run.poses, b + 3);
      body.quaternion.slerpQuaternions(before, after, part);
    }
    run.objects.show(t);
    if (run.ellipsoids) run.ellipsoids.show(Math.round(x));
  }

  let posed = null;
  function pose() {
    if (!scene || posed === clock.time) return;
    posed = clock.time;
    for (const run of scene.runs) setPose(run, clock.time);
    scene.moveObstacles(clock.time);
    const run = data.runs[app.selected];
    scene.rod.show(run && run.clearance ? OptiPlanDock.nearest(run, clock.time) : null);
    scene.dirty();
  }

  function jump(check) {
    clock.jump(check.time);
    const name = OptiPlanVerdict.CURVES[check.name];
    if (name && [...app.dock.tabs.children].some((tab) => tab.dataset.name === name)) app.dock.choose(name);
    if (check.joint && check.name !== "contact") { app.dock.single(check.joint); app.joint(check.joint); }
  }

  function select(k) {
    app.selected = k;
    const run = data.runs[k];
    if (!run) return;
    timed();
    if (app.arrangement) app.arrangement.follow(k);
    byId("selected").hidden = !several;
    byId("selected").replaceChildren(run.label, OptiPlanVerdict.badge(run));
    OptiPlanVerdict.fill(byId("checked"), run, jump);
    app.comparison.mark();
    app.dock.fill();
    fillHead(run);
    if (scene) {
      for (const failure of scene.failures) failure.wanted = failure.run === scene.runs[k];
      OptiPlanFailure.only(scene.failures, (one) => one.wanted);
      const failure = scene.failures.find((one) => one.wanted && one.point);
      if (failure) failure.look(); else if (scene.looked) scene.frame();
      scene.looked = Boolean(failure);
      scene.rod.quiet = Boolean(failure);
      posed = null;
      pose();
      show();
    }
    app.changed();
  }

  // How several runs share the scene; in turn, the next begins where one ends.
  function arrange(wanted) {
    app.arrangement.set(wanted);
    clock.following = wanted !== "turn" ? null : () => {
      const order = app.comparison.order.filter(([run, k]) => run.row.duration !== null && app.shown[k]).map(([, k]) => k);
      if (!order.length) return false;
      select(order[(order.indexOf(app.selected) + 1) % order.length]);
      clock.seek(0);
      return true;
    };
    select(app.selected);
  }

  function fillHead(run) {
    const count = data.runs.filter((one) => one.badge === "verified").length;
    byId("verdict").replaceChildren(several ? make("span", "badge " + (count ? "good" : "bad"), `${count} of ${data.runs.length} verified`) : OptiPlanVerdict.badge(run));
    const said = several ? run.label + ": " : "", words = (name, value) => (name === "duration" ? value : name.startsWith("×") ? OptiPlanFacts.quality(Number(value), name.includes("stops")) : `${name} ${value}`);
    const facts = run.facts.map(([name, value]) => words(name, value));
    byId("key").textContent = said + (run.problems.length ? run.problems[0].split(":")[0].replaceAll("-", " ") : facts.slice(0, 3).join(" · ")); // the whole sentence stands below
    byId("key").title = byId("key").textContent;
    byId("origin").textContent = run.origin.join(" · ");
  }

  function fillLegend() {
    const seen = (layer) => scene !== null && scene.layers[layer].visible;
    const rows = [], add = (text, style, className = "") => { const row = make("span"), mark = make("i", className); Object.assign(mark.style, style); row.append(mark, text); rows.push(row); };
    if (seen("start")) add("start", { borderColor: OptiPlanScene.START }, "ring");
    if (data.goal && seen("goal")) add(data.runs.some((run) => run.path) ? "end" : "goal", { borderColor: OptiPlanScene.GOAL }, "ring");
    const moving = data.runs.filter((run) => run.path);
    if (moving.length === 1 && seen("path")) {
      const speed = OptiPlanDock.decoded(moving[0]).quantities.find((one) => one.name === "tool speed");
      const most = Math.max(...speed.series.map((one) => Math.max(...one.y)));
      add(`tool, 0 to ${most.toPrecision(3)} m/s`, { background: `linear-gradient(90deg, ${OptiPlanPaths.SPEEDS.join()})`, width: "44px" });
    }
    if (data.runs.some((run) => OptiPlanSteps.hasEvents(run))) add("attach, detach, tool", {}, "diamond");
    if (seen("rod") && moving.some((run) => run.clearance)) add("nearest points", { background: OptiPlanRod.COLOUR });
    byId("legend").replaceChildren(...rows);
  }

  // The browser may draw in software: while bodies move, pixels are saved until a frame is quick enough.
  let sharpness = 1, last = null, slow = 0, still = true;
  function sharpen(wanted) {
    if (wanted === sharpness) return;
    sharpness = wanted;
    scene.viewer.renderer.setPixelRatio(sharpness * Math.min(2, devicePixelRatio));
    scene.resize(byId("pane"));
  }

  function tick(now) {
    requestAnimationFrame(tick);
    const took = last === null ? 0 : now - last;
    last = now;
    clock.advance(Math.min(0.1, took / 1000));
    if (scene) {
      const drew = scene.draw();
      if (clock.playing) {
        still = false;
        slow = drew && took > SLOW ? slow + 1 : 0;
        if (slow > 4) { slow = 0; sharpen(Math.max(LEAST_SHARPNESS, sharpness * 0.8)); }
      } else if (!still) { still = true; sharpen(1); }
    }
    document.documentElement.dataset.ready = "1"; // the first picture is drawn
  }

  // Names of what is pointed at.
  function addTips() {
    const tip = scene.labels.add("", "tip"), pane = byId("pane");
    let asked = null;
    tip.visible = false;
    pane.addEventListener("pointermove", (event) => {
      if (event.buttons || event.pointerType !== "mouse" || clock.playing) { tip.visible = false; return; }
      clearTimeout(asked);
      asked = setTimeout(() => {
        const box = pane.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top, name = scene.bodyAt(x, y);
        tip.visible = name !== null;
        if (name !== null) {
          tip.element.textContent = name;
          tip.point.set((2 * x) / scene.width - 1, 1 - (2 * y) / scene.height, 0.5).unproject(scene.viewer.camera);
        }
        scene.viewer.set_dirty();
      }, 60);
    });
    pane.addEventListener("pointerleave", () => { clearTimeout(asked); tip.visible = false; scene.viewer.set_dirty(); });
  }

  function wireScene() {
    OptiPlanLayers.addAll(app.layers, scene, data, wish, show);
    scene.tool = scene.addTriad(scene.layers.frames, [0, 0, 0, 0, 0, 0, 1], 0.05);
    scene.frame();
    data.runs.forEach((run, k) => run.witnesses.forEach((witness) => scene.failures.push(new OptiPlanFailure.Failure(scene, scene.runs[k], witness))));
    scene.beforeDrawing = () => { for (const failure of scene.failures) failure.update(); app.picked.update(); placeTool(); };
    const { controls } = scene.viewer;
    controls.addEventListener("change", () => { scene.viewer.set_dirty(); });
    controls.addEventListener("end", () => { scene.turned = true; app.changed(); });
    new ResizeObserver(() => scene.resize(byId("pane"))).observe(byId("pane"));
    addTips();
    app.picked = new OptiPlanPicked.Picked(scene, byId("pane"), byId("hidden"), () => app.changed(), () => scene.runs[app.selected] || scene.runs[0]);
  }

  function placeTool() {
    if (!scene.layers.frames.visible || !data.tool) return;
    const run = scene.runs[app.selected] || scene.runs[0], body = run.figure.bodies[data.tool.body], { THREE } = MeshCat;
    const X = new THREE.Matrix4().compose(body.position, body.quaternion, new THREE.Vector3(1, 1, 1));
    const own = new THREE.Matrix4().compose(new THREE.Vector3(...data.tool.pose.slice(0, 3)), new THREE.Quaternion(...data.tool.pose.slice(3)), new THREE.Vector3(1, 1, 1));
    X.multiply(own).decompose(scene.tool.position, scene.tool.quaternion, new THREE.Vector3());
    scene.tool.position.add(run.figure.position);
  }

  function home() {
    if (!scene) return;
    scene.turned = false;
    const failure = scene.failures.find((one) => one.wanted && one.point);
    if (failure) failure.look(); else scene.frame();
    posed = null;
    pose();
    app.changed();
  }

  function recolour() {
    if (scene) { scene.stage.colour(); scene.dirty(); }
    app.dock.redraw();
  }

  function toggleTheme() {
    const dark = OptiPlanCurves.css("color-scheme") === "dark" || getComputedStyle(document.documentElement).colorScheme === "dark";
    document.documentElement.dataset.theme = dark ? "light" : "dark";
    recolour();
    app.changed();
  }

  async function film() {
    const button = byId("film");
    button.disabled = true;
    try {
      return await OptiPlanPictures.film(app, (share) => { button.textContent = Math.round(100 * share) + " %"; });
    } catch (error) {
      byId("note").textContent = error.message;
      byId("note").hidden = false;
      return null;
    } finally {
      button.disabled = false;
      button.textContent = "Film";
    }
  }

  const KEYS = {
    " ": () => clock.toggle(),
    ArrowLeft: () => clock.jump(clock.time - 0.02),
    ArrowRight: () => clock.jump(clock.time + 0.02),
    ArrowUp: () => clock.step(1),
    ArrowDown: () => clock.step(-1),
    Home: () => clock.seek(0),
    End: () => clock.seek(clock.duration),
    0: home,
    p: () => scene && OptiPlanPictures.picture(app),
  };
  addEventListener("keydown", (event) => {
    const { tagName, type } = event.target, slider = tagName === "INPUT" && type === "range";
    const typing = tagName === "SELECT" || (event.key === " " && ["BUTTON", "SUMMARY"].includes(tagName)) || (event.key === " " && tagName === "INPUT" && !slider);
    if (typing || event.ctrlKey || event.metaKey || event.altKey || !KEYS[event.key]) return;
    event.preventDefault();
    KEYS[event.key]();
  });

  for (const button of byId("panels").children) {
    button.addEventListener("click", () => {
      document.body.dataset.panel = button.dataset.panel;
      for (const one of byId("panels").children) one.setAttribute("aria-pressed", String(one === button));
      app.changed();
    });
  }
  byId("theme").addEventListener("click", toggleTheme);
  byId("home").addEventListener("click", home);
  byId("picture").addEventListener("click", () => scene && OptiPlanPictures.picture(app));
  byId("film").addEventListener("click", film);
  for (const id of ["home", "picture", "film"]) byId(id).hidden = !scene;
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour);
  byId("note").textContent = data.note;
  byId("note").hidden = !data.note;
  byId("work").classList.toggle("plain", !data.runs.some((run) => run.curves));

  OptiPlanTimeline.wire(clock);
  if (scene) wireScene();
  byId("runs").hidden = !several;
  if (several) app.comparison.fillList(byId("runs"));
  if (several && scene) {
    app.arrangement = new OptiPlanArrangement.Arrangement(scene, (k) => app.shown[k] !== false && data.runs[k].row.duration !== null);
    const label = make("label", "field arrangement", "Play "), choice = make("select");
    for (const [name, words] of OptiPlanArrangement.MODES) choice.append(new Option(words, name));
    choice.addEventListener("change", () => arrange(choice.value));
    label.append(choice);
    byId("runs").prepend(label);
    app.arrange = (wanted) => { if (OptiPlanArrangement.MODES.some(([name]) => name === wanted)) arrange(choice.value = wanted); }; // an address may say anything
  }
  if (data.runs.length) select(app.selected); else byId("dock").hidden = true;
  clock.listen(pose);
  let playing = null;
  clock.listen(() => { if (!clock.playing && playing !== clock.time) app.changed(); playing = clock.playing ? null : clock.time; });
  OptiPlanAddress.obey(app, wish);
  fillLegend();
  addEventListener("hashchange", () => { if (location.hash !== app.written) { OptiPlanAddress.obey(app); fillLegend(); } });
  if (!location.hash && !scene) clock.pause();
  requestAnimationFrame(tick);

  // Scripts draw into a page that is served; the words of a message stand where the note does.
  const told = (words) => { byId("note").textContent = words || data.note; byId("note").hidden = !byId("note").textContent; };
  if (scene && data.drawn) {
    app.drawing = new OptiPlanDrawing.Drawing(scene, data.drawn.messages, told);
    if (data.drawn.address && location.protocol.startsWith("http")) app.drawing.listen(data.drawn.address);
  }

  const poses = () => scene.runs.map((run) => run.figure.bodies.slice(1).map((b) => [...b.position.toArray(), ...b.quaternion.toArray()]));
  window.optiplan = { app, scene, clock, state: clock, get duration() { return clock.duration; }, play: () => clock.play(), pause: () => clock.pause(), seek: (t) => clock.seek(t), poses, film, picture: () => OptiPlanPictures.picture(app) };
})();
