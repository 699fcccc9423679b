"use strict";
// Number fields, with units, for what is chosen in the scene: an obstacle, or a pose of the file.
const StudioCard = (() => {
  const { make } = Page, DEGREE = Math.PI / 180;
  const shown = (x, unit) => String(Number(x.toFixed(unit === "m" ? 4 : 2)) + 0);

  const put = (values, k, value) => values.map((one, j) => (j === k ? value : one));

  // Fields of a row: `typed(k, value)` hears which one has changed. What is wished of it is a function of what then stands in
  // the scene, which may be drawn anew by then: nothing but what was typed is changed.
  function row(label, unit, values, names, typed, step) {
    const inputs = values.map((value, k) => {
      const input = make("input", { type: "number", step, value: shown(value, unit), ariaLabel: `${label} ${names[k] || ""}, ${unit}` });
      input.addEventListener("change", () => { if (input.value === "" || !Number.isFinite(Number(input.value))) return; typed(k, Number(input.value)); });
      return input;
    });
    return make("div", { className: "row" }, make("span", { textContent: `${label}, ${unit}` }), make("div", {}, ...inputs));
  }

  function poseRows(pose, changed) {
    const turned = PoseText.angles(pose.slice(3)).map((x) => x / DEGREE);
    const turn = (quaternion, k, value) => PoseText.fromAngles(put(PoseText.angles(quaternion), k, value * DEGREE));
    return [
      row("Position", "m", pose.slice(0, 3), ["x", "y", "z"], (k, value) => changed((now) => put(now, k, value)), 0.01),
      row("Turned", "°", turned, ["about x", "about y", "about z"], (k, value) => changed((now) => [...now.slice(0, 3), ...turn(now.slice(3), k, value)]), 5),
    ];
  }

  // Sizes of a shape as the file says it.
  function sizeRows(shape, changed) {
    const [kind] = Object.keys(shape), of = shape[kind];
    if (kind === "box") return [row("Size", "m", of, ["x", "y", "z"], (k, value) => changed(({ box }) => ({ box: put(box, k, value) })), 0.01)];
    if (kind === "sphere") return [row("Radius", "m", [of], [], (_, value) => changed(() => ({ sphere: value })), 0.01)];
    if (kind === "cylinder" || kind === "capsule") {
      const size = (key, label) => row(label, "m", [of[key]], [], (_, value) => changed((now) => ({ [kind]: { ...now[kind], [key]: value } })), 0.01);
      return [size("radius", "Radius"), size("length", "Length")];
    }
    return [];
  }

  const button = (textContent, onclick, className = "") => make("button", { type: "button", textContent, onclick, className });

  // An obstacle: {name, shape, pose}; does(what, wish) hears "pose", "shape", "double", "remove".
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
