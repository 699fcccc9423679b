"use strict";
// How several runs share the scene: all in one place, one after another, or side by side.
const OptiPlanArrangement = (() => {
  const THREE = MeshCat.THREE, GAP = 1.12;
  const MODES = [["together", "in one place"], ["turn", "one after another"], ["beside", "side by side"]];

  class Arrangement {
    constructor(scene) { Object.assign(this, { scene, mode: "together", narrow: scene.box.clone() }); }

    // Where run k stands, m, in the problem's world.
    offset(k) {
      if (this.mode !== "beside") return [0, 0, 0];
      const size = this.narrow.getSize(new THREE.Vector3()), along = this.scene.root.localToWorld(new THREE.Vector3(0, 1, 0)).sub(this.scene.root.localToWorld(new THREE.Vector3()));
      const width = GAP * (Math.abs(along.x) * size.x + Math.abs(along.y) * size.y + Math.abs(along.z) * size.z);
      return [0, -k * width, 0];
    }

    set(mode) {
      const { scene } = this;
      this.mode = mode;
      scene.box.copy(this.narrow);
      scene.runs.forEach((run, k) => {
        const by = this.offset(k), origin = scene.root.localToWorld(new THREE.Vector3());
        for (const part of [run.figure, run.objects.group, run.witness, run.path, run.ellipsoids && run.ellipsoids.group]) if (part) part.position.fromArray(by);
        scene.box.union(this.narrow.clone().translate(scene.root.localToWorld(new THREE.Vector3(...by)).sub(origin)));
      });
      scene.frame();
      scene.dirty();
    }

    // The rod belongs to the selected run.
    follow(k) { this.scene.layers.rod.position.fromArray(this.offset(k)); }
  }
  return { Arrangement, MODES };
})();
