"use strict";
// A rod between the nearest points of the nearest two bodies, with its length in figures.
const OptiPlanRod = (() => {
  const THREE = MeshCat.THREE, { named } = OptiPlanShapes, { millimetres } = OptiPlanFacts;
  const COLOUR = "#b8126f", CONTACT = "#d3261f";
  const UP = new THREE.Vector3(0, 1, 0);

  class Rod {
    constructor(layer, labels, size) {
      const look = (colour) => new THREE.MeshBasicMaterial({ color: named(colour), depthTest: false, transparent: true });
      this.looks = { apart: look(COLOUR), contact: look(CONTACT) };
      this.thick = 0.0022 * size;
      this.line = new THREE.Mesh(new THREE.CylinderGeometry(1, 1, 1, 10), this.looks.apart);
      this.ends = [0, 1].map(() => new THREE.Mesh(new THREE.SphereGeometry(2.1 * this.thick, 16, 10), this.looks.apart));
      for (const mesh of [this.line, ...this.ends]) { mesh.renderOrder = 6; layer.add(mesh); }
      this.layer = layer;
      this.label = labels.add("", "rod");
      this.show(null);
    }

    // `moment`: { points: [[x, y, z], [x, y, z]], distance, pair } in the world, m; null: no rod.
    show(moment) {
      this.moment = moment;
      const there = moment !== null;
      this.label.visible = there && this.layer.visible && !(this.quiet && moment.distance <= 0); // the failure's own label is there
      for (const mesh of [this.line, ...this.ends]) mesh.visible = there;
      if (!there) return;
      const [a, b] = moment.points.map((p) => new THREE.Vector3(...p)), along = b.clone().sub(a), length = along.length();
      const look = moment.distance > 0 ? this.looks.apart : this.looks.contact;
      this.line.position.copy(a).addScaledVector(along, 0.5);
      this.line.quaternion.setFromUnitVectors(UP, length > 1e-9 ? along.clone().normalize() : UP);
      this.line.scale.set(this.thick, Math.max(length, 1e-6), this.thick);
      this.ends[0].position.copy(a);
      this.ends[1].position.copy(b);
      for (const mesh of [this.line, ...this.ends]) mesh.material = look;
      const text = moment.distance > 0 ? millimetres(moment.distance) : `overlap ${millimetres(-moment.distance)}`;
      if (this.label.element.textContent !== text) this.label.element.textContent = text;
      this.label.element.classList.toggle("bad", !(moment.distance > 0));
      this.label.point.copy(this.layer.localToWorld(a.clone().addScaledVector(along, 0.5)));
    }
  }
  return { Rod, COLOUR };
})();
