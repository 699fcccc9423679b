"use strict";
// How a run was found: its improvements, and every attempt with the duration and the violation of its iterations.
const OptiPlanAttempts = (() => {
  const { make, digits } = OptiPlanCurves;
  const WIDTH = 300, HEIGHT = 84, LEFT = 34, BOTTOM = 12;
  const ENDINGS = {
    converged: "the last steps gained little",
    "trust region": "no step was accepted, however short",
    penetration: "the violation was large or no longer fell",
    "too slow": "it stayed much longer than the best motion, or than at its start",
    "step limit": "it took all steps that the option iterations allows",
    stopped: "the budget was over",
    "contact between samples": "bodies met between its samples",
  };
  const milliseconds = (seconds) => (seconds < 1 ? `${(1e3 * seconds).toFixed(0)} ms` : `${seconds.toFixed(2)} s`);

  function svg(tag, attributes, words) {
    const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
    if (words !== undefined) element.append(words);
    return element;
  }

  // Duration as a line, violation on a logarithmic scale as an area behind it, undone and repaired steps as marks below.
  function chart(log) {
    const { duration, violation, accepted } = log, count = duration.length;
    const low = Math.min(...duration), high = Math.max(...duration, low * 1.001 + 1e-9), floor = HEIGHT - BOTTOM;
    const x = (k) => LEFT + ((WIDTH - LEFT - 6) * k) / Math.max(1, count - 1);
    const y = (T) => 8 + ((floor - 16) * (high - T)) / (high - low);
    const depth = (v) => Math.min(1, Math.max(0, v > 0 ? (Math.log10(v) + 5) / 5 : 0)); // 0.01 mm to 1 m
    const root = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", class: "descent" });
    root.setAttribute("aria-label", `${count} iterations: duration from ${digits(duration[0])} to ${digits(duration[count - 1])} s, violation from ${digits(violation[0])} to ${digits(violation[count - 1])} m`);
    const area = violation.map((v, k) => `${x(k)},${floor - (floor - 8) * depth(v)}`);
    root.append(svg("polygon", { points: `${x(0)},${floor} ${area.join(" ")} ${x(count - 1)},${floor}`, class: "violation" }));
    root.append(svg("polyline", { points: duration.map((T, k) => `${x(k)},${y(T)}`).join(" "), class: "duration" }));
    root.append(svg("text", { x: LEFT - 4, y: y(high) + 4 }, digits(high)), svg("text", { x: LEFT - 4, y: y(low) + 4 }, digits(low)));
    accepted.forEach((how, k) => {
      if (how === 1) return;
      const mark = svg("circle", { cx: x(k), cy: HEIGHT - 6, r: 2.5, class: how ? "repaired" : "undone" });
      mark.append(svg("title", {}, `iteration ${k + 1}: ${how ? "repaired by a second step" : "undone"}, trust region ${digits(log.radius[k])}`));
      root.append(mark);
    });
    return root;
  }

  function counted(log) {
    const of = (how) => log.accepted.filter((each) => each === how).length;
    const parts = [[of(1), "accepted"], [of(0.5), "repaired by a second step"], [of(0), "undone"]];
    return parts.filter(([count]) => count).map(([count, words]) => `${count} ${words}`).join(", ");
  }

  function row(one, number) {
    const details = make("details", "attempt " + (one.free ? "" : "failed"));
    const summary = make("summary"), figures = one.duration === null ? "–" : `${one.duration.toFixed(3)} s`;
    summary.append(make("span", "mark", one.free ? "✓" : "✗"), make("span", "what", `${number}. ${one.begun_at}`), make("span", "figures", figures));
    details.append(summary);
    const told = [`${one.iterations} steps${one.log ? `: ${counted(one.log)}` : ""}.`];
    if (one.ended) told.push(`Ended: ${ENDINGS[one.ended] || one.ended}.`);
    if (one.hindered) told.push(`In the way: ${one.hindered}.`);
    details.append(make("p", "", told.join(" ")));
    // Drawn when it is opened: a page may hold hundreds.
    details.addEventListener("toggle", () => { if (details.open && one.log && !details.querySelector("svg")) details.append(chart(one.log)); });
    return details;
  }

  // The section of a run, or null where its record tells nothing.
  function section(run) {
    const { found } = run;
    if (!found) return null;
    const details = make("details", "more found"), { improvements, attempts } = found, words = [];
    if (attempts.length) words.push(`${attempts.length} attempt${attempts.length > 1 ? "s" : ""}`);
    if (improvements.length) words.push(`first answer after ${milliseconds(improvements[0][0])}`);
    details.append(make("summary", "", `how it was found: ${words.join(", ")}`));
    if (improvements.length) {
      const list = make("ul");
      list.append(...improvements.map(([seconds, duration]) => make("li", "", `after ${milliseconds(seconds)}: ${duration.toFixed(3)} s, verified`)));
      details.append(list);
    }
    if (attempts.some((one) => one.log)) {
      const key = make("p", "descent-key"), name = (className, text) => { const part = make("span"); part.append(make("i", className), text); return part; };
      key.append(name("duration", "duration, s"), name("violation", "violation, 0.01 mm to 1 m"), name("repaired", "repaired"), name("undone", "undone"));
      details.append(key);
    }
    details.append(...attempts.map((one, k) => row(one, k + 1)));
    return details;
  }

  return { section };
})();
