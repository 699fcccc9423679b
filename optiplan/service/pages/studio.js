"use strict";
// The studio: the text is the truth; the scene shows what it says, and writes into it.
(() => {
  const { byId, make, post, get, latest } = Page, AGAIN = 2000, TRIES = 3; // ms, and how often what failed is asked for again
  const ELSEWHERE = "No ways to reach it are shown: at the start the robot lacks the frame of this pose, or this step does not move all joints that carry it.";
  const state = { valid: "", problem: null, hash: "", q: [], start: [], asked: 0, handles: [], active: 0, chosen: null, coming: null, branches: [], branch: -1, examples: {}, opened: "", opening: 0, behind: true, written: "", wishes: [], refusals: 0, tries: 0, unheard: 0 };
  const names = { robots: [], planners: [] };
  const NO_END = Object.fromEntries(["joints", "joints_deg", "configuration", "pose", "region", "all_of", "any_of"].map((key) => [key, undefined])); // to be spread before the one that is meant
  const WRITTEN_OUT = ["for", "do", "either", "pick", "place"]; // steps that are several ones in the problem

  const words = SchemaWords.from(get("api/schema"), (path) => ({ robot: names.robots, "planner.name": names.planners, planner: names.planners })[path.join(".")] || []);
  const editor = new Editor.Text(byId("text"), (text) => { keep(text); clearTimeout(typing); typing = setTimeout(check, 350); }, words);
  let typing = 0;

  const scene = StudioScene.begin(byId("pane"), {
    goal(pose, ended, index) {
      if (index !== undefined) { activate(index); return; }
      if (ended) moved(() => pose); else solve(pose);
    },
    obstacle: (name, pose) => { if (here(name)) write(placement(name, () => pose)); },
    selected: (name) => choose(name),
    resized(name, shape, pose, ended) {
      const before = body(name) && body(name).shape;
      if (ended && before && here(name)) write(own(name, (text, at) => ProblemText.set(text, [...at, "shape"], pulled(shape, before, body(name).shape))), placement(name, () => pose));
    },
    branch: (k) => takeBranch(k),
    surface: (point, normal) => { point_at(false); moved((now) => PoseText.onSurface(point, normal, now)); },
  });

  // ---- what the scene writes into the text: each wish is one step of the history
  // A wish makes edits of the text that the scene shows. What the scene wrote last is drawn first: until then wishes wait.
  function write(...wishes) {
    state.wishes.push(wishes);
    return next();
  }

  // Writes what has waited longest; false where the text is another one than is shown, and all was refused.
  function next() {
    const before = editor.text();
    if (state.behind || ![state.valid, state.written].includes(before) || !ProblemText.sound(before)) {
      refuse();
      return false;
    }
    if (before !== state.valid) return true;
    const text = state.wishes.shift().reduce((now, edits) => ProblemText.applied(now, edits(now)), before);
    editor.edit(ProblemText.difference(before, text));
    state.written = text;
    check();
    return true;
  }

  // The scene shows what the text said before: it goes back to that, and writes nothing.
  function refuse() {
    state.wishes = [];
    state.refusals++;
    if (state.drawn) draw(state.drawn); // what was dragged goes back
    tell("The scene shows an earlier text, which is not checked or has a mistake by now: nothing is written until it is drawn anew. Then try again.");
  }

  const place = (name, text = editor.text()) => ["scene", "obstacles", ProblemText.named(text, ["scene", "obstacles"], name)];
  const body = (name) => (state.problem ? state.problem.scene.obstacles.find((one) => one.name === name) : undefined);
  // Edits of an obstacle at its place in the text; none where it is gone by then.
  const own = (name, edits) => (text) => (body(name) && place(name, text)[2] >= 0 ? edits(text, place(name, text)) : []);
  const placement = (name, wish, to) => own(name, (text, at) => {
    const now = PoseText.read(body(name).pose);
    return PoseText.edits(text, [...at, "pose"], now, wish(now), to);
  });
  // A shape whose knob was pulled, to 1 mm; sizes that are as before stay as the text has them now, to the last digit.
  const pulled = (value, before, now) => (typeof value === "number" ? (value === before ? now : PoseText.round(value, 1e-3)) : Array.isArray(value) ? value.map((one, k) => pulled(one, before[k], now[k])) : Object.fromEntries(Object.entries(value).map(([key, one]) => [key, pulled(one, before[key], now[key])])));

  // Whether an obstacle stands in this text, and not in a file that it names, or no more.
  function here(name) {
    if (place(name)[2] >= 0) return true;
    tell(`${name} is not in this text: it cannot be changed here`);
    return false;
  }

  // Where the end stands that a handle is the pose of.
  const end = (handle) => (!handle ? ["goal"] : handle.path.at(-1) === "pose" ? handle.path.slice(0, -1) : handle.path);

  // The pose that is dragged or typed goes to where the file has it; an end of joint values becomes a pose.
  function moved(wish, to) {
    const path = end(state.handles[state.active]), named = path.join();
    return write((text) => {
      const handle = state.handles.find((one) => end(one).join() === named), pose = wish(handle ? handle.pose : state.tool);
      if (handle === state.handles[state.active]) solve(pose); // where it is refused, the reason stays to be read
      if (handle && !handle.joints) return PoseText.edits(text, handle.path, handle.pose, pose, to);
      return ProblemText.set(text, path, { ...NO_END, velocity: undefined, acceleration: undefined, pose: PoseText.said(pose, to) });
    });
  }

  // A name that no obstacle has.
  function fresh(stem, k) {
    const taken = new Set(state.problem.scene.obstacles.map(({ name }) => name));
    while (taken.has(`${stem}_${k}`)) k++;
    return `${stem}_${k}`;
  }

  function add(kind) {
    const shapes = { box: [0.1, 0.1, 0.1], sphere: 0.06, cylinder: { radius: 0.05, length: 0.4 } };
    const goal = state.handles[state.active], tool = state.tool, middle = goal ? goal.pose.slice(0, 3).map((x, j) => 0.5 * (x + tool[j])) : tool.slice(0, 3);
    write((text) => put(text, { name: fresh(kind, 1), shape: { [kind]: shapes[kind] }, pose: { position: middle.map((x) => PoseText.round(x, 1e-3)) } }));
  }

  function put(text, one) {
    state.coming = one.name; // chosen once the scene has it: an older answer may still come before
    return ProblemText.add(text, ["scene", "obstacles"], one);
  }

  // Another like this one, beside it.
  function double(name) {
    return own(name, (text, at) => {
      const one = ProblemText.value(text, at), [x, y, z] = PoseText.read(one.pose);
      return put(text, { ...one, name: fresh(name, 2), pose: { ...one.pose, position: [x, y + 0.1, z] } });
    });
  }

  function does(what, wish) {
    const { chosen } = state;
    if (!here(chosen)) return;
    if (what === "pose") write(placement(chosen, wish, PoseText.TYPED));
    else if (what === "shape") write(own(chosen, (text, at) => ProblemText.set(text, [...at, "shape"], wish(body(chosen).shape))));
    else if (what === "show") editor.show(ProblemText.place(editor.text(), place(chosen)));
    else if (what === "remove") { if (write(own(chosen, (text, at) => ProblemText.remove(text, at)))) choose(null); }
    else write(double(chosen));
  }

  function point_at(on) {
    scene.pointing = on;
    byId("surface").setAttribute("aria-pressed", String(on));
    if (on) tell("Click on a surface: the goal goes 1 cm above it, the tool's z axis into it.");
  }

  // ---- what is chosen
  function choose(name) {
    state.chosen = name && body(name) ? name : null;
    const one = state.chosen && body(state.chosen);
    scene.choose(state.chosen, one ? one.shape : null);
    fields();
  }

  function activate(index) {
    if (!state.handles[index]) return; // of a text that was here before
    state.active = index;
    noWays();
    scene.handles(state.handles.map((one) => one.pose), index);
    choose(null);
    solve(state.handles[index].pose);
  }

  // Joint values in place of what stands at a path: the start, or an end.
  function useJoints(path, q) {
    const joints = q.map((x) => PoseText.round(x, 1e-6)); // as they are now: they may go on while this waits
    write((text) => ProblemText.set(text, path, { ...NO_END, joints }));
  }

  function fields() {
    const one = state.chosen && body(state.chosen), handle = state.handles[state.active];
    const shown = one ? StudioCard.obstacle({ ...one, pose: PoseText.read(one.pose), fixed: "half_space" in one.shape }, does)
      : handle ? StudioCard.handle(handle, (what, wish) => (what === "show" ? editor.show(ProblemText.place(editor.text(), handle.path)) : moved(wish, PoseText.TYPED))) : [];
    byId("fields").replaceChildren(...shown);
    byId("chosen").firstElementChild.textContent = one ? `${one.name} · ${Object.keys(one.shape)[0].replace("_", " ")}` : handle ? handle.label : "";
    byId("chosen").hidden = !shown.length;
  }

  // ---- branches of the goal; those of another text, or of a pose that was refused since, are not shown
  const solve = (pose) => branch(pose, state.opening, state.refusals);
  const branch = latest(async (pose, ...asked) => {
    const old = () => asked[0] !== state.opening || asked[1] !== state.refusals;
    if (!state.drawn || old()) return;
    const { frame } = state.handles[state.active] || {};
    const { status, data } = frame === null ? { status: 200, data: { branches: [], reason: ELSEWHERE } } : await post("api/ik", { problem: state.valid, pose, near: state.q, frame });
    if (status !== 200 || old()) return;
    Object.assign(state, { branches: data.branches, branch: -1, solved: pose });
    ghosts(data.reason);
  });

  // No ways are known to what is reached for now.
  function noWays() {
    Object.assign(state, { branches: [], branch: -1 });
    if (scene.data) scene.branches([]);
    byId("branches").replaceChildren();
    byId("take").hidden = true;
  }

  function ghosts(reason) {
    scene.branches(state.branches, state.branch);
    const many = state.branches.length, free = state.branches.filter((one) => one.within_limits && !one.touching).length;
    tell(many ? `${many} ways to reach it, ${free} of them free` + (reason ? "; " + reason : "") : reason);
    byId("branches").replaceChildren(...state.branches.map((one, k) => make("button", { type: "button", className: one.touching || !one.within_limits ? "bad" : "", textContent: String(k + 1),
      title: `${one.branch || "a way"}${one.touching ? "; touches" : ""}${one.within_limits ? "" : "; outside the limits"}`, ariaPressed: String(k === state.branch), onclick: () => takeBranch(k) })));
    const handle = state.handles[state.active];
    byId("take").hidden = state.branch < 0 || Boolean(handle && !handle.moves.length);
  }

  function takeBranch(k) {
    if (!state.branches[k]) return;
    state.branch = k;
    state.q = [...state.branches[k].q];
    ghosts("");
    move();
    sliders();
  }

  // The goal, or the end of the step that is active, becomes the joint values of a branch.
  function useBranch() {
    const handle = state.handles[state.active], { q } = state.branches[state.branch];
    useJoints(end(handle), handle ? handle.moves.map((j) => q[j]) : q);
  }

  // ---- the text is checked and drawn
  const check = latest(async () => {
    const asked = ++state.asked, problem = editor.text(), ask = (path) => post(path, { problem }).catch(() => null);
    clearTimeout(typing);
    const answer = await ask("api/problems/validate");
    if (!answer) { unknown(); return; }
    if (asked !== state.asked) return;
    const { status, data } = answer, issues = status === 200 ? data.issues : [{ line: null, field: "", found: data.error, expected: "" }];
    byId("issues").replaceChildren(...(issues.length ? issues.map(shownIssue) : [make("div", { className: "fine", textContent: "valid" })]));
    editor.mark(issues.map((one) => ({ line: one.line, words: said(one) })));
    byId("plan").disabled = byId("store").disabled = issues.length > 0;
    if (issues.length) { StudioRun.clear(editor.text()); behind(true, status); return; }
    if (state.hash && data.hash !== state.hash) StudioRun.clear(editor.text());
    state.hash = data.hash;
    const drawn = await ask("api/scene");
    if (!drawn) { unknown(); return; }
    await scene.free(); // what is dragged is not taken out of the hand
    if (asked !== state.asked) return;
    behind(drawn.status !== 200, drawn.status);
    if (state.behind) { tell(`The scene is not drawn anew: ${drawn.data.error}`); return; }
    state.valid = problem;
    if (problem === state.written || editor.text() !== state.written) state.written = ""; // a text that comes back is drawn before it is written into
    draw(drawn.data);
    if (state.wishes.length) next();
  });

  // Whether the scene is behind the text: it shows an earlier one, or none, and writes nothing until it is drawn anew.
  // A server that was too busy for it is asked again; where it fails, a few times: a text may be what it fails at.
  function behind(yes, status = 200) {
    state.behind = yes;
    if (!yes) state.tries = state.unheard = 0;
    if (yes && state.wishes.length) refuse();
    if (status === 429 || (status === 503 && state.tries++ < TRIES)) typing = setTimeout(check, AGAIN);
    for (const id of ["add", "surface", "start", "goal", "take", "record", "play"]) byId(id).disabled = yes;
  }

  function unknown() {
    state.unheard++;
    byId("issues").replaceChildren(make("div", { className: "none", textContent: "The server does not answer: the text is not checked. It is kept in this browser." }));
    byId("plan").disabled = byId("store").disabled = true;
    behind(true);
  }

  const said = (issue) => `${issue.field}: ${issue.found}` + (issue.expected ? `; expected ${issue.expected}` : "");

  function shownIssue(issue) {
    const place = issue.line === null ? "" : `line ${issue.line}: `;
    return make("button", { type: "button", textContent: place + said(issue), onclick: () => issue.line !== null && editor.goTo(issue.line) });
  }

  function draw(found) {
    const fresh = JSON.stringify(found.start) !== JSON.stringify(state.start), known = new Set(found.problem.scene.obstacles.map((one) => one.name)), had = state.handles.length;
    Object.assign(state, { drawn: found, problem: found.problem, start: found.start, tool: found.tool, joints: found.joints, handles: asWritten(found) });
    state.active = Math.min(state.active, Math.max(0, state.handles.length - 1));
    scene.show(found.scene, null);
    if (state.handles.length) scene.handles(state.handles.map((one) => one.pose), state.active);
    if (!state.handles.length && (had || !scene.framed)) tell("This text has no pose to be dragged. Obstacles can be dragged, with shift up and down; a click chooses one.");
    if (!scene.framed) { scene.frame(); scene.framed = true; }
    if (fresh || state.q.length !== found.start.length) {
      state.q = [...found.start];
      noWays();
    }
    const aim = state.handles[state.active]; // ghosts stay as long as they reach what the text says
    if (state.branches.length && aim && aim.pose.some((x, k) => Math.abs(x - state.solved[k]) > 2e-3)) {
      noWays();
      tell("");
    }
    scene.branches(state.branches, state.branch);
    move();
    const coming = known.has(state.coming) ? state.coming : null;
    if (coming) state.coming = null;
    choose(coming || (known.has(state.chosen) ? state.chosen : null));
    sliders();
    byId("steps").replaceChildren(...state.handles.map((one, k) => make("option", { value: k, textContent: one.label, selected: k === state.active })));
    byId("steps").parentElement.hidden = state.handles.length < 2;
    byId("goal").hidden = Boolean(found.problem.task);
    byId("surface").hidden = Boolean(found.problem.task) && !state.handles.length;
  }

  function sliders() {
    byId("sliders").replaceChildren(...state.joints.map((joint, k) => {
      const far = joint.unit === "m" ? 1 : Math.PI, low = Math.min(state.q[k], joint.lower === null ? -far : joint.lower), high = Math.max(state.q[k], joint.upper === null ? far : joint.upper);
      const shown = () => `${state.q[k].toFixed(3)} ${joint.unit}`, value = make("output", { textContent: shown() });
      const slider = make("input", { type: "range", min: low, max: high, step: "any", value: state.q[k] });
      slider.addEventListener("input", () => { state.q[k] = Number(slider.value); value.textContent = shown(); move(); });
      return make("label", { textContent: joint.name }, value, slider);
    }));
  }

  const move = latest(async () => {
    if (!state.drawn) return;
    const { drawn } = state, { status, data } = await post("api/pose", { problem: state.valid, q: state.q });
    if (status !== 200 || drawn !== state.drawn) return;
    scene.pose(data.poses);
    scene.touching(new Set(data.touching.flat()));
    byId("touching").textContent = [...new Set(data.touching.map((pair) => pair.join(" and ") + " touch"))].join("; ");
  });

  // Handles whose poses stand in the text, with their paths there: steps that are written out count as one, and have none.
  function asWritten({ handles, problem }) {
    const task = ProblemText.value(state.valid, ["task"]);
    const several = Array.isArray(task) ? task.map((step) => WRITTEN_OUT.some((key) => key in Object(step))) : [];
    if (!several.includes(true)) return handles;
    const first = several.indexOf(true), last = several.lastIndexOf(true), more = problem.task.length - task.length;
    return handles.flatMap((one) => {
      const [root, k, ...rest] = one.path;
      return root !== "task" || k < first ? [one] : k > last + more ? [{ ...one, path: [root, k - more, ...rest] }] : [];
    });
  }

  // ---- teach: points are recorded as vias, and played back as they are, before any planning
  function record() {
    const q = state.q.map((x) => PoseText.round(x, 1e-6));
    if (write((text) => ProblemText.add(text, ["via"], { joints: q }))) tell("recorded: Plan makes one proved motion past all points; Play back shows them as they are");
  }

  async function play() {
    const wanted = ["via", "goal"].flatMap((key) => ProblemText.value(editor.text(), [key]) || []).map((one) => Object(one).joints), given = wanted.filter(Array.isArray);
    const points = [state.start, ...given], { q: before, opening } = state, STEPS = 20, left = wanted.length - given.length;
    tell(left ? `${left} of ${wanted.length} points are no lists of joint values in the text: they are left out` : "");
    if (points.length < 2) { tell("nothing to play: record a point, or set a goal of joint values"); return; }
    for (let k = 0; k + 1 < points.length; k++) for (let j = 1; j <= STEPS; j++) {
      state.q = points[k].map((x, i) => x + (j / STEPS) * (points[k + 1][i] - x));
      await move();
      await new Promise((done) => setTimeout(done, 40));
      if (opening !== state.opening) return;
    }
    state.q = before;
    move();
  }

  // ---- drafts: what is typed stays in this browser until it is stored or thrown away
  function tell(words) { byId("hint").textContent = words; }

  function keep(text) {
    byId("stored").textContent = "";
    state.tries = state.unheard = 0;
    if (!Drafts.keep(text, state.opened)) byId("stored").textContent = "this browser keeps no draft";
  }

  function open(text, undoable) {
    const edited = editor.text() && editor.text() !== state.opened;
    state.opened = text;
    Object.assign(state, { start: [], q: [], joints: [], handles: [], problem: null, drawn: null, valid: "", written: "", wishes: [], chosen: null, active: 0, opening: state.opening + 1, asked: state.asked + 1 }); // what was asked about another text is not drawn
    noWays();
    fields();
    sliders();
    behind(true);
    scene.framed = false;
    if (undoable) editor.replace(text); else editor.begin(text);
    notice(edited ? "Your text is one undo away." : "", ["Bring it back", () => editor.undo()]);
    check();
  }

  // Words, and buttons of [what they say, what they do].
  function notice(words, ...actions) {
    byId("notice").hidden = !words;
    byId("notice").replaceChildren(words, ...actions.flatMap(([textContent, act]) => [" ", make("button", { type: "button", textContent, onclick: () => { byId("notice").hidden = true; act(); } })]));
  }

  // A draft in place of the text; what it began from is what it is told apart from.
  function resume(draft, undoable) {
    open(draft.text, undoable);
    state.opened = draft.opened || "";
  }

  // ---- buttons
  byId("plan").addEventListener("click", () => StudioRun.plan(editor.text()));
  byId("text").addEventListener("keydown", (event) => { if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) { event.preventDefault(); event.stopPropagation(); StudioRun.plan(editor.text()); } }, true);
  byId("undo").addEventListener("click", () => editor.undo());
  byId("redo").addEventListener("click", () => editor.redo());
  for (const end of ["start", "goal"]) byId(end).addEventListener("click", () => useJoints([end], state.q));
  byId("take").addEventListener("click", useBranch);
  byId("record").addEventListener("click", record);
  byId("play").addEventListener("click", play);
  byId("surface").addEventListener("click", () => point_at(!scene.pointing));
  byId("steps").addEventListener("change", () => activate(Number(byId("steps").value)));
  byId("add").addEventListener("change", () => { if (byId("add").value) add(byId("add").value); byId("add").value = ""; });
  byId("example").addEventListener("change", () => { const text = state.examples[byId("example").value]; if (text) open(text, true); });
  byId("save").addEventListener("click", () => {
    const name = (state.problem && state.problem.name) || "problem", url = URL.createObjectURL(new Blob([editor.text()], { type: "application/yaml" }));
    make("a", { href: url, download: name + ".yaml" }).click();
    URL.revokeObjectURL(url);
  });
  byId("store").addEventListener("click", async () => {
    const { status, data } = await post("api/problems", { problem: editor.text() });
    byId("stored").textContent = status === 201 ? "stored" : data.error.slice(0, 80);
  });
  addEventListener("optiplan:back", () => { if (state.unheard <= TRIES) check(); }); // this very text may be what is not answered

  async function begin() {
    const [examples, planners, robots] = await Promise.all([get("api/examples"), get("api/planners"), get("api/robots")]);
    state.examples = examples;
    Object.assign(names, { planners: planners.map(({ name }) => name), robots: robots.map(({ name }) => name) });
    byId("example").append(...Object.keys(examples).map((name) => make("option", { value: name, textContent: name })));
    byId("planner").append(...names.planners.map((name) => make("option", { value: name, textContent: name })));
    const named = await Page.named(), mine = named === null ? Drafts.take() : null, kept = mine || Drafts.all()[0], when = ({ at }) => new Date(at).toLocaleString();
    if (named === null && kept) resume(kept, false);
    else open(named || examples["02_shelf"], false);
    const others = Drafts.all().filter((one) => one.text !== editor.text()), offers = others.map((one) => [`Open that of ${when(one)}`, () => resume(one, true)]);
    if (others.length) offers.push(["Forget the others", () => confirm("Forget the other drafts? They cannot be brought back.") && others.forEach(Drafts.drop)]);
    if (named === null && kept) notice(`Your draft of ${when(kept)}.`, ["Begin anew", () => { if (mine) Drafts.drop(mine); open(examples["02_shelf"], true); }], ...offers);
    else if (others.length) notice("This browser keeps drafts of yours.", ...offers);
  }
  byId("joints").open = byId("chosen").open = innerWidth > 760; // else they hide the scene
  byId("joints").addEventListener("toggle", () => scene.resize());
  window.optiplanStudio = { scene, state, editor };
  begin();
})();
