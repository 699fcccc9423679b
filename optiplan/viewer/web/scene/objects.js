"use strict";
// The objects that a task takes and releases: each is in one body at a time, from when on its stays say, or moves.
const OptiPlanObjects = (() => {
  const THREE = MeshCat.THREE, { placeInTime } = OptiPlanShapes;

  class Objects {
    // `run`: of the scene; what is free is in `group`, what is held in a body of the run's figure.
    constructor(scene, run, material) {
      Object.assign(this, { run, group: new THREE.Group() });
      this.things = (run.data.objects || []).map((data) => ({ data, stay: null, mesh: scene.mesh({ ...data, pose: data.stays[0].pose }, material(data)) }));
      scene.root.add(this.group);
      this.show(0);
    }

    get meshes() { return this.things.map(({ mesh }) => mesh); }

    show(t) {
      for (const thing of this.things) {
        let stay = thing.data.stays[0];
        for (const one of thing.data.stays) if (one.begin <= t + 1e-9) stay = one;
        if (stay.motion) placeInTime(thing.mesh, stay.pose, stay.motion, t);
        if (stay === thing.stay) continue;
        thing.stay = stay;
        if (!stay.motion) placeInTime(thing.mesh, stay.pose);
        thing.mesh.visible = !stay.absent;
        (stay.body ? this.run.figure.bodies[stay.body] : this.group).add(thing.mesh);
      }
    }
  }
  return { Objects };
})();
