"use strict";
// Benches: what is compared is chosen, and tables grow while runs end.
(() => {
  const { byId, make, post, get } = Page, OFTEN = 1000, SELDOM = 30000; // ms
  let texts = {};

  const chosen = (id) => [...byId(id).selectedOptions].map((option) => option.value);
  const number = (x, digits) => (x === null ? "–" : x.toFixed(digits));

  function row(tag, cells) {
    return make("tr", {}, ...cells.map((cell) => (cell instanceof Node ? cell : make(tag, { textContent: cell }))));
  }

  function cell(found, seeds) {
    const good = found.verified && found.verified === found.ended ? "verified" : found.verified ? "running" : "failed", { pages, kept } = found;
    const look = found.ended < kept ? "queued" : kept ? good : "", address = pages.length > 1 ? "compare?" + pages.slice(0, 8).map((run) => "run=" + run).join("&") : "runs/" + pages[0];
    const count = make("span", { className: "badge " + look, textContent: `${found.verified} of ${seeds}`, title: kept < seeds ? `${seeds - kept} of these runs were deleted or are not queued` : "" });
    const text = found.duration === null ? "" : ` ${found.duration.toFixed(3)} s`;
    return make("td", {}, found.ended === kept && pages.length ? make("a", { href: address, title: "View these runs" }, count, text) : make("span", {}, count, text));
  }

  function panel(bench) {
    const seeds = bench.seeds.length, labels = bench.planners.map((one) => one.planner), total = seeds * bench.problems.length;
    const ended = bench.planners.reduce((sum, one) => sum + one.ended, 0), all = total * labels.length;
    const tables = make("div", { className: "tableaux" }, make("table", {}, make("thead", {}, row("th", ["", ...labels])), make("tbody", {},
      row("td", ["verified", ...bench.planners.map((one) => `${one.verified} of ${total}`)]),
      row("td", ["planning, median", ...bench.planners.map((one) => (one.plan_time === null ? "–" : number(one.plan_time, 3) + " s"))]),
      row("td", ["duration / bound, median", ...bench.planners.map((one) => number(one.ratio, 3))]),
      ...bench.problems.map(({ name, hash }) => row("td", [name, ...labels.map((label) => cell(bench.cells.find((one) => one.problem === name && one.planner === label), seeds))])))));
    const report = ended ? [make("a", { href: `api/benches/${bench.id}/report.html`, textContent: "Full report" })] : [];
    const button = bench.status === "running"
      ? make("button", { type: "button", textContent: "Cancel", onclick: () => send("POST", bench.id + "/cancel") })
      : make("button", { type: "button", textContent: "Delete", onclick: () => send("DELETE", bench.id) });
    const head = make("div", { className: "head" }, make("b", { textContent: bench.name }), make("progress", { value: ended, max: all, hidden: bench.status === "done", ariaLabel: "Runs that have ended" }),
      make("span", { className: "none", textContent: `${ended} of ${all} runs, ${bench.budget} s each, ${new Date(1000 * bench.created).toLocaleString()}` }), ...report, button);
    return make("section", { className: "panel bench", id: "bench-" + bench.id }, head, tables);
  }

  async function send(method, path) {
    if (method === "DELETE" && !confirm("Delete this bench? Its runs stay; the bench cannot be brought back.")) return;
    await Page.ask("api/benches/" + path, { method });
    await show();
  }

  let drawn = "";
  const show = Page.watching(async () => {
    const benches = await get("api/benches"), now = JSON.stringify(benches);
    if (now !== drawn) byId("benches").replaceChildren(...(benches.length ? benches.map(panel) : [make("p", { className: "none", textContent: "No benches yet." })]));
    drawn = now;
    return benches.some((one) => one.status === "running");
  }, OFTEN, SELDOM);

  byId("submit").addEventListener("click", async () => {
    const seeds = Array.from({ length: Number(byId("seeds").value) }, (_, k) => k), budget = Number(byId("budget").value);
    const asked = { name: byId("name").value, problems: chosen("problems").map((one) => texts[one] || one), planners: chosen("planners"), seeds, budget };
    byId("told").textContent = "…";
    const { status, data } = await post("api/benches", asked);
    byId("told").textContent = status === 202 ? "" : data.error;
    await show();
  });

  async function open() {
    const [examples, planners, stored] = await Promise.all([get("api/examples"), get("api/planners"), get("api/problems")]);
    texts = examples;
    const option = (name, selected, value = name) => make("option", { value, textContent: name, selected });
    const kept = stored.map(({ name, hash, created }) => option(`${name} (stored ${new Date(1000 * created).toLocaleString()})`, false, hash));
    byId("problems").append(...kept, ...Object.keys(texts).map((name) => option(name, name === "01_reach" || name === "02_shelf")));
    byId("planners").append(...planners.map(({ name }) => option(name, name === "trajopt" || name === "rrtconnect")));
    await show();
  }
  addEventListener("optiplan:back", () => { drawn = ""; show(); });
  open();
})();
