"use strict";
// The last seconds of what runs, as curves with axes and limits.
const Strips = (() => {
  const WINDOW = 12, REST = 150; // s that are shown; ms between two pictures
  const { Plot, COLOURS } = OptiPlanCurves;

  // `specs`: as of OptiPlanCurves.Plot, each with `values(state)`, which returns one value a series, null where there is none.
  class Strips {
    constructor(element, specs) {
      element.replaceChildren();
      this.strips = specs.map((spec) => {
        const box = Object.assign(document.createElement("div"), { className: "strip" });
        element.append(box);
        const series = spec.series.map((one) => ({ t: [0], y: [null], ...one }));
        return { spec, plot: new Plot(box, { ...spec, series }), columns: series.map(() => []) };
      });
      Object.assign(this, { t: [], drawn: 0 });
    }

    add(state) {
      this.t.push(state.t);
      for (const one of this.strips) one.spec.values(state).forEach((value, k) => one.columns[k].push(value));
      let old = 0;
      while (this.t[old] < state.t - WINDOW) old++;
      if (old) { this.t.splice(0, old); for (const one of this.strips) for (const column of one.columns) column.splice(0, old); }
      if (performance.now() - this.drawn < REST) return;
      this.drawn = performance.now();
      for (const one of this.strips) one.plot.feed(this.t.slice(), one.columns.map((column) => column.slice()), Math.max(0, state.t - WINDOW));
    }

    destroy() { for (const one of this.strips) one.plot.destroy(); }
  }

  // The velocities of the joints as shares of their limits; what has none is left out.
  function joints(names, limits) {
    const kept = names.map((name, j) => [name, j]).filter(([, j]) => limits[j] !== null);
    return {
      title: "joint velocities", unit: "of the limit", axis: [-1.15, 1.15],
      series: kept.map(([name], k) => ({ name, low: -1, high: 1, colour: COLOURS[k % COLOURS.length] })),
      values: ({ v }) => kept.map(([, j]) => (v ? v[j] / limits[j] : null)),
    };
  }

  return { Strips, joints };
})();
