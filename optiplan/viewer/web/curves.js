"use strict";
// Curves over time, drawn by uPlot: limits, dots at extrema, one cursor, a key that singles out a series.
//
//   const plot = new OptiPlanCurves.Plot(element, {
//     title: "velocity", unit: "rad/s",
//     series: [{ name: "joint 1", t: [...], y: [...],       // t rises; the series of one plot may have times of their own
//                low: -2.2, high: 2.2,                       // limits, or null
//                extrema: [[0.4, 2.1]],                      // [t, y] to be marked
//                colour: "#1769aa", width: 2, dash: [4, 4], step: false, fill: "css colour" }],
//     share: false,             // true: each series as a share of its limits, -1 to 1
//     asinh: 1,                 // optional: linear up to this value, logarithmic beyond
//     most: 0.2,                // optional: what is larger is not shown
//     bands: [[t0, t1]],        // optional: stretches of time drawn in red
//     marks: [{ t, y, words }], // optional: points to click on, which seek
//     said: "…",                // optional: a sentence beside the title
//     axis: [low, high], end,   // optional: what both axes show, where several plots are to be compared
//     range: [from, to],        // optional: the stretch of time that is shown; null for all
//     onSeek: (t) => …, onHover: (name or null) => …,
//     onRange: ([from, to] or null) => … });   // wheel and drag with shift zoom, a double click shows all again
//   plot.feed(t, columns, from);   // of a curve that goes on while it is looked at
//   plot.time(t); plot.single(name or null); plot.say(text); plot.set(spec); plot.destroy();
const OptiPlanCurves = (() => {
  const COLOURS = ["#4477aa", "#ee6677", "#228833", "#b58a00", "#2ba3c4", "#aa3377", "#8a6d5c", "#7a7fd1", "#d97b2b", "#5f9e8f", "#c2577e", "#6b7a0f", "#3b5bb5", "#9a9a9a"];
  const FAR = 2.5; // limits beyond this multiple of the curves are not shown: they would flatten the curves
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  function make(tag, className, text) {
    const element = document.createElement(tag);
    if (className) element.className = className;
    if (text !== undefined) element.textContent = text;
    return element;
  }

  function digits(value) {
    if (value === null || !Number.isFinite(value)) return "–";
    const size = Math.abs(value);
    return size < 1e-12 ? "0" : size >= 1000 ? value.toFixed(0) : size < 1e-3 ? value.toExponential(1) : value.toPrecision(3);
  }

  // Ticks of an axis that is logarithmic beyond `unit`.
  function decades(unit, low, high) {
    const found = [0];
    for (let size = unit; size < Math.max(-low, high); size *= 10) {
      for (const v of [size, ...(high > 30 * unit ? [] : [3 * size])]) { if (v <= high) found.push(v); if (-v >= low) found.unshift(-v); }
    }
    return found;
  }

  // The value of a series at t, by a straight line between its samples; a step holds the last value. null outside.
  function valueAt(series, t) {
    const { t: times, y } = series, last = times.length - 1;
    if (last < 0 || t < times[0] - 1e-9 || t > times[last] + 1e-6) return null;
    let low = 0, high = last;
    while (high - low > 1) { const middle = (low + high) >> 1; if (times[middle] <= t) low = middle; else high = middle; }
    if (high === low || t <= times[low] || (series.step && t < times[high])) return y[low];
    if (series.step || t >= times[high]) return y[high];
    return y[low] + ((y[high] - y[low]) * (t - times[low])) / (times[high] - times[low]);
  }

  // A series as a share of its limits: 0 in their middle, ±1 at each.
  function shared(series) {
    if (!Number.isFinite(series.low ?? NaN) || !Number.isFinite(series.high ?? NaN) || series.high <= series.low) return null;
    const middle = 0.5 * (series.low + series.high), half = 0.5 * (series.high - series.low), share = (v) => (v - middle) / half;
    return { ...series, y: Array.from(series.y, share), low: -1, high: 1, extrema: (series.extrema || []).map(([t, v]) => [t, share(v)]) };
  }

  // What the axis of a plot must show, [low, high]: the curves, and limits that do not flatten them.
  function range({ series, most, asinh }) {
    let low = Infinity, high = -Infinity;
    for (const { y } of series) for (const v of y) if (v !== null && Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
    if (!(low <= high)) return [-1, 1];
    if (most !== undefined) high = Math.min(high, most);
    if (asinh) return [Math.min(0, 1.3 * low), 1.6 * Math.max(high, asinh)];
    const size = Math.max(Math.abs(low), Math.abs(high)) || 1;
    for (const one of series) for (const limit of [one.low ?? null, one.high ?? null]) {
      if (limit !== null && Number.isFinite(limit) && Math.abs(limit) <= FAR * size) { low = Math.min(low, limit); high = Math.max(high, limit); }
    }
    const room = 0.06 * (high - low || size);
    return [low - room, high + room];
  }

  class Plot {
    constructor(parent, spec) {
      this.root = make("div", "curves");
      this.head = make("div", "head");
      this.canvas = make("div", "canvas");
      this.key = make("div", "key");
      this.root.append(this.head, this.canvas, this.key);
      parent.append(this.root);
      this.now = 0;
      this.name = null; // the series that is singled out
      this.set(spec);
      this.watch = new ResizeObserver(() => this.resize());
      this.watch.observe(this.canvas);
    }

    destroy() { this.watch.disconnect(); if (this.plot) this.plot.destroy(); this.root.remove(); }

    set(spec) {
      this.spec = spec;
      this.all = spec.series.map((one, k) => ({ colour: COLOURS[k % COLOURS.length], extrema: [], low: null, high: null, ...one }));
      this.series = spec.share ? this.all.map(shared).filter(Boolean) : this.all;
      this.unit = spec.share ? "of the limit" : spec.unit || "";
      if (!this.series.some((one) => one.name === this.name)) this.name = null;
      this.fillHead();
      this.fillKey();
      this.draw();
      this.time(this.now);
    }

    fillHead() {
      this.head.replaceChildren(make("b", "", this.spec.title), make("span", "", this.unit));
      this.said = make("span", "said", this.spec.said || "");
      this.head.append(this.said);
    }

    // A sentence beside the title.
    say(text) { if (this.said.textContent !== text) this.said.textContent = text; }

    fillKey() {
      this.values = [];
      this.key.replaceChildren(...this.series.map((one) => {
        const button = make("button"), swatch = make("i"), value = make("span", "value");
        button.type = "button";
        swatch.style.background = one.colour.startsWith("--") ? `var(${one.colour})` : one.colour;
        button.append(swatch, one.name, value);
        button.setAttribute("aria-pressed", "false");
        button.addEventListener("click", () => { this.pinned = this.pinned === one.name ? null : one.name; this.hover(this.pinned); });
        button.addEventListener("pointerenter", () => this.hover(one.name));
        button.addEventListener("pointerleave", () => this.hover(this.pinned || null));
        this.values.push(value);
        return button;
      }));
      this.key.hidden = !this.series.length;
    }

    data() {
      if (!this.series.length) return [[0, 1]];
      const tables = this.series.map((one) => [one.t, one.y]);
      if (tables.every(([t]) => t === tables[0][0])) return [tables[0][0], ...tables.map(([, y]) => y)];
      return uPlot.join(tables.map((table) => table.map((column) => Array.from(column))));
    }

    draw() {
      if (this.plot) this.plot.destroy();
      const { clientWidth: width, clientHeight: height } = this.canvas, [low] = this.spec.axis || range({ ...this.spec, series: this.series }), data = this.data();
      const axis = { stroke: () => css("--soft"), grid: { stroke: () => css("--axis"), width: 1 }, ticks: { show: false }, font: "11px system-ui, sans-serif" };
      const limits = () => this.spec.axis || range({ ...this.spec, series: this.series });
      const y = this.spec.asinh ? { distr: 4, asinh: this.spec.asinh, range: limits } : { range: limits };
      const end = Math.max(...data[0].slice(-1), this.spec.end || 0, 1e-9);
      const line = (one) => ({
        label: one.name, stroke: one.colour.startsWith("--") ? () => css(one.colour) : one.colour, width: one.width || 1.5, dash: one.dash, spanGaps: true, points: { show: false },
        ...(one.step ? { paths: uPlot.paths.stepped({ align: 1 }) } : {}), ...(one.fill ? { fill: () => css(one.fill), fillTo: Math.max(0, low) } : {}),
      });
      this.plot = new uPlot({
        width: Math.max(60, width), height: Math.max(40, height), padding: [6, 18, 0, 0], legend: { show: false },
        series: [{}, ...this.series.map(line)],
        scales: { x: { time: false, range: () => this.spec.range || [0, end] }, y },
        axes: [{ ...axis, size: 22, gap: 2, values: (_, ticks) => ticks.map((v) => String(+v.toFixed(6)) + (v === ticks[ticks.length - 1] ? " s" : "")) },
          { ...axis, ...(this.spec.asinh ? { splits: (_, __, least, most) => decades(this.spec.asinh, least, most) } : {}), size: 46, gap: 3, space: 26, values: (_, ticks) => ticks.map((v) => (v === null ? "" : this.spec.share ? Math.round(100 * v) + " %" : String(+v.toPrecision(4)))) }],
        cursor: { y: false, x: false, drag: { x: false, y: false }, points: { show: false }, focus: { prox: this.series.length > 1 ? 18 : -1 } },
        focus: { alpha: 0.22 },
        hooks: { drawClear: [(u) => this.paintBands(u)], draw: [(u) => { this.paintLimits(u); this.place(); }], setSeries: [(u, k, how) => { if ("focus" in how && !this.asked) this.hover(k === null ? this.pinned || null : this.series[k - 1].name, true); }] },
      }, data, this.canvas);
      this.shape = `${width}x${height}`;
      this.end = end;
      this.line = make("div", "now");
      this.chosen = make("div", "chosen");
      this.chosen.hidden = true;
      this.plot.over.append(this.line, this.chosen);
      this.marks = (this.spec.marks || []).map((mark) => this.addMark(mark));
      this.addSeeking(this.plot.over);
      this.focus(this.name);
    }

    addMark(mark) {
      const button = make("button", "mark");
      button.type = "button";
      button.title = mark.words;
      button.setAttribute("aria-label", mark.words);
      button.addEventListener("pointerdown", (event) => event.stopPropagation());
      button.addEventListener("click", () => this.spec.onSeek && this.spec.onSeek(mark.t));
      this.plot.over.append(button);
      return button;
    }

    // What lies over the drawing, once its scales are known.
    place() {
      this.marks.forEach((button, k) => {
        button.style.left = this.plot.valToPos(this.spec.marks[k].t, "x") + "px";
        button.style.top = this.plot.valToPos(this.spec.marks[k].y, "y") + "px";
      });
      this.time(this.now);
    }

    addSeeking(over) {
      const seek = (event) => {
        const t = this.plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x");
        if (this.spec.onSeek) this.spec.onSeek(Math.min(this.plot.scales.x.max, Math.max(0, t)));
      };
      const at = (event) => this.plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x");
      let from = null; // where a range begins that is being drawn
      over.addEventListener("pointerdown", (event) => {
        over.setPointerCapture(event.pointerId);
        if (event.shiftKey && this.spec.onRange) { from = at(event); this.choose(from, from); return; }
        this.dragged = true;
        seek(event);
      });
      over.addEventListener("pointermove", (event) => { if (this.dragged) seek(event); else if (from !== null) this.choose(from, at(event)); });
      for (const name of ["pointerup", "pointercancel"]) over.addEventListener(name, (event) => {
        this.dragged = false;
        if (from !== null && name === "pointerup" && Math.abs(at(event) - from) > 0.01 * this.end) this.spec.onRange([from, at(event)]);
        from = null;
        this.chosen.hidden = true;
      });
      if (!this.spec.onRange) return;
      over.addEventListener("wheel", (event) => {
        event.preventDefault();
        const [low, high] = this.spec.range || [0, this.end], middle = Math.min(high, Math.max(low, at(event))), factor = Math.exp(0.0015 * event.deltaY);
        const wish = [Math.max(0, middle - factor * (middle - low)), Math.min(this.end, middle + factor * (high - middle))];
        if (wish[1] - wish[0] > 0.002 * this.end) this.spec.onRange(wish[0] <= 0 && wish[1] >= this.end ? null : wish);
      }, { passive: false });
      over.addEventListener("dblclick", () => this.spec.onRange(null));
    }

    // A band over the range that is being drawn.
    choose(from, to) {
      const [left, right] = [from, to].map((t) => this.plot.valToPos(t, "x")).sort((a, b) => a - b);
      this.chosen.hidden = false;
      Object.assign(this.chosen.style, { left: left + "px", width: right - left + "px" });
    }

    // Shows a stretch of time; null for all.
    zoom(range) {
      if (JSON.stringify(range) === JSON.stringify(this.spec.range || null)) return;
      this.spec.range = range;
      if (this.plot) this.plot.setScale("x", { min: range ? range[0] : 0, max: range ? range[1] : this.end });
      this.time(this.now);
    }

    // Other samples of the same series: times t (k,) rise, a column (k,) a series; shown from `from` on, s.
    feed(t, columns, from) {
      this.series.forEach((one, k) => { one.t = t; one.y = columns[k]; });
      this.spec.range = [from, Math.max(t[t.length - 1], from + 1e-3)];
      this.plot.setData([t, ...columns]);
      this.time(t[t.length - 1]);
    }

    paintBands(u) {
      u.ctx.save();
      u.ctx.fillStyle = css("--limit");
      u.ctx.globalAlpha = 0.16;
      for (const [from, to] of this.spec.bands || []) {
        const x = u.valToPos(from, "x", true);
        u.ctx.fillRect(x, u.bbox.top, Math.max(2, u.valToPos(to, "x", true) - x), u.bbox.height);
      }
      u.ctx.restore();
    }

    // Limits, dashed: those of the series that is singled out, else those of all.
    paintLimits(u) {
      const { ctx, bbox } = u, drawn = new Set();
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      ctx.clip();
      for (const one of this.series) {
        const other = this.name !== null && this.name !== one.name;
        if (other) continue;
        const colour = one.colour.startsWith("--") ? css(one.colour) : one.colour;
        for (const limit of [one.low, one.high]) {
          if (limit === null || !Number.isFinite(limit) || drawn.has(limit)) continue;
          drawn.add(limit);
          const equal = this.series.every((each) => each.low === one.low && each.high === one.high), y = u.valToPos(limit, "y", true);
          ctx.strokeStyle = equal || this.name ? css("--limit") : colour;
          ctx.globalAlpha = equal || this.name ? 0.9 : 0.45;
          ctx.lineWidth = devicePixelRatio;
          ctx.setLineDash([5 * devicePixelRatio, 4 * devicePixelRatio]);
          ctx.beginPath();
          ctx.moveTo(bbox.left, y);
          ctx.lineTo(bbox.left + bbox.width, y);
          ctx.stroke();
        }
        ctx.globalAlpha = 1;
        ctx.fillStyle = colour;
        for (const [t, v] of one.extrema) {
          ctx.beginPath();
          ctx.arc(u.valToPos(t, "x", true), u.valToPos(v, "y", true), (this.name ? 4 : 2.6) * devicePixelRatio, 0, 7);
          ctx.fill();
        }
      }
      ctx.restore();
    }

    hover(name, own = false) {
      if (name === this.name) return;
      this.focus(name, own);
      if (this.spec.onHover) this.spec.onHover(name);
    }

    // Singles out a series here, without telling anybody.
    single(name) { if (name !== this.name) this.focus(this.series.some((one) => one.name === name) ? name : null); }

    focus(name, own = false) {
      this.name = name;
      [...this.key.children].forEach((button, k) => button.setAttribute("aria-pressed", String(this.series[k].name === name)));
      if (!this.plot) return;
      this.asked = true;
      const k = this.series.findIndex((one) => one.name === name);
      if (!own) this.plot.setSeries(k < 0 ? null : k + 1, { focus: true });
      else this.plot.redraw(false, false);
      this.asked = false;
    }

    time(t) {
      this.now = t;
      if (this.line && this.plot.scales.x.max) {
        const { min, max } = this.plot.scales.x;
        this.line.style.transform = `translateX(${this.plot.valToPos(Math.min(Math.max(t, min), max), "x").toFixed(1)}px)`;
        this.line.hidden = t < min || (t > max && max < this.end);
      }
      this.series.forEach((one, k) => {
        const value = valueAt(one, t), text = this.spec.share && value !== null ? Math.round(100 * value) + " %" : digits(value);
        if (this.values[k].textContent !== text) this.values[k].textContent = text;
      });
    }

    resize() {
      const { clientWidth: width, clientHeight: height } = this.canvas;
      if (!width || !height || this.shape === `${width}x${height}`) return;
      this.draw(); // marks have places of their own: begin again
      this.time(this.now);
    }

    // After a change of colours.
    redraw() { if (this.plot) this.plot.redraw(false, true); }
  }
  return { Plot, range, valueAt, shared, digits, make, css, COLOURS };
})();
