"use strict";
// The list of runs and problems; looks again and again, since others submit runs, too.
(() => {
  const { byId, make, get } = Page, chosen = new Set();
  const when = (seconds) => new Date(1000 * seconds).toLocaleString();
  const word = (run) => (run.status === "done" ? (run.verified ? "verified" : "not verified") : run.status);
  const look = (run) => (run.status === "done" ? (run.verified ? "verified" : "refused") : run.status);

  // What cannot be brought back is asked about first.
  async function forget(what, path, run = null) {
    if (!confirm(`Delete ${what}? It cannot be brought back.`)) return;
    const { ok, status } = await Page.ask(path, { method: "DELETE" });
    if (ok || status === 404) runs = runs.filter((one) => one.id !== run);
    await Promise.all([show(), showProblems()]);
  }

  // A run that others submitted too ends for all only if that is meant.
  async function cancel(path) {
    const answer = await Page.ask(path, { method: "POST" });
    if (answer.status === 409 && confirm((await answer.json()).error + "\n\nCancel it for everyone?")) await Page.ask(path + "?everyone=true", { method: "POST" });
    await show();
  }

  function card(run) {
    const ended = !["queued", "running"].includes(run.status), name = run.name + " · " + run.planner;
    const picture = ended
      ? make("img", { src: `api/runs/${run.id}/thumbnail.svg?${run.finished}`, alt: "The scene and the path of the tool", loading: "lazy" })
      : make("div", { className: "blank" });
    const title = run.page ? make("a", { href: "runs/" + run.id, textContent: name }) : make("span", { textContent: name });
    const facts = [run.robot, run.duration === null ? null : run.duration.toFixed(3) + " s", run.ratio === null ? null : run.ratio.toFixed(3) + " × bound",
      run.timings && run.timings.plan ? "planned in " + run.timings.plan.toFixed(2) + " s" : null, run.seed ? "seed " + run.seed : null, when(run.submitted)];
    const box = make("input", { type: "checkbox", checked: chosen.has(run.id), disabled: run.status !== "done" || !run.page });
    box.addEventListener("change", () => { chosen[box.checked ? "add" : "delete"](run.id); comparable(); });
    const button = ended
      ? make("button", { type: "button", textContent: "Delete", onclick: () => forget(`the run ${name}, with its files`, "api/runs/" + run.id, run.id) })
      : make("button", { type: "button", textContent: "Cancel", onclick: () => cancel(`api/runs/${run.id}/cancel`) });
    const tools = make("div", { className: "tools" }, make("label", {}, box, "compare"), button);
    if (run.verified) tools.lastChild.before(make("a", { href: "execution#run=" + run.id, textContent: "Execute" }));
    const parts = [make("div", { className: "head" }, title, make("span", { className: "badge " + look(run), textContent: word(run) })), picture,
      make("div", { className: "facts", textContent: facts.filter(Boolean).join(" · ") })];
    if (run.failure) parts.push(make("div", { className: "facts", textContent: run.failure.kind + ": " + run.failure.detail.slice(0, 160) }));
    return make("div", { className: "run" }, ...parts, tools);
  }

  function problemCard(problem) {
    const picture = make("img", { src: `api/problems/${problem.hash}/thumbnail.svg`, alt: "The scene", loading: "lazy" });
    const button = make("button", { type: "button", textContent: "Delete", onclick: () => forget(`the stored problem ${problem.name}`, "api/problems/" + problem.hash) });
    const links = make("span", { className: "links" }, make("a", { href: "studio#" + problem.hash, textContent: "Studio" }), make("a", { href: "live#" + problem.hash, textContent: "Live" }));
    return make("div", { className: "run" }, make("div", { className: "head" }, make("a", { href: "studio#" + problem.hash, textContent: problem.name })), picture,
      make("div", { className: "facts", textContent: [problem.robot, when(problem.created)].join(" · ") }), make("div", { className: "tools" }, links, button));
  }

  // ---- what is listed: the newest runs, older ones on demand; all that the filters let through
  const PAGE = 60, MOST = 500, COMPARED = 8, OFTEN = 1000, SELDOM = 4000; // runs a page, and of one look; ms between two looks while anything runs, and while nothing does
  let runs = [], older = false, drawn = "", listed = "";

  function wanted(run) {
    const words = byId("search").value.toLowerCase().split(/\s+/).filter(Boolean), about = `${run.name} ${run.planner} ${run.robot} ${run.id}`.toLowerCase(), verdict = byId("verdict").value;
    const state = ["queued", "running"].includes(run.status) ? "running" : look(run);
    return words.every((one) => about.includes(one)) && (!byId("robot").value || run.robot === byId("robot").value) && (!verdict || verdict === state);
  }

  const EMPTY = () => make("div", { className: "panel" }, make("b", { textContent: "No runs yet" }), make("p", { textContent: "A run is one answer of a planner to one problem: a robot, a start, a goal, obstacles." }),
    make("p", {}, make("a", { href: "studio", textContent: "Open the studio" }), ": it has examples; press Plan there. Or from a shell, with this server's address:"),
    make("pre", { textContent: `curl -X POST ${location.origin}${location.pathname}api/plan -H 'Content-Type: application/yaml' --data-binary @problem.yaml` }));

  // Whether what is chosen can be compared, and if not, why.
  function comparable() {
    const problems = new Set(runs.filter((run) => chosen.has(run.id)).map((run) => run.problem));
    const why = chosen.size > COMPARED ? `${chosen.size} are chosen; at most ${COMPARED} fit into a comparison` : problems.size > 1 ? "those chosen are of different problems" : "";
    byId("compare").disabled = chosen.size < 2 || why !== "";
    byId("why").textContent = why;
  }

  function draw() {
    const found = runs.filter(wanted), robots = [...new Set(runs.map((run) => run.robot))].sort(), chosenRobot = byId("robot").value;
    for (const id of chosen) if (!runs.some((run) => run.id === id)) chosen.delete(id);
    comparable();
    const now = JSON.stringify([found.map((run) => [run.id, run.status, run.finished]), [...chosen], Boolean(runs.length)]);
    if (now !== drawn) byId("runs").replaceChildren(...(found.length ? found.map(card) : [runs.length ? make("p", { className: "none", textContent: "No run is like that." }) : EMPTY()]));
    drawn = now; // what has not changed stays as it is, with its pictures and where the keyboard is
    if (robots.join() !== listed) byId("robot").replaceChildren(new Option("any", ""), ...robots.map((name) => new Option(name, name, false, name === chosenRobot)));
    listed = robots.join();
    byId("found").textContent = found.length === runs.length ? "" : `${found.length} of ${runs.length}`;
    byId("filters").hidden = !runs.length;
    byId("more").hidden = !older;
  }

  const show = Page.watching(async () => {
    const limit = Math.min(MOST, Math.max(PAGE, runs.length)); // older ones that are shown change, too
    const { runs: newest, counts } = await get(`api/runs?limit=${limit}`), whole = newest.length < limit;
    if (whole || !runs.length) older = !whole;
    const last = newest.length ? newest.at(-1).submitted : 0;
    runs = whole ? newest : [...newest, ...runs.filter((run) => run.submitted < last)];
    draw();
    byId("counts").textContent = Object.entries(counts).map(([state, count]) => `${count} ${state}`).join(" · ");
    return counts.queued || counts.running;
  }, OFTEN, SELDOM);

  let stored = "";
  async function showProblems() {
    const problems = await get("api/problems"), now = JSON.stringify(problems);
    if (now !== stored) byId("problems").replaceChildren(...(problems.length ? problems.map(problemCard) : [make("p", { className: "none", textContent: "None stored: the studio has a button for that." })]));
    stored = now;
  }

  byId("more").addEventListener("click", async () => {
    const { runs: found } = await get(`api/runs?limit=${PAGE}&before=${runs.at(-1).submitted}`);
    runs.push(...found.filter((run) => run.submitted < runs.at(-1).submitted)); // two clicks get the same ones
    older = found.length === PAGE;
    draw();
  });
  for (const id of ["search", "robot", "verdict"]) byId(id).addEventListener("input", draw);
  addEventListener("optiplan:back", () => { show(); showProblems(); });
  byId("compare").addEventListener("click", () => { location.href = "compare?" + [...chosen].map((run) => "run=" + run).join("&"); });
  show();
  showProblems();
})();
