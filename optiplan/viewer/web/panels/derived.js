"use strict";
// Signals that a person makes of curves: the rate of one, the sum or the difference of two. They are a quantity of every run.
const OptiPlanDerived = (() => {
  const { make, valueAt } = OptiPlanCurves;
  const NAME = "derived";
  const KINDS = [["rate", "rate of"], ["sum", "sum of"], ["difference", "difference of"]];
  const SECOND = { sum: "and", difference: "less" };

  const LEAST = 1e-6; // s: samples nearer than this are one, as at knots

  // The samples of a curve whose times rise.
  function rising({ t, y }) {
    const kept = [];
    for (let k = 0; k < t.length; k++) if (!kept.length || t[k] - t[kept[kept.length - 1]] > LEAST) kept.push(k);
    return [Float32Array.from(kept, (k) => t[k]), Float32Array.from(kept, (k) => y[k])];
  }

  // Slopes (k,) of values y (k,) over rising times t (k,): parabolas through three samples, exact for them.
  function rate(t, y) {
    const last = t.length - 1, slope = (i) => (y[i + 1] - y[i]) / (t[i + 1] - t[i]);
    return Float32Array.from(t, (_, k) => {
      if (last < 1) return 0;
      if (last < 2) return slope(0);
      const i = Math.min(last - 1, Math.max(1, k)), before = t[i] - t[i - 1], after = t[i + 1] - t[i], middle = (after * slope(i - 1) + before * slope(i)) / (before + after);
      return k === 0 ? 2 * slope(0) - middle : k === last ? 2 * slope(last - 1) - middle : middle;
    });
  }

  // The signal {kind, a, b} of a run's quantities; a and b are "quantity: series". null where the run has no such curve.
  function made(signal, quantities) {
    const find = (name) => {
      for (const one of quantities) for (const series of one.series) if (`${one.name}: ${series.name}` === name) return { ...series, unit: one.unit };
      return null;
    };
    const a = find(signal.a), b = signal.kind === "rate" ? null : find(signal.b);
    if (!a || (signal.kind !== "rate" && !b)) return null;
    const sign = signal.kind === "sum" ? 1 : -1, plain = { t: a.t, low: null, high: null, extrema: [] };
    if (!b) { const [t, y] = rising(a); return { ...plain, name: `rate of ${signal.a}, ${a.unit}/s`, t, y: rate(t, y) }; }
    const unit = a.unit === b.unit ? a.unit : `${a.unit}, ${b.unit}`;
    return { ...plain, name: `${signal.a} ${sign > 0 ? "+" : "−"} ${signal.b}, ${unit}`, y: Float32Array.from(a.t, (t, k) => a.y[k] + sign * (valueAt(b, t) ?? NaN)) };
  }

  // The quantity of a run that holds all signals, or null.
  function quantity(signals, quantities) {
    const series = signals.map((signal) => made(signal, quantities)).filter(Boolean);
    return series.length ? { name: NAME, unit: "", kind: "made of the curves", of: "signals", series } : null;
  }

  // A form that adds signals, and the list of those that are there; `change()` after each.
  function form(signals, quantities, change) {
    const box = make("details", "derive"), line = make("div", "line"), names = quantities.flatMap((one) => one.series.map((series) => `${one.name}: ${series.name}`));
    const choice = (options, label) => {
      const select = make("select");
      select.setAttribute("aria-label", label);
      select.append(...options.map(([value, text]) => new Option(text, value)));
      return select;
    };
    const curves = names.map((name) => [name, name]), kind = choice(KINDS, "what is made"), a = choice(curves, "curve"), and = make("span"), b = choice(curves, "other curve"), add = make("button", "", "Add");
    add.type = "button";
    if (curves.length > 1) b.selectedIndex = 1;
    const second = () => { and.textContent = SECOND[kind.value] || ""; b.hidden = kind.value === "rate"; };
    kind.addEventListener("change", second);
    second();
    add.addEventListener("click", () => { signals.push({ kind: kind.value, a: a.value, b: kind.value === "rate" ? null : b.value }); change(); });
    line.append(kind, a, and, b, add);
    for (const signal of signals) {
      const remove = make("button", "", `× ${signal.kind} ${signal.a}${signal.b ? `, ${signal.b}` : ""}`);
      remove.type = "button";
      remove.title = "Take this signal away";
      remove.addEventListener("click", () => { signals.splice(signals.indexOf(signal), 1); change(); });
      line.append(remove);
    }
    box.append(make("summary", "", "Derived"), line);
    return box;
  }

  return { NAME, rate, rising, quantity, form };
})();
