"use strict";
// How several runs share the scene: all in one place, one after another, or side by side in a grid, each with its obstacles.
const OptiPlanArrangement = (() => {
  const THREE = MeshCat.THREE, GAP = 1.12;
  const MODES = [["together", "in one place"], ["turn", "one after another"], ["beside", "side by side"]];

  class Arrangement {
    // `shown(k)`: whether run k has a place in the grid.
    constructor(scene, shown) {
      Object.assign(this, { scene, shown, mode: "together", narrow: scene.box.clone() });
    }

    // How wide what is drawn of a run is along an axis of the problem's world, m.
    width(axis) {
      const { root } = this.scene, size = this.narrow.getSize(new THREE.Vector3()), along = root.localToWorld(new THREE.Vector3(...axis)).sub(root.localToWorld(new THREE.Vector3()));
      return GAP * (Math.abs(along.x) * size.x + Math.abs(along.y) * size.y + Math.abs(along.z) * size.z);
    }

    // Where run k stands, m, in the problem's world: rows along y, as many of them as columns.
    offset(k) {
      if (this.mode !== "beside") return [0, 0, 0];
      const order = this.scene.runs.map((_, j) => j).filter((j) => this.shown(j)), place = order.indexOf(k), columns = Math.ceil(Math.sqrt(order.length));
      if (place < 0) return [0, 0, 0];
      return [-Math.floor(place / columns) * this.width([1, 0, 0]), -(place % columns) * this.width([0, 1, 0]), 0].map((x) => x + 0);
    }

    // The obstacles once more at each place of the grid but the first, whose they are; runs with obstacles of their own bring them.
    furnish() {
      this.scene.scenery.clear();
      if (this.mode !== "beside" || this.scene.data.several) return;
      const copy = (mesh) => { // not red: what touches stands elsewhere
        const data = mesh.userData, { base = mesh.material, look = {}, ...own } = data;
        mesh.userData = {}; // three.js copies it as text, which materials are not
        const made = Object.assign(mesh.clone(), { userData: own, material: base });
        mesh.userData = data;
        this.scene.painter.paint(made, { through: Boolean(look.through) });
        return made;
      };
      this.scene.runs.forEach((run, k) => {
        const by = this.offset(k);
        if (!this.shown(k) || by.every((x) => x === 0)) return;
        const stand = new THREE.Group();
        stand.position.fromArray(by);
        for (const mesh of this.scene.layers.obstacle.children) if (!mesh.userData.plane) stand.add(copy(mesh));
        for (const mesh of this.scene.runs[0].figure.bodies[0].children) stand.add(copy(mesh));
        stand.run = run;
        this.scene.scenery.add(stand);
      });
    }

    set(mode) {
      const { scene } = this;
      const layout = mode + scene.runs.map((_, k) => Number(this.shown(k))).join("");
      if (layout === this.layout) return;
      Object.assign(this, { mode, layout });
      scene.box.copy(this.narrow);
      scene.runs.forEach((run, k) => {
        const by = this.offset(k), origin = scene.root.localToWorld(new THREE.Vector3());
        for (const part of [run.figure, run.objects.group, run.witness, run.path, run.ellipsoids && run.ellipsoids.group]) if (part) part.position.fromArray(by);
        if (mode === "beside" && !this.shown(k)) return;
        scene.box.union(this.narrow.clone().translate(scene.root.localToWorld(new THREE.Vector3(...by)).sub(origin)));
      });
      const seen = scene.failures.filter((one) => one.on);
      OptiPlanFailure.only(scene.failures, () => false); // while they have the bodies that they made red
      this.furnish();
      for (const failure of scene.failures) failure.fill();
      OptiPlanFailure.only(seen, () => true);
      scene.frame();
      scene.dirty();
    }

    // The rod belongs to the selected run.
    follow(k) { this.scene.layers.rod.position.fromArray(this.offset(k)); }
  }
  return { Arrangement, MODES };
})();
