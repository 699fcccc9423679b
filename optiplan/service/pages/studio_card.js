"use strict";
// Number fields, with units, for what is chosen in the scene: an obstacle, or a pose of the file.
const StudioCard = (() => {
  const { make } = Page, DEGREE = Math.PI / 180;
  const shown = (x, unit) => String(Number(x.toFixed(unit === "m" ? 4 : 2)) + 0);

  // Fields of a row: `said(values)` hears all of them when one has changed, the others with all their digits.
  function row(label, unit, values, names, said, step) {
    const now = [...values], inputs = values.map((value, k) => {
      const input = make("input", { type: "number", step, value: shown(value, unit), ariaLabel: `${label} ${names[k] || ""}, ${unit}` });
      input.addEventListener("change", () => { if (input.value === "" || !Number.isFinite(Number(input.value))) return; now[k] = Number(input.value); said([...now]); });
      return input;
    });
    return make("div", { className: "row" }, make("span", { textContent: `${label}, ${unit}` }), make("div", {}, ...inputs));
  }

  // What was typed in one row goes with what is typed in the next: the scene may not be drawn anew between them.
  function poseRows(pose, changed) {
    const turned = PoseText.angles(pose.slice(3)).map((x) => x / DEGREE), now = [...pose];
    const typed = (at, values) => { now.splice(at, values.length, ...values); changed([...now]); };
    return [
      row("Position", "m", pose.slice(0, 3), ["x", "y", "z"], (xyz) => typed(0, xyz), 0.01),
      row("Turned", "°", turned, ["about x", "about y", "about z"], (rpy) => typed(3, PoseText.fromAngles(rpy.map((x) => x * DEGREE))), 5),
    ];
  }

  // Sizes of a shape as the file says it.
  function sizeRows(shape, changed) {
    const [kind] = Object.keys(shape), of = shape[kind];
    if (kind === "box") return [row("Size", "m", of, ["x", "y", "z"], (xyz) => changed({ box: xyz }), 0.01)];
    if (kind === "sphere") return [row("Radius", "m", [of], [], ([radius]) => changed({ sphere: radius }), 0.01)];
    if (kind === "cylinder" || kind === "capsule") {
      const now = { ...of }, typed = (one) => changed({ [kind]: { ...Object.assign(now, one) } });
      return [row("Radius", "m", [of.radius], [], ([radius]) => typed({ radius }), 0.01), row("Length", "m", [of.length], [], ([length]) => typed({ length }), 0.01)];
    }
    return [];
  }

  const button = (textContent, onclick, className = "") => make("button", { type: "button", textContent, onclick, className });

  // An obstacle: {name, shape, pose}; does(what, value) hears "pose", "shape", "double", "remove".
  function obstacle({ name, shape, pose, fixed }, does) {
    return [...sizeRows(shape, (wish) => does("shape", wish)),
      ...(fixed ? [] : poseRows(pose, (wish) => does("pose", wish))),
      make("div", { className: "tools" }, button("Duplicate", () => does("double")), button("Delete", () => does("remove")), button("In the text", () => does("show")))];
  }

  // A pose of the file.
  function handle({ pose }, does) {
    return [...poseRows(pose, (wish) => does("pose", wish)), make("div", { className: "tools" }, button("In the text", () => does("show")))];
  }
  return { obstacle, handle };
})();
