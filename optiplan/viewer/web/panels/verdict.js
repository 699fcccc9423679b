"use strict";
// The verdict, opened: every check with its figures, what it is about, and which pairs of bodies it leaves out.
const OptiPlanVerdict = (() => {
  const { make, digits } = OptiPlanCurves;
  const KINDS = {
    exact: "holds at all times, from the exact extrema of the motion's polynomials, or from data",
    continuous: "proved for all times, by halving intervals of time",
    sampled: "holds at the checked instants",
    unchecked: "there is no limit to compare with",
  };
  const BADGES = { verified: "good", executed: "good", "not checked": "open" };
  // The curve on which a check is seen.
  const CURVES = { position: "position", start: "position", goal: "position", velocity: "velocity", rest: "velocity", acceleration: "acceleration", continuity: "acceleration", jerk: "jerk", torque: "torque", collision: "clearance", contact: "clearance" };

  // What a person asks first; the others follow in the verifier's order.
  const ORDER = ["collision", "contact", "position", "velocity", "acceleration", "jerk", "torque", "path_constraint", "goal", "start", "rest"];
  const TRIVIAL = new Set(["finite", "joints", "continuity", "statements", "samples", "duration"]); // hold of every motion that is one: told when they fail

  const rank = (check) => { const place = ORDER.findIndex((name) => check.name.startsWith(name)); return (check.passed ? 100 : 0) + (place < 0 ? ORDER.length : place); };

  function ordered(checks) {
    const sorted = checks.map((check, k) => [check, k]).sort(([a, i], [b, j]) => rank(a) - rank(b) || i - j).map(([check]) => check);
    return [sorted.filter((check) => !check.passed || !TRIVIAL.has(check.name)), sorted.filter((check) => check.passed && TRIVIAL.has(check.name))];
  }

  const badge = (run) => make("span", "badge " + (BADGES[run.badge] || "bad"), run.badge);

  function figures(check) {
    if (check.name === "contact") return check.worst === null ? "" : `overlap ${digits(-1e3 * check.worst)} mm`;
    if (check.name === "collision" && check.worst !== null) {
      const shown = check.proved ?? check.worst;
      if ((check.own ?? null) !== null && (check.scene ?? null) !== null) return `scene ${digits(1e3 * check.scene)}, itself ${digits(1e3 * check.own)} mm proved, > ${digits(1e3 * (check.limit || 0))}`;
      return `${digits(1e3 * shown)} mm ${check.proved === null || check.proved === undefined ? "met" : "proved"}, > ${digits(1e3 * (check.limit || 0))}`;
    }
    if (check.worst === null || check.worst === undefined) return "";
    const limit = check.limit === null || check.limit === undefined ? "" : ` of ${digits(check.limit)}`;
    return `${digits(check.worst)}${limit} ${check.unit}`;
  }

  function bar(check) {
    const outer = make("span", "share"), inner = make("span");
    if (check.share === null || check.share === undefined) { outer.classList.add("none"); return outer; }
    inner.style.width = Math.min(100, 100 * Math.abs(check.share)) + "%";
    outer.title = `${(100 * check.share).toPrecision(3)} % of the limit`;
    outer.append(inner);
    return outer;
  }

  // `jump(check)` is called with the row that was asked for.
  function row(check, jump) {
    const button = make("button", "check " + (check.passed ? "" : "failed"));
    button.type = "button";
    const where = [check.joint || (check.name === "collision" ? check.place : ""), check.time === null || check.time === undefined ? "" : `${check.time.toFixed(3)} s`].filter(Boolean).join(" · ");
    const kind = make("span", "kind", check.kind);
    kind.title = KINDS[check.kind] || "";
    button.append(make("span", "mark", check.passed ? (check.kind === "unchecked" ? "–" : "✓") : "✗"), make("span", "what", check.name), kind, bar(check), make("span", "figures", figures(check)), make("span", "where", where));
    button.title = check.detail || "";
    button.disabled = check.time === null || check.time === undefined;
    button.addEventListener("click", () => jump(check));
    return button;
  }

  function folded(title, ...inside) {
    const details = make("details", "more");
    details.append(make("summary", "", title), ...inside);
    return details;
  }

  function list(texts) {
    const found = make("ul");
    found.append(...texts.map((text) => make("li", "", text)));
    return found;
  }

  function about(run) {
    const told = [], { statements, geometry, over_cover: cover, unchecked, notes } = run.about;
    told.push(list(statements));
    const shapes = Object.entries(geometry).map(([link, kind]) => `${link}: ${kind}${cover[link] ? `, at most ${digits(1e3 * cover[link])} mm beyond its meshes` : ""}`);
    if (shapes.length) told.push(folded(`geometry used, ${shapes.length} links`, list(shapes)));
    const count = Object.values(unchecked).reduce((sum, pairs) => sum + pairs.length, 0);
    if (count) told.push(folded(`${count} pairs not checked, and why`, ...Object.entries(unchecked).map(([why, pairs]) => folded(`${pairs.length} ${why}`, list(pairs)))));
    if (notes.length) told.push(folded("notes on the robot", list(notes)));
    return folded("what the verdict is about", ...told);
  }

  // What a planner refused: a contact, as a row to jump to.
  function refused(run) {
    return run.witnesses.filter((one) => one.time !== undefined && !run.checks.some((check) => check.time === one.time)).map((one) => ({
      name: "contact", kind: "", passed: false, worst: one.distance, proved: null, limit: null, unit: "m", share: null, time: one.time, place: one.pair.join(" – "), joint: one.pair.join(" – "), detail: run.problems[0],
    }));
  }

  // Fills `element` with a run's facts, checks, scope, and how it was found.
  function fill(element, run, jump) {
    const facts = make("dl", "facts");
    for (const [name, value] of run.facts) facts.append(make("dt", "", name), make("dd", "", value));
    const told = [facts, ...run.problems.map((text) => make("p", "problem", text))];
    const contacts = refused(run);
    if (contacts.length && run.path) { const rows = make("div", "checks"); rows.append(...contacts.map((one) => row(one, jump))); told.push(rows); }
    if (run.checks.length) {
      const checks = make("div", "checks"), failed = run.checks.filter((check) => !check.passed).length;
      checks.setAttribute("role", "group");
      checks.setAttribute("aria-label", "Checks");
      const [asked, trivial] = ordered(run.checks);
      checks.append(...asked.map((check) => row(check, jump)));
      const details = make("details", "opened");
      details.open = true;
      details.append(make("summary", "", failed ? `${failed} of ${run.checks.length} checks failed` : `${run.checks.length} check${run.checks.length === 1 ? "" : "s"} passed`), checks);
      if (trivial.length) {
        const rows = make("div", "checks");
        rows.append(...trivial.map((check) => row(check, jump)));
        details.append(folded(`${trivial.length} that hold of any motion`, rows));
      }
      told.push(details);
    }
    if (run.about) told.push(about(run));
    const found = OptiPlanAttempts.section(run);
    if (found) told.push(found);
    element.replaceChildren(...told);
  }

  return { fill, badge, figures, CURVES };
})();
