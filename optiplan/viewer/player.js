"use strict";
// The player: time, keys, layers. Everything a test or a script needs is in window.optiplan.
(() => {
  const THREE = MeshCat.THREE, byId = (id) => document.getElementById(id);
  const data = JSON.parse(byId("data").textContent);
  const wish = new URLSearchParams((location.hash || location.search).slice(1)); // #t=0.6&paused&speed=2&view=collision
  const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4], REST = 0.7; // s of standing at the end before the motion loops

  function make(tag, className, text) {
    const element = document.createElement(tag);
    if (className) element.className = className;
    if (text !== undefined) element.textContent = text;
    return element;
  }

  let scene;
  try {
    scene = new OptiPlanScene.Scene(data, byId("pane"));
  } catch (error) {
    byId("trouble").textContent = "This page needs WebGL, which this browser does not offer: " + error.message;
    byId("trouble").hidden = false;
    return;
  }
  const duration = Math.max(0, ...scene.runs.map((run) => run.duration));
  const still = duration === 0;
  const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const state = { time: 0, speed: 1, playing: !still && !calm, loop: true, waited: 0 };

  // Position by straight line, orientation by slerp between the two samples around t; at the end each run rests.
  const before = new THREE.Quaternion(), after = new THREE.Quaternion();
  function setPose(run, t) {
    const x = run.duration ? Math.min(1, t / run.duration) * (run.samples - 1) : 0;
    const k = Math.min(Math.floor(x), Math.max(0, run.samples - 2)), part = run.samples > 1 ? x - k : 0;
    for (let j = 0; j < data.bodies; j++) {
      const a = 7 * (k * data.bodies + j), b = run.samples > 1 ? a + 7 * data.bodies : a, body = run.figure.bodies[j + 1];
      for (let i = 0; i < 3; i++) body.position.setComponent(i, run.poses[a + i] + part * (run.poses[b + i] - run.poses[a + i]));
      before.fromArray(run.poses, a + 3);
      after.fromArray(run.poses, b + 3);
      body.quaternion.slerpQuaternions(before, after, part);
    }
    if (run.ellipsoids) run.ellipsoids.show(Math.round(x));
  }

  function show() {
    for (const run of scene.runs) setPose(run, state.time);
    byId("scrub").value = duration ? state.time / duration : 0;
    byId("scrub").setAttribute("aria-valuetext", state.time.toFixed(2) + " s");
    byId("clock").textContent = state.time.toFixed(2) + " / " + duration.toFixed(2) + " s";
    byId("play").setAttribute("aria-pressed", String(state.playing));
    scene.viewer.set_dirty();
  }

  function seek(t) { state.time = Math.min(duration, Math.max(0, t)); state.waited = 0; show(); }
  function pause() { state.playing = false; show(); }
  function play() {
    if (still) return;
    if (state.time >= duration) seek(0);
    state.playing = true;
    show();
  }
  const toggle = () => (state.playing ? pause() : play());

  function advance(dt) {
    if (state.time < duration) state.time = Math.min(duration, state.time + dt * state.speed);
    else if (!state.loop) state.playing = false;
    else if ((state.waited += dt) > REST) { state.time = 0; state.waited = 0; }
    show();
  }

  let last = null;
  function tick(now) {
    requestAnimationFrame(tick);
    if (state.playing && last !== null) advance(Math.min(0.1, (now - last) / 1000));
    last = now;
    if (scene.viewer.needs_render) scene.viewer.render();
    document.documentElement.dataset.ready = "1"; // the first picture is drawn
  }

  function setSpeed(speed) { state.speed = speed; byId("speed").value = String(speed); }

  // Of many runs only the best one's robot is drawn at first, and all paths; what failed waits to be looked at.
  const several = data.runs.length > 1, crowd = data.runs.length > 3, first = Math.max(0, data.runs.findIndex((run) => run.path));

  function checkbox(checked, title) {
    const box = make("input");
    box.type = "checkbox";
    box.checked = checked;
    box.title = title;
    return box;
  }

  function addRunCard(run, k) {
    const card = make("div", "run"), label = make("label"), shown = scene.runs[k];
    const moves = Boolean(run.path), box = checkbox(moves || !crowd, "Show this run"), robot = checkbox(!crowd || k === first, "Show its robot");
    const update = () => {
      const bodies = box.checked && robot.checked;
      shown.figure.bodies.slice(1).forEach((body) => { body.visible = bodies; }); // what is bolted down stays
      if (shown.path) shown.path.visible = box.checked;
      if (shown.ellipsoids) shown.ellipsoids.group.visible = bodies;
      shown.witness.visible = box.checked;
      scene.viewer.set_dirty();
    };
    box.addEventListener("change", update);
    robot.addEventListener("change", update);
    const swatch = make("span", "swatch");
    swatch.style.background = moves || !crowd ? shown.colour : "none";
    const kind = { verified: "good", executed: "good", "not checked": "open" }[run.badge] || "bad";
    label.append(box, swatch, make("span", "name", run.label));
    if (several && moves) label.append(make("span", "time", run.duration.toFixed(2) + " s"));
    label.append(make("span", "badge " + kind, run.badge));
    const facts = make("dl");
    for (const [name, value] of run.facts) facts.append(make("dt", "", name), make("dd", "", value));
    const told = [facts, ...run.problems.map((text) => make("p", "problem", text))];
    if (run.scope.length) {
      const about = make("details", "more"), list = make("ul");
      list.append(...run.scope.map((text) => make("li", "", text)));
      about.append(make("summary", "", "what the verdict is about"), list);
      told.push(about);
    }
    card.append(label);
    if (several) {
      const choice = make("label", "robot");
      choice.append(robot, "robot");
      card.append(choice);
    }
    if (crowd) {
      const more = make("details", "more");
      more.append(make("summary", "", moves ? "results" : "why"), ...told);
      card.append(more);
    } else card.append(...told);
    byId("runs").append(card);
    update();
  }

  function switchSets(view) {
    for (const run of scene.runs) {
      run.figure.traverse((o) => { if (["visual", "collision"].includes(o.userData.set)) o.visible = o.userData.set === view; });
    }
  }

  function addLayer(name, text, checked, change) {
    const label = make("label"), box = make("input");
    box.type = "checkbox";
    box.id = "layer-" + name;
    box.checked = checked;
    box.addEventListener("change", () => { change(box.checked); scene.viewer.set_dirty(); });
    label.append(box, text);
    byId("layers").append(label);
    change(checked);
  }

  function seeThrough(on) {
    for (const mesh of scene.layers.obstacle.children) {
      if (mesh.userData.plane) continue;
      mesh.material.transparent = on;
      mesh.material.opacity = on ? 0.3 : 1;
      mesh.material.depthWrite = !on;
    }
  }

  const layer = (name) => (on) => { scene.layers[name].visible = on; };
  if (scene.layers.obstacle.children.length) {
    addLayer("obstacles", "Obstacles", true, layer("obstacle"));
    addLayer("through", "See-through", wish.has("through"), seeThrough);
  }
  if (scene.layers.path.children.length) addLayer("path", "Tool path", true, layer("path"));
  addLayer("start", "Start", wish.get("ghosts") !== "0", layer("start"));
  if (scene.layers.goal.children.length) addLayer("goal", "Goal", wish.get("ghosts") !== "0", layer("goal"));
  if (data.parts.some((part) => part.set === "collision")) addLayer("collision", "Collision shape", wish.get("view") === "collision", (on) => switchSets(on ? "collision" : "visual"));
  addLayer("floor", "Floor", true, (on) => { scene.floor.visible = on; });
  if (scene.layers.ellipsoids.children.length) {
    addLayer("ellipsoids", "Ellipsoids", wish.has("ellipsoids"), layer("ellipsoids"));
    byId("layer-ellipsoids").parentElement.title = "Of the tool: how fast it moves (green) and how hard it pushes (red) for the same effort of all joints, in each direction";
  }
  if (data.runs.some((run) => run.witnesses.length)) addLayer("witness", "Where it failed", true, layer("witness"));
  data.runs.forEach(addRunCard);
  byId("note").textContent = data.note;
  byId("note").hidden = !data.note;
  if (innerWidth < 620 || innerHeight < 420) byId("card").open = false;

  for (const speed of SPEEDS) byId("speed").append(new Option(speed + "×", String(speed)));
  byId("speed").addEventListener("change", (event) => setSpeed(Number(event.target.value)));
  byId("loop").addEventListener("change", (event) => { state.loop = event.target.checked; });
  byId("scrub").addEventListener("input", (event) => { state.playing = false; seek(Number(event.target.value) * duration); });
  byId("play").addEventListener("click", toggle);
  byId("home").addEventListener("click", () => scene.frame());
  byId("play").disabled = byId("scrub").disabled = still;

  const KEYS = {
    " ": toggle,
    ArrowLeft: () => { pause(); seek(state.time - 0.02); },
    ArrowRight: () => { pause(); seek(state.time + 0.02); },
    ArrowUp: () => setSpeed(SPEEDS[Math.min(SPEEDS.length - 1, SPEEDS.indexOf(state.speed) + 1)]),
    ArrowDown: () => setSpeed(SPEEDS[Math.max(0, SPEEDS.indexOf(state.speed) - 1)]),
    Home: () => seek(0),
    End: () => seek(duration),
    0: () => scene.frame(),
  };
  addEventListener("keydown", (event) => {
    const typing = ["SELECT", "SUMMARY"].includes(event.target.tagName) || (event.key === " " && ["INPUT", "BUTTON"].includes(event.target.tagName));
    if (typing || event.ctrlKey || event.metaKey || event.altKey || !KEYS[event.key]) return;
    event.preventDefault();
    KEYS[event.key]();
  });

  byId("card").addEventListener("toggle", () => scene.resize(byId("pane")));
  new ResizeObserver(() => scene.resize(byId("pane"))).observe(byId("pane"));
  setSpeed(SPEEDS.includes(Number(wish.get("speed"))) ? Number(wish.get("speed")) : 1);
  if (wish.has("t") || wish.has("paused")) state.playing = false;
  scene.frame();
  seek(Number(wish.get("t")) || 0);
  requestAnimationFrame(tick);
  const poses = () => scene.runs.map((run) => run.figure.bodies.slice(1).map((b) => [...b.position.toArray(), ...b.quaternion.toArray()]));
  window.optiplan = { scene, state, duration, play, pause, seek, poses };
})();
