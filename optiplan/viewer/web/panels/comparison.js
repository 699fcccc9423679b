"use strict";
// Several runs: a short list beside the scene, the whole table below it; sorted by duration, what has no motion folded.
const OptiPlanComparison = (() => {
  const { make, digits } = OptiPlanCurves;
  const fixed = (n) => (v) => v.toFixed(n);
  const COLUMNS = [
    ["planning", "planning, s", fixed(2)], ["duration", "duration, s", fixed(3)], ["ratio", "duration / bound", fixed(3)], ["tool_path", "tool path, m", fixed(3)],
    ["peak_jerk", "peak jerk", fixed(0), "jerk"], ["jerk_share", "of its limit", (v) => (100 * v).toFixed(0) + " %"], ["rms_torque", "RMS torque", fixed(2), "torque"],
    ["scene_clearance", "clearance from scene, mm", (v) => digits(1e3 * v)], ["self_clearance", "from itself, mm", (v) => digits(1e3 * v)],
    ["manipulability", "least manipulability", digits],
  ];

  class Comparison {
    // app: { data, colour(k), shown, robots, selected, select(k), solo(k or null), update() }
    constructor(app) {
      this.app = app;
      const [bound] = app.data.bound;
      for (const run of app.data.runs) run.row.ratio = bound && run.row.duration !== null ? run.row.duration / bound : null;
      this.order = OptiPlanFacts.sorted(app.data.runs);
      this.rows = [];
      this.differences = [];
    }

    checkbox(checked, words, change) {
      const label = make("label", "tick"), box = make("input");
      box.type = "checkbox";
      box.checked = checked;
      box.setAttribute("aria-label", words);
      box.title = words;
      box.addEventListener("change", () => change(box.checked));
      label.append(box);
      return label;
    }

    row([run, k]) {
      const { app } = this, row = make("div", "run"), name = make("button", "name", run.label), swatch = make("span", "swatch");
      name.type = "button";
      name.addEventListener("click", () => app.select(k));
      swatch.style.background = app.colour(k);
      row.append(this.checkbox(app.shown[k], `show the path of ${run.label}`, (on) => { app.shown[k] = on; app.update(); }), swatch, name,
        make("span", "time", run.row.duration === null ? "" : run.row.duration.toFixed(3) + " s"), make("span", "ratio", run.row.ratio === null ? "" : run.row.ratio.toFixed(2) + "×"),
        this.checkbox(app.robots[k], `show the robot of ${run.label}`, (on) => { app.robots[k] = on; app.update(); }));
      if (run.badge !== "verified") row.append(OptiPlanVerdict.badge(run));
      row.addEventListener("pointerenter", (event) => { if (event.pointerType === "mouse") app.solo(k); });
      row.addEventListener("pointerleave", () => app.solo(null));
      this.rows.push([row, k]);
      return row;
    }

    fillList(element) {
      const moving = this.order.filter(([run]) => run.row.duration !== null), still = this.order.filter(([run]) => run.row.duration === null), head = make("div", "run head");
      head.append(make("span", "", "path"), make("span", "swatch"), make("span", "name", this.app.data.several ? "problem" : "planner"), make("span", "time", "duration"), make("span", "ratio", "/ bound"), make("span", "", "robot"));
      element.replaceChildren(head, ...moving.map((one) => this.row(one)));
      if (!still.length) return;
      const folded = make("details", "more still");
      folded.open = !moving.length;
      folded.append(make("summary", "", `${still.length} without a motion`), ...still.map((one) => this.stillRow(one)));
      element.append(folded);
    }

    stillRow([run, k]) {
      const row = make("button", "still-run");
      row.type = "button";
      row.append(make("b", "", run.label), make("span", "", run.problems[0] || "no plan"));
      row.addEventListener("click", () => this.app.select(k));
      this.rows.push([row, k]);
      return row;
    }

    // The unit of a quantity of the joints, which turn or slide.
    unit(quantity) {
      const found = this.app.data.runs.flatMap((run) => (run.curves ? run.curves.quantities : [])).find((one) => one.name === quantity);
      return found ? found.unit : "";
    }

    fillTable(element) {
      this.differences = [];
      const table = make("table", "compare"), head = make("tr"), body = make("tbody"), [bound, words] = this.app.data.bound;
      head.append(make("th", "", "planner"), make("th", "", ""), ...COLUMNS.map(([, title, , quantity]) => make("th", "number", quantity ? `${title}, ${this.unit(quantity)}` : title)));
      for (const [run, k] of this.order) {
        if (run.row.duration === null) continue;
        const row = make("tr"), name = make("th"), pick = make("button", "name", run.label), swatch = make("span", "swatch");
        swatch.style.background = this.app.colour(k);
        pick.type = "button";
        pick.addEventListener("click", () => this.app.select(k));
        name.scope = "row";
        name.append(swatch, pick);
        const verdict = make("td");
        verdict.append(OptiPlanVerdict.badge(run));
        row.append(name, verdict, ...COLUMNS.map(([key, , form]) => this.cell(run, k, key, form)));
        row.addEventListener("pointerenter", (event) => { if (event.pointerType === "mouse") this.app.solo(k); });
        row.addEventListener("pointerleave", () => this.app.solo(null));
        body.append(row);
        this.rows.push([row, k]);
      }
      const top = make("thead");
      top.append(head);
      table.append(top, body);
      const said = make("p", "bound", `bound: ${bound === null ? "" : bound.toFixed(3) + " s, "}${words}`);
      element.replaceChildren(table, said);
    }

    // A figure of a run, and behind it how far it is from that of the selected run.
    cell(run, k, key, form) {
      const cell = make("td", "number"), value = run.row[key];
      if (value === null || value === undefined) { cell.textContent = "–"; return cell; }
      const difference = make("small", "difference");
      cell.append(form(value), difference);
      this.differences.push(() => {
        const base = this.app.data.runs[this.app.selected].row[key], share = k === this.app.selected || !base ? null : value / base - 1;
        difference.textContent = share === null || Math.abs(share) < 5e-4 ? "" : ` ${share > 0 ? "+" : "−"}${Math.abs(100 * share).toFixed(Math.abs(share) < 0.1 ? 1 : 0)} %`;
      });
      return cell;
    }

    // Marks the selected run, with which the others are compared.
    mark() {
      for (const [row, k] of this.rows) row.classList.toggle("selected", k === this.app.selected);
      for (const tell of this.differences) tell();
    }
  }
  return { Comparison };
})();
