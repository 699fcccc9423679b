"use strict";
// Builds the three.js objects of a page's data inside a meshcat viewer. World frame: metres, z up.
const OptiPlanScene = (() => {
  const THREE = MeshCat.THREE, { floats } = OptiPlanPacked, { makeGeometry, rgb, place, placeInTime, palette, triad, region } = OptiPlanShapes;
  const { runColour, addPaths } = OptiPlanPaths, { Painter, Labels } = OptiPlanBodies;
  const START = "#2f9e5b", GOAL = "#2374c6";
  const ROBOT_SETS = ["visual", "collision", "frame", "attached"], TRAIL = 7;
  const LAYERS = ["obstacle", "path", "start", "goal", "witness", "ellipsoids", "rod", "trail", "frames"];

  class Scene {
    constructor(data, pane) {
      this.data = data;
      this.viewer = new MeshCat.Viewer(pane, false);
      this.viewer.set_3d_pane_size = () => this.resize(pane); // meshcat's own takes the whole window
      this.root = new THREE.Group();
      this.layers = {};
      for (const name of LAYERS) {
        this.layers[name] = new THREE.Group();
        this.root.add(this.layers[name]);
      }
      this.scenery = new THREE.Group(); // the obstacles once more, where runs stand side by side
      this.root.add(this.scenery);
      this.geometries = data.geometries.map(makeGeometry);
      this.material = palette();
      this.painter = new Painter();
      this.labels = new Labels(document.getElementById("labels"));
      this.outlines = new OptiPlanOutlines.Outlines();
      this.moved = true;
      this.addObstacles();
      this.ranks = new Map(OptiPlanFacts.sorted(data.runs).map(([, k], rank) => [k, rank])); // the best have the clearest colours
      this.runs = data.runs.map((run, k) => this.addRun(run, k));
      if (!this.runs.length) this.runs.push(this.addRun({ duration: 0, witnesses: [] }, 0));
      addPaths(this.runs, this.layers.path, this.runs.filter((run) => run.tool).length === 1);
      this.addGhost(this.layers.start, data.start, START);
      if (data.goal) this.addGhost(this.layers.goal, data.goal, GOAL);
      this.prepare();
      this.size = this.box.getSize(new THREE.Vector3()).length();
      for (const pose of data.targets) this.addTriad(this.layers.goal, pose, 0.07);
      for (const one of data.regions || []) this.layers.goal.add(...region(one, GOAL));
      this.addTriad(this.layers.frames, [0, 0, 0, 0, 0, 0, 1], 0.12);
      this.layers.frames.visible = this.layers.trail.visible = false;
      this.addEllipsoids();
      this.rod = new OptiPlanRod.Rod(this.layers.rod, this.labels, this.size);
      this.resize(pane);
    }

    resize(pane) {
      const width = Math.max(1, pane.clientWidth), height = Math.max(1, pane.clientHeight), { camera, renderer } = this.viewer;
      Object.assign(this, { width, height });
      camera.aspect = width / height;
      camera.updateProjectionMatrix();
      renderer.setSize(width, height);
      this.viewer.set_dirty();
    }

    // Draws if something has changed; shadows only if bodies have moved.
    draw(always = false) {
      const { viewer } = this;
      if (!viewer.needs_render && !always) return false;
      if (this.moved) viewer.renderer.shadowMap.needsUpdate = true;
      this.moved = false;
      if (this.beforeDrawing) this.beforeDrawing();
      viewer.render();
      this.root.updateMatrixWorld();
      this.outlines.draw(viewer.renderer, viewer.camera, this.root.matrixWorld);
      this.labels.place(viewer.camera, this.width, this.height);
      return true;
    }

    dirty(moved = true) { this.moved = this.moved || moved; this.viewer.set_dirty(); }

    surface(colour, extra = {}) {
      const key = JSON.stringify([colour, extra]);
      return this.material(key, () => new THREE.MeshStandardMaterial(
        { color: rgb(colour), roughness: 0.62, metalness: 0.05, side: THREE.DoubleSide, ...extra }));
    }

    mesh(part, material) {
      const mesh = new THREE.Mesh(this.geometries[part.geometry], material);
      place(mesh, part.pose);
      mesh.name = part.name;
      mesh.userData.owner = part.owner;
      mesh.castShadow = mesh.receiveShadow = true;
      return mesh;
    }

    addObstacles() {
      for (const part of this.data.parts.filter((p) => p.set === "obstacle")) {
        const plane = this.data.geometries[part.geometry].kind === "plane";
        const mesh = this.mesh(part, this.surface(part.colour, plane ? { transparent: true, opacity: 0.28, depthWrite: false } : {}));
        mesh.castShadow = !plane;
        mesh.userData.plane = plane && this.data.geometries[part.geometry];
        Object.assign(mesh.userData, { motion: part.motion, from: part.pose });
        this.layers.obstacle.add(mesh);
      }
    }

    // The obstacles, wherever they stand.
    get obstacles() { return [this.layers.obstacle, ...this.scenery.children].flatMap((group) => group.children.filter((mesh) => mesh.userData.set === undefined)); }

    // What can hide something, but for robots.
    get solid() { return [...this.obstacles.filter((mesh) => !mesh.userData.plane), ...this.runs.flatMap((run) => run.objects.meshes)]; }

    // Obstacles that move are put where they are at a time, s.
    moveObstacles(t) {
      for (const mesh of this.obstacles)
        if (mesh.userData.motion) placeInTime(mesh, mesh.userData.from, mesh.userData.motion, t);
    }

    // One figure: a group a body, each with the parts of it; sets are switched on and off by name.
    figure(material, sets) {
      const figure = new THREE.Group();
      figure.bodies = Array.from({ length: this.data.bodies + 1 }, () => new THREE.Group());
      figure.add(...figure.bodies);
      for (const part of this.data.parts) {
        if (!sets.includes(part.set)) continue;
        const mesh = this.mesh(part, material(part));
        mesh.userData.set = part.set;
        mesh.visible = part.set !== "collision";
        mesh.castShadow = !mesh.material.transparent;
        figure.bodies[part.body].add(mesh);
      }
      return figure;
    }

    pose(figure, poses, sample = 0) {
      for (let j = 0; j < this.data.bodies; j++) place(figure.bodies[j + 1], poses, 7 * (sample * this.data.bodies + j));
    }

    addRun(run, k) {
      const rank = this.ranks.get(k) || 0, colour = runColour(rank);
      const mixed = new THREE.Color(colour).toArray(), behind = { polygonOffset: true, polygonOffsetFactor: 0.5 * k, polygonOffsetUnits: k };
      const material = (part) => {
        const tint = rank === 0 || part.body === 0 ? 0 : 0.55; // what is bolted down is nobody's
        return this.surface(part.colour.map((c, i) => (i < 3 ? c + tint * (mixed[i] - c) : c)), k ? behind : {});
      };
      const figure = this.figure(material, ROBOT_SETS);
      this.root.add(figure);
      figure.bodies[0].visible = k === 0; // what is bolted down is the same in every figure
      const poses = run.poses ? floats(run.poses) : floats(this.data.start);
      const shown = { data: run, figure, poses, samples: run.samples || 1, duration: run.duration || 0, colour, path: null, witness: new THREE.Group() };
      this.layers.witness.add(shown.witness);
      this.pose(figure, poses);
      shown.objects = new OptiPlanObjects.Objects(this, shown, (part) => this.surface(part.colour, k ? behind : {}));
      if (run.path) {
        shown.tool = floats(run.path);
        const cuts = [0, ...(run.cuts || []), shown.samples]; // where the tool is changed
        shown.tools = cuts.slice(1).map((end, k) => shown.tool.slice(3 * cuts[k], 3 * end));
        shown.tools.push(...(run.other_paths || []).map(floats));
      }
      return shown;
    }

    addEllipsoids() {
      this.runs.forEach((run) => {
        if (!run.data.ellipsoids) return;
        run.ellipsoids = new OptiPlanEllipsoids.Ellipsoids(floats(run.data.ellipsoids), run.tool, 0.075 * this.size);
        this.layers.ellipsoids.add(run.ellipsoids.group);
      });
    }

    addGhost(layer, poses, colour) {
      const ghost = this.figure(() => this.material("ghost", () => new THREE.MeshBasicMaterial()), ["visual", "frame", "attached"]);
      ghost.bodies[0].visible = false;
      this.pose(ghost, floats(poses));
      this.outlines.add(ghost, colour, layer);
    }

    addTriad(layer, pose, share) {
      const axes = triad(share * this.size);
      place(axes, pose);
      layer.add(axes);
      return axes;
    }

    // Stands of the robot along the first motion, faint; made when they are first asked for.
    showTrail(on) {
      const run = this.runs.find((one) => one.tool), layer = this.layers.trail;
      layer.visible = on;
      if (!on || !run || layer.children.length) return;
      for (let k = 1; k < TRAIL; k++) {
        const faint = { transparent: true, opacity: 0.1 + 0.12 * (k / TRAIL), depthWrite: false };
        const stand = this.figure((part) => this.surface(part.colour, faint), ["visual", "frame", "attached"]);
        stand.bodies[0].visible = false;
        stand.traverse((o) => { o.receiveShadow = o.castShadow = false; });
        this.pose(stand, run.poses, Math.round((k / TRAIL) * (run.samples - 1)));
        layer.add(stand);
      }
    }

    // What the camera must show: what moves, all along, and what stands near to it.
    bounds() {
      const box = new THREE.Box3(), one = new THREE.Box3();
      this.root.updateMatrixWorld(true);
      for (const run of this.runs) {
        for (let k = 0; k <= 8; k++) {
          this.pose(run.figure, run.poses, Math.round((k / 8) * (run.samples - 1)));
          run.figure.updateMatrixWorld(true);
          for (const body of run.figure.bodies.slice(1)) box.expandByObject(body);
        }
        this.pose(run.figure, run.poses);
      }
      const still = [this.runs[0].figure.bodies[0], ...this.layers.obstacle.children, ...this.runs[0].objects.group.children];
      if (box.isEmpty()) box.setFromObject(still[0]);
      for (const pose of this.data.targets) box.expandByPoint(this.world(pose.slice(0, 3))); // also one that is out of reach
      this.low = still.filter((mesh) => !mesh.userData.plane).reduce((low, mesh) => Math.min(low, one.setFromObject(mesh).min.y), box.min.y);
      const around = box.clone().expandByScalar(0.12 * box.getSize(new THREE.Vector3()).length());
      for (const mesh of still) {
        if (mesh.userData.plane) continue;
        one.setFromObject(mesh);
        if (one.intersectsBox(around)) box.union(one.intersect(around));
      }
      return box;
    }

    prepare() {
      const { scene, renderer, controls } = this.viewer;
      for (const path of ["/Lights", "/Grid", "/Axes"]) this.viewer.handle_command({ type: "delete", path });
      this.viewer.handle_command({ type: "set_property", path: "/Background", property: "visible", value: false });
      scene.add(this.root);
      renderer.outputEncoding = THREE.sRGBEncoding;
      scene.updateMatrixWorld(true);
      this.box = this.bounds();
      this.stage = new OptiPlanStage.Stage(this.viewer, this.root, this.box, this.low);
      const centre = scene.worldToLocal(this.stage.centre.clone());
      for (const mesh of this.layers.obstacle.children) if (mesh.userData.plane) OptiPlanStage.spreadPlane(mesh, centre, 1.2 * this.stage.radius);
      controls.enableDamping = false;
    }

    world(point) { return this.root.localToWorld(new THREE.Vector3(...point)); }

    // The first view.
    frame() {
      const { camera } = this.viewer, centre = this.box.getCenter(new THREE.Vector3());
      camera.fov = 32;
      camera.near = 0.02 * this.stage.radius;
      camera.far = 60 * this.stage.radius;
      if (!this.direction) {
        const targets = [], moving = this.runs.filter((run) => run.tool);
        for (const run of (moving.length ? moving : this.runs).slice(0, 2)) {
          for (let k = 0; k < 9; k++) {
            const s = Math.round((k / 8) * (run.samples - 1));
            for (const tool of run.tools || []) targets.push(this.world(tool.subarray(3 * s, 3 * s + 3)));
            if (k % 2 === 0) for (let j = this.data.bodies; j > 0; j -= 3) targets.push(this.world(run.poses.subarray(7 * (s * this.data.bodies + j - 1), 7 * (s * this.data.bodies + j - 1) + 3)));
          }
        }
        const standing = this.runs[0].figure.bodies[0].children.filter((mesh) => mesh.visible);
        this.direction = OptiPlanCamera.bestDirection(camera, this.box, targets, [...this.solid, ...standing]);
      }
      OptiPlanCamera.look(this.viewer, centre, this.direction, OptiPlanCamera.distance(camera, this.box, this.direction));
    }

    // Eye and target of the camera, m, in the problem's own world.
    get camera() {
      const own = (v) => this.root.worldToLocal(v.clone()).toArray();
      return [...own(this.viewer.camera.position), ...own(this.viewer.controls.target)];
    }

    set camera(six) {
      this.viewer.camera.position.copy(this.world(six.slice(0, 3)));
      this.viewer.controls.target.copy(this.world(six.slice(3)));
      this.viewer.controls.update();
      this.viewer.set_dirty();
    }

    // All meshes of a body that has this name in reports: obstacles, and of the runs' robots those that are shown; of one run, those at its place.
    owned(name, run = null) {
      const { children } = this.scenery, own = run && children.find((stand) => stand.run === run);
      const shared = this.layers.obstacle.children.filter((mesh) => !own || mesh.userData.plane); // planes have no copies
      const copies = own ? [own] : run ? [] : children, found = [...shared, ...copies.flatMap((group) => group.children)].filter((mesh) => mesh.userData.owner === name);
      for (const one of run ? [run] : this.runs) for (const mesh of one.objects.meshes) if (mesh.userData.owner === name) found.push(mesh);
      for (const one of run ? [run] : this.runs) one.figure.traverse((o) => { if (o.isMesh && o.userData.owner === name && !found.includes(o)) found.push(o); });
      return found;
    }

    // Lights what a joint moves until the next joint; null: nothing.
    lightJoint(name) {
      const joint = this.data.joints.find(([own]) => own === name);
      if (this.lit === name) return;
      this.lit = name;
      for (const run of this.runs) {
        run.figure.bodies.forEach((body, k) => body.traverse((o) => { if (o.isMesh) this.painter.paint(o, { lit: Boolean(joint) && k === joint[1] }); }));
      }
      this.viewer.set_dirty();
    }

    // The body under a place of the picture: its name, or null.
    bodyAt(x, y) {
      this.root.updateMatrixWorld(); // bodies may have been moved since the last picture
      const rays = new THREE.Raycaster(), seen = [this.layers.obstacle, ...(this.scenery.visible ? this.scenery.children : [])].flatMap((group) => (group.visible ? group.children : []));
      for (const run of this.runs) for (const part of [run.figure, run.objects.group]) part.traverse((o) => { if (o.isMesh && o.visible && o.parent.visible) seen.push(o); });
      rays.setFromCamera({ x: (2 * x) / this.width - 1, y: 1 - (2 * y) / this.height }, this.viewer.camera);
      const hit = rays.intersectObjects(seen, false).find(({ object }) => object.visible);
      return hit ? hit.object.userData.owner : null;
    }
  }
  return { Scene, START, GOAL };
})();
