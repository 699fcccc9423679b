"use strict";
// A controller that runs on the server: its states are drawn as they come, and the frame that is dragged is its target.
(() => {
  const { byId, make, post, get, latest } = Page, HOLDS = "clearance: "; // how the controller names the bodies that hold it back
  const live = { id: null, events: null, last: null, first: null, states: 0, strips: null };
  let examples = {};

  const aim = latest(async (pose) => {
    if (!live.id) return;
    const { status } = await post(`api/live/${live.id}/target`, { pose });
    if (status === 404) ended("it has ended");
  });
  const scene = StudioScene.begin(byId("pane"), { goal: (pose) => aim(pose) });

  function say(word, reason, look = word) {
    byId("state").className = "badge " + look;
    byId("state").textContent = word;
    byId("reason").textContent = reason;
  }

  async function show(problem) {
    const { status, data } = await post("api/scene", { problem });
    if (status !== 200) { say("refused", data.error, "failed"); return false; }
    scene.show({ ...data.scene, targets: [] }, data.tool);
    return true;
  }

  async function begin() {
    byId("begin").disabled = true;
    try {
      if (live.id) await stop();
      const problem = examples[byId("example").value];
      if (!(await show(problem))) return;
      say("starting", "starting a process");
      const asked = { problem };
      if (byId("engine").value) asked.engine = byId("engine").value;
      let answer = await post("api/live", asked);
      for (let k = 0; k < 10 && answer.status === 429; k++) { // the last one is about to end
        await new Promise((done) => setTimeout(done, 500));
        answer = await post("api/live", asked);
      }
      if (answer.status !== 201) { say("refused", answer.data.error, "failed"); return; }
      watch(answer.data);
    } finally { byId("begin").disabled = false; }
  }

  // Watches a controller; `about` is the server's answer about it.
  function watch({ id, joint_names: names, velocity_limits: limits, clearance, target }) {
    if (live.strips) live.strips.destroy();
    const mm = (metres) => (metres === null ? null : 1000 * metres);
    live.strips = new Strips.Strips(byId("strips"), [
      { title: "errors of the tool", unit: "mm, mrad", asinh: 1, series: [{ name: "position", colour: "--accent", width: 2 }, { name: "rotation", colour: "--soft" }], values: ({ error }) => [mm(error.position), mm(error.rotation)] },
      { title: "smallest distance", unit: "mm", asinh: 10, series: [{ name: "measured", low: mm(clearance), colour: "--measured", width: 2 }], values: ({ nearest }) => [nearest ? mm(nearest.distance) : null] },
      Strips.joints(names, limits),
    ]);
    const events = Page.stream(`api/live/${id}/events`, { state: draw, end: ({ reason }) => ended(reason) }, () => again(id));
    Object.assign(live, { id, first: target, states: 0, events });
    byId("stop").disabled = byId("home").disabled = false;
    byId("save").href = `api/live/${id}/recording.zip`;
  }

  // The stream is closed for good: the server came back without it, or refuses.
  async function again(id) {
    if (live.id !== id) return;
    const found = await get("api/live/" + id);
    if (live.id !== id) return;
    if (found) { watch(found); return; }
    byId("save").hidden = true;
    ended("the server does not know it any more");
  }

  function ended(reason) {
    if (live.events) live.events.close();
    Object.assign(live, { id: null, events: null });
    byId("stop").disabled = byId("home").disabled = true;
    say("ended", reason);
  }

  async function stop() {
    const { id } = live;
    ended("stopped");
    await Page.ask("api/live/" + id, { method: "DELETE" });
  }

  function draw(state) {
    live.last = state;
    live.states++;
    scene.pose(state.poses);
    scene.aim(state.target);
    say(state.status, state.reason, { tracking: "verified", stopping: "failed", stopped: "failed" }[state.status] || "running");
    const mm = (x) => (1000 * x).toFixed(2) + " mm", off = state.error.position;
    byId("error").textContent = mm(off);
    byId("rotation").textContent = ((180 / Math.PI) * state.error.rotation).toFixed(2) + "°";
    byId("nearest").textContent = state.nearest ? `${mm(state.nearest.distance)}, ${state.nearest.pair.join(" and ")}` : "nothing near";
    byId("active").textContent = state.active.length ? state.active.join(", ") : "none";
    byId("seconds").textContent = (1000 * state.step_seconds).toFixed(2) + " ms";
    byId("time").textContent = state.t.toFixed(1) + " s" + (state.lost > 0.05 ? `, ${state.lost.toFixed(1)} s left out: the machine is busy` : "");
    scene.touching(new Set(state.active.filter((name) => name.startsWith(HOLDS)).flatMap((name) => name.slice(HOLDS.length).split(" and "))));
    live.strips.add(state);
    byId("save").hidden = false;
  }

  async function open() {
    examples = await get("api/examples");
    const named = await Page.named(), [running] = await get("api/live");
    if (named) examples = { "the stored problem": named, ...examples };
    byId("example").append(...Object.keys(examples).map((name) => make("option", { value: name, textContent: name })));
    if (!named) byId("example").value = "02_shelf";
    byId("example").addEventListener("change", () => { if (!live.id) show(examples[byId("example").value]); });
    const found = running ? await get("api/live/" + running.id) : null; // one that runs is watched by all who come
    if (found && (await show(found.problem))) watch(found);
    else await show(examples[byId("example").value]);
  }

  byId("begin").addEventListener("click", begin);
  byId("stop").addEventListener("click", stop);
  byId("home").addEventListener("click", () => aim(live.first));
  window.optiplanLive = { scene, live };
  open();
})();
