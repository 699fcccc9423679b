"use strict";
// The list of runs and problems; looks again while anything is queued or running.
(() => {
  const { byId, make, get } = Page, chosen = new Set();
  const when = (seconds) => new Date(1000 * seconds).toLocaleString();
  const word = (run) => (run.status === "done" ? (run.verified ? "verified" : "not verified") : run.status);
  const look = (run) => (run.status === "done" ? (run.verified ? "verified" : "refused") : run.status);

  async function send(method, path) {
    await fetch(path, { method });
    await show();
  }

  // A run that others submitted too ends for all only if that is meant.
  async function cancel(path) {
    const answer = await fetch(path, { method: "POST" });
    if (answer.status === 409 && confirm((await answer.json()).error + "\n\nCancel it for everyone?")) await fetch(path + "?everyone=true", { method: "POST" });
    await show();
  }

  function card(run) {
    const ended = !["queued", "running"].includes(run.status), name = run.name + " · " + run.planner;
    const picture = ended
      ? make("img", { src: `api/runs/${run.id}/thumbnail.svg?${run.finished}`, alt: "The scene and the path of the tool", loading: "lazy" })
      : make("div", { className: "blank" });
    const title = ended && run.status !== "cancelled" ? make("a", { href: "runs/" + run.id, textContent: name }) : make("span", { textContent: name });
    const facts = [run.robot, run.duration === null ? null : run.duration.toFixed(3) + " s", run.ratio === null ? null : run.ratio.toFixed(3) + " × bound",
      run.timings && run.timings.plan ? "planned in " + run.timings.plan.toFixed(2) + " s" : null, run.seed ? "seed " + run.seed : null, when(run.submitted)];
    const box = make("input", { type: "checkbox", checked: chosen.has(run.id), disabled: run.status !== "done" });
    box.addEventListener("change", () => { chosen[box.checked ? "add" : "delete"](run.id); byId("compare").disabled = chosen.size < 2; });
    const button = ended
      ? make("button", { type: "button", textContent: "Delete", onclick: () => send("DELETE", "api/runs/" + run.id) })
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
    const button = make("button", { type: "button", textContent: "Delete", onclick: () => send("DELETE", "api/problems/" + problem.hash) });
    const links = make("span", { className: "links" }, make("a", { href: "studio#" + problem.hash, textContent: "Studio" }), make("a", { href: "live#" + problem.hash, textContent: "Live" }));
    return make("div", { className: "run" }, make("div", { className: "head" }, make("a", { href: "studio#" + problem.hash, textContent: problem.name })), picture,
      make("div", { className: "facts", textContent: [problem.robot, when(problem.created)].join(" · ") }), make("div", { className: "tools" }, links, button));
  }

  async function show() {
    const { runs, counts } = await get("api/runs?limit=60");
    byId("runs").replaceChildren(...(runs.length ? runs.map(card) : [make("p", { className: "none", textContent: "No runs yet: plan one in the studio." })]));
    byId("counts").textContent = Object.entries(counts).map(([state, count]) => `${count} ${state}`).join(" · ");
    const problems = await get("api/problems");
    byId("problems").replaceChildren(...(problems.length ? problems.map(problemCard) : [make("p", { className: "none", textContent: "None stored: the studio has a button for that." })]));
    if (counts.queued || counts.running) setTimeout(show, 1000);
  }

  byId("compare").addEventListener("click", () => { location.href = "compare?" + [...chosen].map((run) => "run=" + run).join("&"); });
  show();
})();
