"use strict";
// Curves below the scene: the clearance, and one quantity of the motion; with several runs, one of each.
const OptiPlanDock = (() => {
  const { floats, doubles } = OptiPlanPacked, { Plot, make, shared, digits } = OptiPlanCurves, { millimetres } = OptiPlanFacts;
  const MOST = 300; // mm: larger clearances are not shown
  const SAMPLED = "sampled, refined";
  const WORST = "nearest to its limit", LARGEST = "largest of the joints"; // instead of a joint, with several runs; without limits

  // The curves of a run as arrays: { t, quantities: [{ name, unit, of, kind, series: [{ name, t, y, low, high, extrema }] }] }
  function decoded(run) {
    if (run.decoded || !run.curves) return run.decoded || null;
    const t = floats(run.curves.t);
    const quantities = run.curves.quantities.map((one) => {
      const all = floats(one.y), m = one.series.length, own = one.t ? floats(one.t) : t; // a log has times of its own
      const series = one.series.map((name, j) => ({ name, t: own, y: Float32Array.from(own, (_, k) => all[k * m + j]), low: one.low[j], high: one.high[j], extrema: one.extrema[j] }));
      return { ...one, series };
    });
    run.decoded = { t, quantities };
    return run.decoded;
  }

  function clearance(run) {
    if (run.near || !run.clearance) return run.near || null;
    const own = run.clearance;
    run.near = { ...own, t: floats(own.t), distance: floats(own.distance), points: floats(own.points) };
    run.near.choices = (own.choices || []).map((one) => ({ of: one.of, distance: Array.from(floats(one.distance), (d) => (Number.isFinite(d) ? d : null)), points: floats(one.points) }));
    if (own.edges) Object.assign(run.near, { edges: doubles(own.edges), proved: doubles(own.proved) });
    return run.near;
  }

  // What of a clearance is looked at alone, `run.only`: the scene's, the robot's own, or that of one pair; null: all.
  const only = (run) => (run.only && clearance(run) ? run.near.choices.find((one) => one.of === run.only) || null : null);

  // The nearest two bodies at time t: { distance, points, pair }, between two samples of one pair by a straight line.
  function nearest(run, t) {
    const all = clearance(run), alone = only(run);
    if (!all) return null;
    const near = alone ? { ...all, ...alone } : all;
    let low = 0, high = near.t.length - 1;
    while (high - low > 1) { const middle = (low + high) >> 1; if (near.t[middle] <= t) low = middle; else high = middle; }
    if (near.distance[low] === null || near.distance[high] === null) return null;
    const x = Math.min(1, Math.max(0, (t - near.t[low]) / (near.t[high] - near.t[low] || 1))), same = alone !== null || near.pair[low] === near.pair[high];
    const k = x < 0.5 ? low : high, share = same ? x : k - low;
    const at = (array, i) => array[6 * low + i] + share * (array[6 * high + i] - array[6 * low + i]);
    const points = [[0, 1, 2].map((i) => at(near.points, i)), [3, 4, 5].map((i) => at(near.points, i))];
    return { distance: near.distance[low] + share * (near.distance[high] - near.distance[low]), points, pair: alone ? [alone.of] : near.pairs[near.pair[k]] };
  }

  class Dock {
    // app: { data, selected, shown, colour(k), clock, joint(name or null) }; its elements are in the page.
    constructor(app, element) {
      Object.assign(this, { app, element, quantity: app.data.runs.length > 3 ? "table" : "velocity", share: false, joint: WORST, plots: [], signals: [], multiples: false });
      this.tabs = make("div", "tabs");
      this.tabs.setAttribute("role", "tablist");
      this.tabs.setAttribute("aria-label", "Curves");
      this.options = make("div", "options");
      this.range = make("button", "range");
      this.range.type = "button";
      this.range.hidden = true;
      this.range.addEventListener("click", () => app.clock.view(null));
      this.body = make("div", "plots");
      const bar = make("div", "dockbar");
      bar.append(this.tabs, this.range, this.options);
      element.replaceChildren(bar, this.body);
      this.near = make("div", "plot near");
      this.own = make("div", "plot own");
      this.body.append(this.near, this.own);
      app.clock.listen(() => this.time());
    }

    get run() { return this.app.data.runs[this.app.selected]; }
    get several() { return this.app.data.runs.filter((run) => run.curves).length > 1; }

    // The selected run, or which runs are shown, has changed.
    fill() {
      this.derive();
      const found = decoded(this.run) || decoded(this.app.data.runs.find((run) => run.curves) || {});
      const names = [...(this.several ? ["table"] : []), ...(this.app.data.runs.some((run) => run.clearance) ? ["clearance"] : []), ...(found ? found.quantities.map((one) => one.name) : [])];
      this.element.hidden = !names.length;
      if (!names.includes(this.quantity)) this.quantity = names[names.length - 1] || "velocity";
      this.tabs.replaceChildren(...names.map((name) => this.tab(name)));
      this.draw();
    }

    // The signals that were made of curves, as a quantity of each run.
    derive() {
      for (const run of this.app.data.runs) {
        const found = decoded(run);
        if (!found) continue;
        const own = found.quantities.filter((one) => one.name !== OptiPlanDerived.NAME), made = OptiPlanDerived.quantity(this.signals, own);
        found.quantities = made ? [...own, made] : own;
      }
    }

    // Other signals, [{kind, a, b}]; the last of them is looked at.
    signal(signals) {
      this.signals = signals;
      if (signals.length) Object.assign(this, { quantity: OptiPlanDerived.NAME, joint: WORST });
      this.fill();
      this.app.changed();
    }

    tab(name) {
      const button = make("button", "", name);
      button.type = "button";
      button.dataset.name = name;
      button.setAttribute("role", "tab");
      button.addEventListener("click", () => this.choose(name));
      return button;
    }

    choose(name) { this.quantity = name; this.draw(); if (this.app.changed) this.app.changed(); }

    draw() {
      for (const plot of this.plots) plot.destroy();
      this.plots = [];
      for (const tab of this.tabs.children) tab.setAttribute("aria-selected", String(tab.dataset.name === this.quantity));
      this.element.dataset.quantity = this.quantity;
      this.fillOptions();
      this.own.replaceChildren();
      this.near.replaceChildren();
      this.element.classList.toggle("multiples", this.small);
      this.nearPlot = this.clearanceSpec() && !this.small ? this.add(this.near, this.clearanceSpec()) : null;
      this.near.hidden = !this.nearPlot;
      if (this.small) { this.addMultiples(); this.time(); return; }
      if (this.quantity === "table") { const box = make("div", "scrolled"); box.tabIndex = 0; box.setAttribute("aria-label", "Comparison"); this.app.comparison.fillTable(box); this.own.append(box); this.app.comparison.mark(); }
      else if (this.quantity !== "clearance" && this.quantitySpec()) this.plot = this.add(this.own, this.quantitySpec());
      this.time();
    }

    // Whether each run has a small picture of its own.
    get small() { return this.multiples && this.several && this.quantity !== "table"; }

    // A small picture a run, all with the same axes, in the order of the table.
    addMultiples() {
      const near = this.quantity === "clearance", specs = [];
      for (const [run, k] of this.app.comparison.order) {
        const own = run.curves && this.chosen(run); // not every run has every quantity
        if (!this.app.shown[k] || !(near ? clearance(run) : own)) continue;
        const spec = near ? this.ownClearance(run, k) : { ...own, series: own.series.filter((one) => this.joint === WORST || own.of !== "joints" || one.name === this.joint) };
        specs.push({ ...spec, title: run.label, unit: spec.unit, said: "", marks: spec.marks });
      }
      const axes = specs.map((spec) => OptiPlanCurves.range(spec)), end = Math.max(...specs.map((spec) => Math.max(...spec.series.map((one) => one.t[one.t.length - 1]))));
      for (const spec of specs) {
        const cell = make("div", "cell");
        this.own.append(cell);
        this.add(cell, { ...spec, end, axis: [Math.min(...axes.map(([low]) => low)), Math.max(...axes.map(([, high]) => high))] });
      }
    }

    add(element, spec) {
      const { clock } = this.app, plot = new Plot(element, { ...spec, range: clock.range, onSeek: (t) => clock.jump(t), onRange: (range) => clock.view(range) });
      plot.canvas.setAttribute("role", "group");
      plot.canvas.setAttribute("aria-label", `${spec.title} over time; drag to move the time, with shift to choose a range; the wheel zooms`);
      this.plots.push(plot);
      return plot;
    }

    fillOptions() {
      const found = [], unit = this.chosen();
      if (unit && unit.series.some((one) => shared(one)) && !this.several) {
        const button = make("button", "", this.share ? "in units" : "% of limit");
        button.type = "button";
        button.addEventListener("click", () => { this.share = !this.share; this.draw(); });
        found.push(button);
      }
      if (unit && unit.of === "joints" && this.several) {
        const label = make("label", "", "joint "), choice = make("select");
        choice.append(...[WORST, ...unit.series.map((one) => one.name)].map((name) => new Option(name === WORST ? this.worst : name, name, false, name === this.joint)));
        choice.addEventListener("change", () => { this.joint = choice.value; this.draw(); });
        label.append(choice);
        found.push(label);
      }
      if (this.several && this.quantity !== "table") {
        const button = make("button", "", this.multiples ? "one picture" : "a picture a run");
        button.type = "button";
        button.addEventListener("click", () => { this.multiples = !this.multiples; this.draw(); this.app.changed(); });
        found.push(button);
      }
      const choices = (clearance(this.run) || { choices: [] }).choices;
      if (choices.length) {
        const label = make("label", "", "distance "), choice = make("select");
        choice.id = "distance-of";
        choice.append(new Option("of all", "", false, !this.run.only), ...choices.map((one) => new Option(one.of, one.of, false, one.of === this.run.only)));
        choice.addEventListener("change", () => this.look(choice.value || null));
        label.append(choice);
        found.push(label);
      }
      const all = decoded(this.run);
      if (all) found.push(OptiPlanDerived.form(this.signals, all.quantities.filter((one) => one.name !== OptiPlanDerived.NAME), () => this.signal(this.signals)));
      this.options.replaceChildren(...found);
    }

    // Which distance is shown: of all, the scene's, the robot's own, or of a pair.
    look(of) {
      this.run.only = of;
      this.draw();
      this.app.looked();
      this.app.changed();
    }

    chosen(run = this.run) {
      const found = decoded(run) || decoded(this.app.data.runs.find((one) => one.curves) || {});
      return found && found.quantities.find((one) => one.name === this.quantity);
    }

    quantitySpec() {
      if (!this.chosen()) return null;
      const unit = this.chosen(), bands = this.run.near ? this.run.near.contacts : [];
      if (this.several) return this.overlaySpec(unit);
      const most = unit.series.map((one) => Math.max(0, ...one.extrema.map(([, v]) => Math.abs(shared({ ...one, y: [v], extrema: [] })?.y[0] ?? 0)))).reduce((a, b) => Math.max(a, b), 0);
      const said = `${unit.kind === "sampled" ? SAMPLED : unit.kind}${most ? `; at most ${(100 * most).toPrecision(3)} % of a limit` : ""}${this.run.untimed ? "; at a constant rate: the path was refused before it was timed" : ""}`;
      const whose = this.run.curves ? "" : `${this.app.data.runs.find((run) => run.curves).label}: `; // of the only one that has any
      return { title: whose + unit.name, unit: unit.unit, series: unit.series, share: this.share, said, bands, onHover: unit.of === "joints" ? (name) => this.app.joint(name) : null };
    }

    // Whether all runs that are shown have limits of this quantity.
    get limited() {
      const own = this.app.data.runs.filter((run, k) => run.curves && this.app.shown[k]).map((run) => this.chosen(run));
      return own.every((one) => !one || one.series.some(shared));
    }

    get worst() { return this.limited ? WORST : LARGEST; }

    // One curve a run: of a joint, or of whichever is nearest to its limit at that time; the largest where there is none.
    overlaySpec(unit) {
      const { limited } = this, worst = unit.of === "joints" && this.joint === WORST, series = [];
      this.app.data.runs.forEach((run, k) => {
        const own = run.curves && this.chosen(run);
        if (!own || !this.app.shown[k]) return;
        const look = { name: run.label, colour: this.app.colour(k), width: k === this.app.selected ? 2.2 : 1.3 };
        if (worst) series.push({ ...largest(limited ? own.series.map(shared).filter(Boolean) : own.series, limited), ...look });
        else series.push({ ...(own.series.find((one) => one.name === this.joint) || own.series[0]), ...look });
      });
      const title = unit.of === "joints" ? `${unit.name}, ${worst ? this.worst : this.joint}` : unit.name;
      return { title, unit: worst && limited ? "share of the limit" : unit.unit, series, said: unit.kind, onHover: (name) => this.app.solo(this.app.data.runs.findIndex((run) => run.label === name)) };
    }

    clearanceSpec() {
      const run = this.run, own = clearance(run), alone = only(run), series = [];
      if (alone) {
        const y = alone.distance.map((d) => (d === null ? null : 1e3 * d)), known = y.map((d, k) => [d, own.t[k]]).filter(([d]) => d !== null), [least, at] = known.reduce((a, b) => (b[0] < a[0] ? b : a));
        return { title: `clearance, ${alone.of}`, unit: "mm", series: [{ name: "measured", t: own.t, y, colour: "--measured", width: 2 }], asinh: 1, most: MOST, marks: [{ t: at, y: Math.min(MOST, least), words: `the least: ${millimetres(1e-3 * least)} at ${at.toFixed(3)} s` }] };
      }
      this.app.data.runs.forEach((other, k) => {
        const near = other !== run && this.app.shown[k] && clearance(other);
        if (near) series.push({ name: other.label, t: near.t, y: near.distance.map((d) => 1e3 * d), colour: this.app.colour(k), width: 1 });
      });
      if (!own) return series.length ? { title: "clearance", unit: "mm", series, asinh: 1, most: MOST } : null;
      const spec = this.ownClearance(run, this.app.selected);
      return { ...spec, series: [...spec.series, ...series] };
    }

    // The clearance of one run: what was measured over what is proved.
    ownClearance(run, k) {
      const own = clearance(run), series = [];
      const millis = (array) => Float64Array.from(array, (d) => 1e3 * d), marks = [{ t: own.least.t, y: Math.min(MOST, 1e3 * own.least.distance), words: `the least: ${millimetres(own.least.distance)}, ${own.least.pair.join(" – ")}, at ${own.least.t.toFixed(3)} s` }];
      const colour = this.several ? this.app.colour(k) : "--measured";
      series.unshift({ name: "measured", t: own.t, y: millis(own.distance), colour, width: 2 });
      if (own.proved) series.unshift({ name: "proved", t: own.edges, y: millis([...own.proved, own.proved[own.proved.length - 1]]), colour: "--proved", step: true, fill: "--proved-fill", width: 1 });
      return { title: "clearance", unit: "mm", series, asinh: 1, most: MOST, marks, bands: own.contacts };
    }

    time() {
      const { clock } = this.app;
      for (const plot of this.plots) { plot.zoom(clock.range); plot.time(clock.time); }
      this.shownRange();
      if (!this.nearPlot || !this.run.near) return;
      const moment = nearest(this.run, clock.time);
      if (moment) this.nearPlot.say(`${moment.pair.join(" – ")}, ${millimetres(moment.distance)}`);
    }

    // The range that is shown and played, with a way back to all.
    shownRange() {
      const { range } = this.app.clock;
      this.range.hidden = !range;
      if (range) this.range.textContent = `${range.map((t) => t.toFixed(2)).join("–")} s ×`;
      this.range.title = "Show all of the time again";
    }

    single(name) { if (this.plot && this.plots.includes(this.plot) && !this.several) this.plot.single(name); }
    redraw() { for (const plot of this.plots) plot.redraw(); }
  }

  // The largest magnitude of all at each time; shares have a limit of 1.
  function largest(series, shares) {
    const { t } = series[0], y = Float32Array.from(t, (_, k) => Math.max(...series.map((one) => Math.abs(one.y[k]))));
    return { t, y, low: null, high: shares ? 1 : null, extrema: [] };
  }

  return { Dock, nearest, clearance, decoded, digits };
})();
