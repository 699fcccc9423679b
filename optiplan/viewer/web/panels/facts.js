"use strict";
// Figures in words, and the order of runs.
const OptiPlanFacts = (() => {
  function millimetres(metres) {
    const value = 1e3 * metres, size = Math.abs(value);
    return (size >= 100 ? value.toFixed(0) : size >= 10 ? value.toFixed(1) : value.toFixed(2)) + " mm";
  }

  // How good a duration is, in words a person knows; `ratio` to the least possible time for the end that was reached, or
  // for the places where a task stops.
  function quality(ratio, ofStops) {
    const more = 100 * (ratio - 1), least = `the least possible time ${ofStops ? "from stop to stop" : "for this end"}`;
    return more < 0.5 ? `within 0.5 % of ${least}` : `${more < 10 ? more.toFixed(1) : more.toFixed(0)} % above ${least}`;
  }

  // Verified runs first, then refused ones, both by duration; then those without a motion: [run, its index] each.
  function sorted(runs) {
    const rank = (run) => (run.badge === "verified" ? 0 : run.row.duration === null ? 2 : 1);
    return runs.map((run, k) => [run, k]).sort(([a, i], [b, j]) => rank(a) - rank(b) || (a.row.duration || 0) - (b.row.duration || 0) || i - j);
  }

  return { millimetres, quality, sorted };
})();
