"use strict";
// A run that the studio asks for: its improvements as they come, its end, its page.
const StudioRun = (() => {
  const { byId, make, post, get, latest } = Page;
  const state = { problem: null, run: null, events: null, points: [] };
  // One name for all that this page submits: what it plans twice is one run, which one click cancels.
  const submission = Array.from(crypto.getRandomValues(new Uint8Array(16)), (x) => x.toString(16).padStart(2, "0")).join("");

  function tell(status, words) {
    byId("state").className = "badge " + status;
    byId("state").textContent = status;
    byId("stage").textContent = words;
  }

  // Nothing of an earlier problem stays beside the next; what was planned of this very text does.
  function clear(problem = null) {
    if (problem !== null && problem === state.problem) return;
    if (state.events) state.events.close();
    Object.assign(state, { problem: null, run: null, events: null });
    byId("watch").hidden = byId("cancel").disabled = true;
    leave();
    begin();
  }

  // The page of a run goes, and draws no more.
  function leave() {
    byId("page").hidden = byId("back").hidden = true;
    byId("page").src = "about:blank";
  }

  // The improvements of a run, none yet.
  function begin() {
    state.points = [];
    byId("improvements").replaceChildren();
    curve();
  }

  const plan = latest(async (problem) => {
    clear();
    state.problem = problem;
    const asked = { problem, submission, budget: Number(byId("budget").value) };
    if (byId("planner").value) asked.planner = byId("planner").value;
    const { status, data } = await post("api/runs", asked);
    if (state.problem !== problem) { // the text is another one by now, and nobody would watch
      if (status === 202) await Page.ask(`api/runs/${data.id}/cancel?submission=${submission}`, { method: "POST" });
      return;
    }
    byId("watch").hidden = false;
    byId("link").hidden = byId("execute").hidden = true;
    if (status !== 202) { tell("failed", data.error); return; }
    state.run = data.id;
    byId("cancel").disabled = false;
    tell(data.status, "");
    watch(data.id);
  });

  function watch(id) {
    state.events = Page.stream(`api/runs/${id}/events`, {
      status: ({ status }) => tell(status, ""),
      stage: ({ stage }) => tell("running", stage),
      best: improved,
      end: () => { state.events.close(); look(id); },
    }, () => look(id));
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

  // What became of a run; where only its stream has ended, it is watched again.
  async function look(id) {
    if (state.run !== id) return;
    const run = await get("api/runs/" + id);
    if (state.run !== id) return;
    if (run && ["queued", "running"].includes(run.status)) { begin(); watch(id); return; }
    byId("cancel").disabled = true;
    if (!run) { tell("deleted", ""); return; }
    const word = run.status === "done" ? (run.verified ? "verified" : "refused") : run.status;
    const said = run.failure ? `${run.failure.kind}: ${run.failure.detail}` : run.duration ? `${run.duration.toFixed(4)} s` + (run.ratio ? `, ${run.ratio.toFixed(3)} × the bound` : "") : "";
    tell(word, said);
    if (run.status === "cancelled") return;
    Object.assign(byId("link"), { href: "runs/" + run.id, hidden: !run.page });
    Object.assign(byId("execute"), { href: "execution#run=" + run.id, hidden: !run.verified });
    if (run.status !== "done") return;
    byId("page").src = "runs/" + run.id;
    byId("page").hidden = byId("back").hidden = false;
  }

  byId("cancel").addEventListener("click", () => Page.ask(`api/runs/${state.run}/cancel?submission=${submission}`, { method: "POST" }));
  byId("back").addEventListener("click", leave);
  return { plan, clear };
})();
