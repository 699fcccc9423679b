"use strict";
// A motion that is executed: its states are drawn as they come; speed, stop and obstacles that are dragged are sent back.
(() => {
  const { byId, make, post, get, tried, latest } = Page, KNOBS = ["stop", "pause", "resume", "reverse"], STALE = 1000, STILL = 120, LEASE = 3; // ms, ms, s
  const live = { id: null, events: null, last: null, states: 0, heard: 0, strips: null, motion: -1, seen: [], drawn: null, turns: 0, sent: null };
  const LEASED = "optiplan.lease"; // the execution that goes on only while this tab is there
  let motions = {};

  const scene = StudioScene.begin(byId("pane"), { moving: (name, pose) => carried(name, pose), obstacle: (name) => carried(name, null) });

  function say(word, reason, look = word) {
    byId("state").className = "badge " + look;
    byId("state").textContent = word;
    byId("reason").textContent = reason;
  }

  // Sends what was asked for; a refusal is shown.
  async function send(what, data = {}) {
    if (!live.id) return;
    try {
      const answer = await post(`api/executions/${live.id}/${what}`, data);
      if (answer.status >= 400) byId("hint").textContent = `${what}: ${answer.data.error}`;
    } catch { byId("hint").textContent = `${what}: the server does not answer`; }
  }
  const override = latest((speed) => send("override", { speed }));
  const obstacles = latest((data) => send("obstacles", data));

  // An obstacle in the hand: where it is, and how fast, from its last places; let go of or held still it stands.
  function carried(name, pose) {
    clearTimeout(live.still);
    const now = performance.now();
    if (pose) live.seen = [...live.seen.filter((one, k) => one.name === name && now - one.time < (k === live.seen.length - 1 ? 4 : 1) * STILL), { name, pose, time: now }];
    const last = live.seen.at(-1), first = live.seen[0];
    if (!last) return;
    const seconds = (last.time - first.time) / 1000, velocity = pose && seconds > 0.02 ? [0, 1, 2].map((k) => (last.pose[k] - first.pose[k]) / seconds) : [0, 0, 0];
    obstacles({ poses: { [name]: last.pose }, velocities: { [name]: velocity } });
    if (pose) live.still = setTimeout(() => carried(name, null), STILL);
  }

  // What an answer draws: the scene, and its motion where there is one.
  function shown(data) {
    scene.show({ ...data.scene, targets: [] }, null);
    if (data.scene.runs.length) scene.motion(data.scene.runs[0]);
    const movable = scene.obstacles.children.some((one) => !one.userData.fixed);
    byId("hint").textContent = scene.missing ? "" : movable ? "Drag obstacles, with shift up and down." : "This scene has no obstacle to drag.";
  }

  // A motion that can be chosen, under a name of its own: what asks for it.
  function offer(name, label, asked, first = false) {
    if (!motions[name]) byId("motion")[first ? "prepend" : "append"](make("option", { value: name, textContent: label }));
    motions[name] = asked;
  }

  // The motion of an execution, to be started again.
  function choose({ id, name, run }) {
    offer(run || id, name + ", as last", run ? { run } : { execution: id }, true);
    byId("motion").value = run || id;
  }

  // Whether what is about to be drawn is still the last that was wanted.
  function wanted() {
    const mine = live.drawn = {};
    return () => live.drawn === mine;
  }

  // The motion of an execution, also of one that has ended.
  async function show(id) {
    const answer = await tried(`api/executions/${id}/scene`, wanted());
    if (!answer) return;
    if (answer.data.scene) shown(answer.data);
    else byId("hint").textContent = "What is drawn may be of another motion: " + answer.data.error;
    if (live.last) place(live.last);
  }

  // The motion that is chosen, before it begins.
  const preview = latest(async () => {
    if (live.id) return;
    const { run, problem, execution } = motions[byId("motion").value], last = wanted();
    const answer = await (problem ? post("api/scene", { problem }) : tried(run ? `api/runs/${run}/scene` : `api/executions/${execution}/scene`, last, 1)).catch(() => null);
    if (!answer || !last()) return;
    if (answer.data.scene) shown(answer.data); else byId("hint").textContent = "This motion cannot be drawn: " + answer.data.error;
  });

  async function begin() {
    byId("begin").disabled = true;
    try {
      const asked = { ...motions[byId("motion").value], driver: byId("driver").value, override: byId("speed").value / 100 };
      if (byId("lease").checked) asked.lease = LEASE;
      say("starting", "the motion is verified, a process and its driver start", "running");
      const { status, data } = await post("api/executions", asked);
      if (status !== 201) { say("refused", data.error, "failed"); return; }
      choose(data);
      if (asked.lease) try { sessionStorage.setItem(LEASED, data.id); } catch { /* a reload then stops the robot */ }
      await watch(data);
    } catch { say("refused", "the server does not answer", "failed"); } finally { byId("begin").disabled = live.id !== null; }
  }

  // Watches an execution; `about` is the server's answer about it.
  async function watch(about) {
    const { id, joint_names: names, velocity_limits: limits } = about;
    if (live.events) live.events.close();
    if (live.strips) live.strips.destroy();
    const speed = { title: "speed along the path", unit: "of the planned", axis: [-1.1, 1.1], series: [{ name: "now", low: -1, high: 1, colour: "--accent", width: 2 }, { name: "wanted", dash: [4, 4], step: true, colour: "--soft" }], values: (state) => [state.speed, state.override] };
    byId("save").href = `api/executions/${id}/recording.zip`;
    live.strips = new Strips.Strips(byId("strips"), [speed, Strips.joints(names, limits)]);
    const events = Page.stream(`api/executions/${id}/events`, { state: draw, end: ({ reason }) => ended(reason) }, () => again(id));
    Object.assign(live, { id, last: null, states: 0, heard: performance.now(), motion: 0, events });
    history.replaceState(null, "", "#" + id);
    for (const knob of KNOBS) byId(knob).disabled = false;
    byId("begin").disabled = byId("lease").disabled = true;
    byId("lease").checked = Boolean(about.lease) && leased() === id;
    await show(id);
  }

  function leased() { try { return sessionStorage.getItem(LEASED); } catch { return live.id; } }

  // The stream is closed for good: the server came back without it, or refuses.
  async function again(id) {
    if (live.id !== id) return;
    const found = await get("api/executions/" + id);
    if (live.id !== id) return;
    if (!found || found.ended !== null) ended(found ? found.ended : "the server does not know it any more");
    else watch(found);
  }

  function ended(reason) {
    if (live.events) live.events.close();
    Object.assign(live, { id: null, events: null });
    for (const knob of KNOBS) byId(knob).disabled = true;
    byId("begin").disabled = byId("lease").disabled = false;
    byId("right").classList.remove("stale");
    say("ended", reason, reason === "done" ? "verified" : "refused");
  }

  const LOOKS = { running: "verified", done: "verified", waiting: "failed", stopping: "failed", stopped: "failed" };

  // Puts what is drawn where a state says; a scene of another robot stays as it is until that of this one has come.
  function place(state) {
    if (!scene.data || scene.data.bodies !== state.poses.length) return;
    scene.pose(state.poses);
    scene.move(state.obstacles);
    scene.at(state.place);
    scene.touching(new Set(state.blocked_by || []));
  }

  function draw(state) {
    live.last = state;
    live.states++;
    live.heard = performance.now();
    byId("right").classList.remove("stale");
    say(state.phase, state.reason, LOOKS[state.phase] || "running");
    if (!live.turned) byId("speed").value = Math.round(100 * state.override);
    byId("wanted").textContent = Math.round(100 * state.override) + " %";
    byId("progress").value = state.progress;
    byId("share").textContent = `${(100 * state.progress).toFixed(0)} %, ${state.place.toFixed(2)} s of the path`;
    byId("now").textContent = (100 * state.speed).toFixed(0) + " % of the planned";
    byId("off").textContent = state.deviation === null ? "not measured" : `at most ${(1000 * state.deviation).toFixed(3)} mrad or mm`;
    const ms = (x) => (1000 * x).toFixed(2);
    byId("late").textContent = `${ms(state.lateness.p50)} / ${ms(state.lateness.p99)} / ${ms(state.lateness.max)} ms`;
    byId("missed").textContent = `${state.missed}, at ${state.rate} a second`;
    byId("time").textContent = state.t.toFixed(1) + " s";
    live.strips.add(state);
    byId("save").hidden = false;
    place(state);
    if (state.motion !== live.motion) { live.motion = state.motion; if (live.states > 1) show(live.id); }
  }

  // States come 25 times a second; where none comes, what is drawn is old.
  function look() {
    const silent = performance.now() - live.heard;
    if (!live.id || silent < STALE) return;
    byId("right").classList.add("stale");
    say("stale", `no news for ${(silent / 1000).toFixed(0)} s: what is drawn is old. The robot goes on or has stopped; this page tries to reach it.`, "failed");
  }

  async function open() {
    const [{ executions, drivers }, { runs }, examples] = await Promise.all([get("api/executions"), get("api/runs?limit=60"), get("api/examples")]);
    byId("driver").append(...drivers.map((name) => make("option", { value: name, textContent: name })));
    const named = location.hash.slice(1), [, wanted] = named.split("run=");
    for (const run of runs.filter((one) => one.verified)) offer(run.id, `${run.name} · ${run.planner} · ${run.duration.toFixed(2)} s`, { run: run.id });
    for (const [name, problem] of Object.entries(examples)) offer(name, "plan " + name, { problem, budget: 10 });
    if (wanted) offer(wanted, "the chosen run", { run: wanted }, true);
    byId("motion").value = wanted || (motions["02_shelf"] ? "02_shelf" : Object.keys(motions)[0]);
    const found = executions.find((one) => one.id === named) || executions.find((one) => one.ended === null); // one that runs is watched by all who come
    if (found && !wanted) {
      choose(found);
      await watch(found);
      if (found.ended !== null) ended(found.ended);
    } else await preview();
    window.optiplanExecution.ready = true;
  }

  byId("begin").addEventListener("click", begin);
  byId("motion").addEventListener("change", () => { if (!live.id) preview(); });
  for (const knob of KNOBS) byId(knob).addEventListener("click", () => send(knob));
  byId("speed").addEventListener("input", () => {
    byId("wanted").textContent = byId("speed").value + " %";
    live.turned = true; // what the robot says of its speed does not move the slider in the hand
    live.turns++;
    live.sent = override(byId("speed").value / 100);
  });
  for (const end of ["change", "pointerup", "pointercancel", "blur"]) byId("speed").addEventListener(end, async () => { // nor before the robot knows of it
    const { turns } = live;
    await live.sent;
    if (turns === live.turns) live.turned = false;
  });
  setInterval(look, 500);
  setInterval(() => { if (live.id && byId("lease").checked) send("alive"); }, (1000 * LEASE) / 3);
  window.optiplanExecution = { scene, live };
  open();
})();
