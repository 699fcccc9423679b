"use strict";
// Velocity and force ellipsoids at the tool: a pair that moves with the arm, and beads of it along the tool's path.
// Both have the same axes; where the velocity ellipsoid is long (s), the force ellipsoid is short (1/s).
const OptiPlanEllipsoids = (() => {
  const THREE = MeshCat.THREE, { named } = OptiPlanShapes;
  const COLOURS = { velocity: "#0a8f86", force: "#d1481f" };
  const BEADS = 7, LONGEST = 1.6, FLATTEST = 0.01; // lengths in units of `size`; a singular arm's force has no end
  const STRIDE = 7; // numbers a sample: quaternion xyzw of the axes, semi-lengths of the velocity ellipsoid, longest first

  const ball = new THREE.SphereGeometry(1, 40, 24), rims = new THREE.BufferGeometry();
  const turns = Array.from({ length: 65 }, (_, k) => (k * Math.PI) / 32), corners = [];
  for (let axis = 0; axis < 3; axis++) {
    for (let k = 0; k < 64; k++) {
      for (const turn of [turns[k], turns[k + 1]]) {
        const point = [0, 0, 0];
        point[axis] = Math.cos(turn);
        point[(axis + 1) % 3] = Math.sin(turn);
        corners.push(...point);
      }
    }
  }
  rims.setAttribute("position", new THREE.Float32BufferAttribute(corners, 3));

  class Ellipsoids {
    // data: STRIDE floats a sample; points: the tool, 3 floats a sample; size: m, half the length of the largest velocity axis.
    constructor(data, points, size) {
      Object.assign(this, { data, points, size, group: new THREE.Group() });
      this.samples = data.length / STRIDE;
      const all = Array.from({ length: this.samples }, (_, k) => this.lengths(k)), fastest = Math.max(1e-9, ...all.flat());
      // A direction in which the tool never moves (out of the plane of a planar arm) is borne by the bearings: both are flat.
      this.fixed = [0, 1, 2].map((i) => all.every((lengths) => lengths[i] < 1e-6 * fastest));
      const hardest = all.map((lengths) => 1 / Math.max(1e-9, ...lengths.filter((_, i) => !this.fixed[i]).slice(-1)));
      this.unit = { velocity: fastest, force: hardest.sort((a, b) => a - b)[this.samples >> 1] };
      this.moving = ["velocity", "force"].map((kind) => this.solid(kind, 0.3));
      for (let b = 0; b < BEADS; b++) {
        const k = Math.round((b / (BEADS - 1)) * (this.samples - 1));
        for (const kind of ["velocity", "force"]) this.put(this.solid(kind, 0.07), k);
      }
      this.show(0);
    }

    lengths(k) { return Array.from(this.data.subarray(STRIDE * k + 4, STRIDE * k + STRIDE)); }

    solid(kind, opacity) {
      const look = { color: named(COLOURS[kind]), transparent: true, depthWrite: false };
      const mesh = new THREE.Mesh(ball, new THREE.MeshStandardMaterial({ ...look, opacity, roughness: 0.7 }));
      mesh.add(new THREE.LineSegments(rims, new THREE.LineBasicMaterial({ ...look, opacity: Math.min(1, 3 * opacity) })));
      mesh.traverse((part) => { part.renderOrder = 4; });
      mesh.userData.kind = kind;
      this.group.add(mesh);
      return mesh;
    }

    put(mesh, k) {
      const force = mesh.userData.kind === "force", unit = this.unit[mesh.userData.kind];
      const length = (s, i) => (this.fixed[i] ? 0 : (force ? 1 / Math.max(s, 1e-12) : s) / unit);
      const drawn = this.lengths(k).map((s, i) => this.size * Math.min(LONGEST, Math.max(FLATTEST, length(s, i))));
      mesh.position.fromArray(this.points, 3 * k);
      mesh.quaternion.fromArray(this.data, STRIDE * k);
      mesh.scale.set(...drawn);
    }

    // The moving pair at sample k.
    show(k) { for (const mesh of this.moving) this.put(mesh, k); }
  }
  return { Ellipsoids, COLOURS };
})();
