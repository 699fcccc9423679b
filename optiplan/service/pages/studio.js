"use strict";
// The studio: the text is the truth; the scene shows what it says, and writes into it.
(() => {
  const { byId, make, post, get, latest } = Page, text = byId("text");
  const state = { valid: "", problem: null, q: [], start: [], run: null, events: null, asked: 0, points: [] };

  const scene = new StudioScene.Scene(byId("pane"), {
    goal(pose, ended) {
      if (!ended) { solve(pose); return; }
      const [x, y, z, ...quaternion] = pose;
      edit("goal", { pose: { position: [x, y, z], quaternion } });
      solve(pose);
    },
    obstacle(name, position) {
      const whole = structuredClone(state.problem.scene);
      const body = whole.obstacles.find((one) => one.name === name);
      body.pose = { ...body.pose, position };
      edit("scene", whole);
    },
  });

  function edit(key, value) {
    text.value = StudioText.replaced(text.value, key, value);
    check();
  }

  const solve = latest(async (pose) => {
    const { status, data } = await post("api/ik", { problem: state.valid, pose, near: state.q });
    if (status !== 200) return;
    scene.branches(data.branches);
    byId("hint").textContent = data.branches.length ? `${data.branches.length} ways to reach it` + (data.reason ? "; " + data.reason : "") : data.reason;
  });

  const check = latest(async () => {
    const asked = ++state.asked, problem = text.value;
    const { status, data } = await post("api/problems/validate", { problem });
    if (asked !== state.asked) return;
    const issues = status === 200 ? data.issues : [{ line: null, field: "", found: data.error, expected: "" }];
    byId("issues").replaceChildren(...(issues.length ? issues.map(shownIssue) : [make("div", { className: "fine", textContent: "valid" })]));
    byId("plan").disabled = issues.length > 0;
    if (issues.length) return;
    state.valid = problem;
    const drawn = await post("api/scene", { problem });
    if (drawn.status === 200 && asked === state.asked) draw(drawn.data);
  });

  function shownIssue(issue) {
    const place = issue.line === null ? "" : `line ${issue.line}: `;
    const words = `${place}${issue.field}: ${issue.found}` + (issue.expected ? `; expected ${issue.expected}` : "");
    return make("button", { type: "button", textContent: words, onclick: () => goTo(issue.line) });
  }

  function goTo(line) {
    if (line === null) return;
    const lines = text.value.split("\n"), begin = lines.slice(0, line - 1).join("\n").length + (line > 1 ? 1 : 0);
    text.focus();
    text.setSelectionRange(begin, begin + lines[line - 1].length);
    text.scrollTop = Math.max(0, (line - 4) * 18.75);
  }

  function draw(found) {
    const fresh = JSON.stringify(found.start) !== JSON.stringify(state.start);
    Object.assign(state, { problem: found.problem, start: found.start });
    scene.show(found.scene, found.tool);
    if (fresh || state.q.length !== found.start.length) state.q = [...found.start];
    else move();
    byId("sliders").replaceChildren(...found.joints.map((joint, k) => {
      const low = joint.lower === null ? -Math.PI : joint.lower, high = joint.upper === null ? Math.PI : joint.upper;
      const value = make("output", { textContent: state.q[k].toFixed(3) });
      const slider = make("input", { type: "range", min: low, max: high, step: "any", value: state.q[k] });
      slider.addEventListener("input", () => { state.q[k] = Number(slider.value); value.textContent = state.q[k].toFixed(3); move(); });
      return make("label", { textContent: joint.name }, value, slider);
    }));
  }

  const move = latest(async () => {
    const { status, data } = await post("api/pose", { problem: state.valid, q: state.q });
    if (status !== 200) return;
    scene.pose(data.poses);
    byId("touching").textContent = data.touching.map((pair) => pair.join(" and ")).map((pair) => pair + " touch").join("; ");
  });

  async function plan() {
    byId("page").hidden = byId("back").hidden = true;
    const asked = { problem: text.value, budget: Number(byId("budget").value) };
    if (byId("planner").value) asked.planner = byId("planner").value;
    const { status, data } = await post("api/runs", asked);
    byId("watch").hidden = false;
    byId("improvements").replaceChildren();
    byId("link").hidden = byId("execute").hidden = true;
    state.points = [];
    curve();
    if (status !== 202) { tell("failed", data.error); return; }
    Object.assign(state, { run: data.id, submission: data.submission });
    byId("cancel").disabled = false;
    tell(data.status, "");
    if (state.events) state.events.close();
    const events = state.events = new EventSource(`api/runs/${data.id}/events`);
    events.addEventListener("status", (event) => tell(JSON.parse(event.data).status, ""));
    events.addEventListener("stage", (event) => { const { stage } = JSON.parse(event.data); tell("running", stage); });
    events.addEventListener("best", (event) => improved(JSON.parse(event.data)));
    events.addEventListener("end", () => { events.close(); finished(); });
  }

  function tell(status, words) {
    byId("state").className = "badge " + status;
    byId("state").textContent = status;
    byId("stage").textContent = words;
  }

  function improved({ seconds, duration }) {
    byId("improvements").append(make("li", { textContent: `${duration.toFixed(4)} s after ${seconds.toFixed(2)} s` }));
    state.points.push([seconds, duration]);
    curve();
  }

  // The best duration over time as steps.
  function curve() {
    const svg = byId("best");
    svg.replaceChildren();
    if (!state.points.length) return;
    const last = 1.15 * state.points.at(-1)[0], least = Math.min(...state.points.map((point) => point[1])), most = Math.max(...state.points.map((point) => point[1]));
    const x = (t) => (318 * t) / last + 1, y = (d) => 48 - (40 * (d - least)) / Math.max(1e-9, most - least);
    let path = "";
    state.points.forEach(([t, d], k) => { path += k ? ` H${x(t)} V${y(d)}` : `M${x(t)} ${y(d)}`; });
    Page.drawn(svg, path + " H319", "#1769aa");
  }

  async function finished() {
    byId("cancel").disabled = true;
    const run = await get("api/runs/" + state.run);
    const word = run.status === "done" ? (run.verified ? "verified" : "refused") : run.status;
    const said = run.failure ? `${run.failure.kind}: ${run.failure.detail}` : run.duration ? `${run.duration.toFixed(4)} s` + (run.ratio ? `, ${run.ratio.toFixed(3)} × the bound` : "") : "";
    tell(word, said);
    if (run.status === "cancelled") return;
    Object.assign(byId("link"), { href: "runs/" + run.id, hidden: false });
    Object.assign(byId("execute"), { href: "execution#run=" + run.id, hidden: !run.verified });
    if (run.status !== "done") return;
    byId("page").src = "runs/" + run.id;
    byId("page").hidden = byId("back").hidden = false;
  }

  let typing = 0;
  text.addEventListener("input", () => { clearTimeout(typing); typing = setTimeout(check, 350); });
  text.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) plan();
  });
  byId("plan").addEventListener("click", plan);
  byId("cancel").addEventListener("click", () => fetch(`api/runs/${state.run}/cancel?submission=${state.submission}`, { method: "POST" }));
  byId("back").addEventListener("click", () => { byId("page").hidden = byId("back").hidden = true; byId("page").src = "about:blank"; });
  byId("start").addEventListener("click", () => edit("start", { joints: state.q }));
  byId("goal").addEventListener("click", () => edit("goal", { joints: state.q }));
  byId("save").addEventListener("click", () => {
    const name = (state.problem && state.problem.name) || "problem", url = URL.createObjectURL(new Blob([text.value], { type: "application/yaml" }));
    make("a", { href: url, download: name + ".yaml" }).click();
    URL.revokeObjectURL(url);
  });
  byId("store").addEventListener("click", async () => {
    const { status, data } = await post("api/problems", { problem: text.value });
    byId("stored").textContent = status === 201 ? "stored" : data.error.slice(0, 80);
  });

  async function begin() {
    const [examples, planners] = await Promise.all([get("api/examples"), get("api/planners")]);
    byId("example").append(...Object.keys(examples).map((name) => make("option", { value: name, textContent: name })));
    byId("planner").append(...planners.map(({ name }) => make("option", { value: name, textContent: name })));
    byId("example").addEventListener("change", () => { text.value = examples[byId("example").value] || text.value; state.start = []; check(); });
    text.value = (await Page.named()) || examples["02_shelf"];
    check();
  }
  byId("joints").open = innerWidth > 760; // else it hides the scene
  byId("joints").addEventListener("toggle", () => scene.resize());
  window.optiplanStudio = { scene, state };
  begin();
})();
