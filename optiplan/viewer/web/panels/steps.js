"use strict";
// The steps of a task: a strip below the slider, the step of the moment in words, and a list to jump by.
const OptiPlanSteps = (() => {
  const { make } = OptiPlanCurves, byId = (id) => document.getElementById(id);
  const EVENTS = ["attach", "detach", "tool"];

  const named = (one) => `${one.step} · ${one.name}`;

  // The steps of a run in time; those of one number and name that follow each other are one.
  function merged(run) {
    const found = [];
    for (const one of run.segments || []) {
      const last = found[found.length - 1];
      if (last && last.step === one.step) last.end = one.end; else found.push({ ...one });
    }
    return found;
  }

  function at(steps, t) { return steps.find((one) => t < one.end) || steps[steps.length - 1]; }

  function counted(steps, stops) {
    return `${steps} step${steps === 1 ? "" : "s"}` + (stops ? `, ${stops} stop${stops === 1 ? "" : "s"} on the way` : "");
  }

  class Steps {
    constructor(clock) {
      this.clock = clock;
      this.steps = [];
      clock.listen(() => this.say());
    }

    fill(run, place) {
      this.steps = merged(run);
      const { clock } = this, T = clock.duration || 1, strip = [];
      this.steps.forEach((one, k) => {
        const event = EVENTS.includes(one.kind), mark = make("span", event ? "event" : "step" + (k % 2 ? " odd" : ""));
        mark.style.left = place(one.begin / T);
        if (!event) mark.style.width = `calc(${(one.end - one.begin) / T} * (100% - 16px))`;
        mark.title = `${named(one)}, from ${one.begin.toFixed(2)} s`;
        mark.addEventListener("click", () => clock.jump(one.begin));
        strip.push(mark);
      });
      byId("strip").replaceChildren(...strip);
      byId("strip").hidden = byId("now").hidden = !this.steps.length;
      this.rows = this.steps.map((one) => {
        const row = make("button", "step-row"), time = make("span", "time", one.begin.toFixed(2) + " s");
        row.type = "button";
        row.append(make("span", "", named(one)), time);
        row.title = "Click: go there. Twice: play this step again and again.";
        row.addEventListener("click", () => clock.jump(one.begin));
        row.addEventListener("dblclick", () => { clock.view([one.begin, one.end]); clock.play(); });
        return row;
      });
      const list = byId("steps"), stops = run.stops || [];
      list.hidden = !this.steps.length;
      const folded = make("details", "opened");
      folded.open = true;
      folded.append(make("summary", "", counted(this.steps.length, stops.length)));
      this.steps.forEach((one, k) => {
        const next = k + 1 < this.steps.length ? this.steps[k + 1].begin : Infinity;
        const here = stops.filter((stop) => one.begin < stop.t && stop.t <= next);
        folded.append(this.rows[k], ...here.map((stop) => this.stopRow(stop)));
      });
      list.replaceChildren(folded);
      this.said = null;
      this.say();
    }

    stopRow(stop) {
      const row = make("button", "step-row stop-row"), time = make("span", "time", stop.t.toFixed(2) + " s");
      row.type = "button";
      row.append(make("span", "", `stops: ${stop.why}`), time);
      row.addEventListener("click", () => this.clock.jump(stop.t));
      return row;
    }

    say() {
      if (!this.steps.length) return;
      const now = at(this.steps, this.clock.time), k = this.steps.indexOf(now);
      if (this.said === k) return;
      this.said = k;
      byId("now").textContent = named(now);
      this.rows.forEach((row, i) => row.classList.toggle("selected", i === k));
    }
  }
  const hasEvents = (run) => (run.segments || []).some((one) => EVENTS.includes(one.kind));
  return { Steps, hasEvents };
})();
