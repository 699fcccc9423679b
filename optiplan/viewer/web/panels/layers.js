"use strict";
// What is drawn: a checkbox each.
const OptiPlanLayers = (() => {
  const { make } = OptiPlanCurves;

  class Layers {
    constructor(element, changed) { Object.assign(this, { element, changed, boxes: new Map() }); }

    // `first`: whether it is on unless an address says otherwise, which is `checked`.
    add(name, text, first, change, title = "", checked = first) {
      const label = make("label"), box = make("input");
      box.type = "checkbox";
      box.id = "layer-" + name;
      box.checked = checked;
      label.title = title;
      box.addEventListener("change", () => { change(box.checked); this.changed(); });
      label.append(box, text);
      this.element.append(label);
      this.boxes.set(name, { box, change, first });
      change(checked);
    }

    // Switches by name; names of layers that are not there are ignored.
    set(name, on) {
      const found = this.boxes.get(name);
      if (!found || found.box.checked === on) return;
      found.box.checked = on;
      found.change(on);
    }

    // Names of the layers that are on, or null while all are as at first.
    get wish() {
      const all = [...this.boxes.entries()];
      return all.every(([, one]) => one.box.checked === one.first) ? null : all.filter(([, one]) => one.box.checked).map(([name]) => name);
    }

    wanted(names) { for (const name of this.boxes.keys()) this.set(name, names.includes(name)); }
    reset() { for (const [name, one] of this.boxes) this.set(name, one.first); }
  }

  // The layers of a scene; `shown()` draws what of the runs is to be seen.
  function addAll(layers, scene, data, wish, shown) {
    const layer = (name) => (on) => { scene.layers[name].visible = on; scene.dirty(); };
    const ghosts = !data.several, asked = ghosts && wish.get("ghosts") !== "0";
    if (scene.layers.obstacle.children.length) {
      layers.add("obstacles", "Obstacles", true, (on) => { scene.scenery.visible = on; layer("obstacle")(on); shown(); });
      layers.add("through", "See-through", false, (on) => {
        for (const mesh of scene.solid) scene.painter.paint(mesh, { through: on });
        scene.dirty();
      }, "", wish.has("through"));
    }
    if (scene.layers.path.children.length) layers.add("path", "Tool path", true, layer("path"));
    layers.add("start", "Start", ghosts, layer("start"), "outline of the robot at the start", asked);
    if (data.goal || data.targets.length) layers.add("goal", "Goal", ghosts, layer("goal"), "outline of the robot at its end, and axes of the poses to reach", asked);
    if (data.parts.some((part) => part.set === "collision")) layers.add("collision", "Collision shape", false, (on) => switchSets(scene, on ? "collision" : "visual"), "", wish.get("view") === "collision");
    layers.add("floor", "Floor", true, (on) => { scene.stage.floor.visible = on; scene.dirty(false); });
    if (data.runs.some((run) => run.clearance)) layers.add("rod", "Nearest points", true, (on) => { scene.layers.rod.visible = on; scene.rod.show(scene.rod.moment); scene.dirty(false); }, "rod between the nearest two bodies");
    if (data.runs.some((run) => run.path)) layers.add("trail", "Pose trail", false, (on) => { scene.showTrail(on); scene.dirty(); }, "the robot at six instants", wish.has("trail"));
    layers.add("frames", "Frames", false, layer("frames"), "axes of the world and of the tool: x red, y green, z blue", wish.has("frames"));
    if (scene.layers.ellipsoids.children.length) layers.add("ellipsoids", "Ellipsoids", false, layer("ellipsoids"), "Velocity (green) and force (red) of the tool in each direction, for the same effort of all joints", wish.has("ellipsoids"));
    if (data.runs.some((run) => run.witnesses.length)) layers.add("witness", "Where it failed", true, (on) => { scene.layers.witness.visible = on; OptiPlanFailure.only(scene.failures, (one) => on && one.wanted); scene.dirty(false); });
  }

  function switchSets(scene, view) {
    for (const run of scene.runs) run.figure.traverse((o) => { if (["visual", "collision"].includes(o.userData.set)) o.visible = o.userData.set === view; });
    scene.dirty();
  }

  return { Layers, addAll };
})();
