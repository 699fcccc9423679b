"use strict";
// A failure that can be seen: both bodies red and named, the place of the contact, the camera on its open side, and
// what still stands before it see-through.
const OptiPlanFailure = (() => {
  const THREE = MeshCat.THREE, { floats } = OptiPlanPacked, { named } = OptiPlanShapes, { RED } = OptiPlanBodies, { millimetres } = OptiPlanFacts;

  class Failure {
    // `run`: of the scene; `witness`: { points, pair, distance, time, poses } of what was refused.
    constructor(scene, run, witness) {
      Object.assign(this, { scene, run, witness, labels: [], hiding: [], seen: "" });
      this.middle = witness.points.length ? mean(witness.points) : null;
      this.bodies = [];
      if (witness.poses && !run.data.poses) {
        run.poses = floats(witness.poses); // no motion to show: the robot stands where it failed
        run.samples = 1;
        scene.pose(run.figure, run.poses);
      }
      this.addMarks();
      this.fill();
      this.show(true);
    }

    // The bodies that touch where this run stands: of obstacles its own copies, which are made anew as runs are arranged.
    fill() {
      this.bodies = this.witness.pair.flatMap((name) => this.scene.owned(name, this.run));
      for (const label of this.labels) if (label.name) label.body = this.body(label.name);
    }

    // The body that bears a name here.
    body(name) { return this.scene.owned(name, this.run).find((one) => one.userData.set !== "collision"); }

    // A point of the run's own place in the picture: runs may stand side by side.
    placed(point) { return this.scene.world(point.map((x, k) => x + this.run.figure.position.getComponent(k))); }
    get point() { return this.middle && this.placed(this.middle); }

    addMarks() {
      const { scene, witness } = this, look = new THREE.MeshBasicMaterial({ color: named(RED), depthTest: false, transparent: true, opacity: 0.9 });
      for (const point of witness.points) {
        const ball = new THREE.Mesh(new THREE.SphereGeometry(0.006 * scene.size, 20, 12), look);
        ball.position.fromArray(point);
        ball.renderOrder = 5;
        this.run.witness.add(ball);
      }
      if (witness.gap) this.addGap(...witness.gap);
      if (!this.point) return;
      const deep = witness.distance !== null && witness.distance < 0 ? `overlap ${millimetres(-witness.distance)}` : witness.distance > 0 ? `${millimetres(witness.distance)} apart` : "contact";
      const label = scene.labels.add(`${witness.pair.join(" – ") || "here"}: ${deep}`, "bad");
      this.labels.push(Object.assign(label, { lift: 46, spot: this.middle }));
      for (const name of witness.pair) {
        const mesh = this.body(name);
        if (!mesh) continue;
        mesh.geometry.computeBoundingBox();
        this.labels.push(Object.assign(scene.labels.add(name, "bad"), { lift: -30, name, middle: mesh.geometry.boundingBox.getCenter(new THREE.Vector3()) }));
      }
    }

    // From where the tool comes to where it should be.
    addGap(from, to) {
      const { scene } = this, ends = [from, to].map((point) => new THREE.Vector3(...point)), dash = 0.012 * scene.size;
      const line = new THREE.Line(new THREE.BufferGeometry().setFromPoints(ends), new THREE.LineDashedMaterial({ color: named(RED), dashSize: dash, gapSize: 0.6 * dash, depthTest: false }));
      line.computeLineDistances();
      line.renderOrder = 5;
      this.run.witness.add(line);
      const label = scene.labels.add(`${millimetres(ends[0].distanceTo(ends[1]))} missing`, "bad");
      this.labels.push(Object.assign(label, { spot: from.map((x, k) => 0.5 * (x + to[k])) }));
    }

    show(on) {
      this.on = on;
      for (const mesh of this.bodies) this.scene.painter.paint(mesh, { red: on, aside: on && this.scene.obstacles.includes(mesh) }); // what is in it can be seen
      for (const label of this.labels) label.visible = on;
      this.run.witness.visible = on;
      if (!on) this.clear();
      this.seen = "";
      this.scene.dirty(false);
    }

    clear() {
      for (const mesh of this.hiding) this.scene.painter.paint(mesh, { aside: false });
      this.hiding = [];
    }

    // Puts the camera where the contact can be seen.
    look() {
      if (!this.point) return;
      if (this.witness.poses) this.scene.pose(this.run.figure, floats(this.witness.poses));
      const { scene } = this, solid = [...scene.solid];
      this.run.figure.traverse((o) => { if (o.isMesh && o.visible) solid.push(o); });
      const far = 0.48 * OptiPlanCamera.distance(scene.viewer.camera, scene.box, scene.direction);
      const { point } = this, target = point.clone().lerp(scene.box.getCenter(new THREE.Vector3()), 0.15);
      scene.root.updateMatrixWorld(true);
      OptiPlanCamera.look(scene.viewer, target, OptiPlanCamera.openSide(point, far, solid, scene.direction), far);
    }

    // Makes what stands between the camera and the contact see-through, as the camera moves.
    update() {
      if (!this.on) return;
      for (const label of this.labels) if (label.body) label.body.localToWorld(label.point.copy(label.middle)); else if (label.spot) label.point.copy(this.placed(label.spot));
      const { point } = this, eye = this.scene.viewer.camera.position;
      if (!point) return;
      const seen = [...eye.toArray(), ...point.toArray()].map((x) => x.toFixed(2)).join();
      if (seen === this.seen) return;
      this.seen = seen;
      this.clear();
      const solid = this.scene.solid.filter((mesh) => !this.bodies.includes(mesh));
      this.run.figure.traverse((o) => { if (o.isMesh && o.visible && !this.bodies.includes(o)) solid.push(o); });
      const between = OptiPlanCamera.boxesBetween(eye, point, solid, 0.01);
      this.hiding = [...new Set(OptiPlanCamera.hidden(eye, point, between, 0.01).map((hit) => hit.object))];
      for (const mesh of this.hiding) this.scene.painter.paint(mesh, { aside: true });
    }
  }

  const mean = (points) => [0, 1, 2].map((i) => points.reduce((sum, p) => sum + p[i], 0) / points.length);

  // Of all failures those that are wanted are shown. Several may share a body: what goes, goes first.
  function only(failures, wanted) {
    for (const failure of failures) failure.show(false);
    for (const failure of failures) if (wanted(failure)) failure.show(true);
  }

  return { Failure, only };
})();
