"use strict";
// The live scene: a robot to be posed, ghosts of all branches, a goal and obstacles to be dragged. Metres, z up.
const StudioScene = (() => {
  const THREE = MeshCat.THREE, { makeGeometry, rgb, place, undrawn } = OptiPlanShapes, { floats } = OptiPlanPacked, { poseOf } = SceneHand;
  const GOOD = 0x2374c6, BAD = 0xd3261f, CHOSEN = 0x1f9d55, TOUCHING = 0xd3261f;

  class Scene {
    constructor(pane, events) {
      this.pane = pane;
      // What a page wants to hear of. Where there are goals: goal(pose, ended, index). Where obstacles can be moved: obstacle(name, pose)
      // when one is let go, moving(name, pose) before. Where one can be chosen: selected(name), resized(name, shape, pose, ended).
      // branch(k) of a ghost that is clicked, surface(point, normal) while `pointing` is set.
      this.events = events;
      this.viewer = new MeshCat.Viewer(pane, false);
      this.viewer.set_3d_pane_size = () => this.resize();
      for (const path of ["/Lights", "/Axes"]) this.viewer.handle_command({ type: "delete", path });
      this.viewer.handle_command({ type: "set_property", path: "/Background", property: "visible", value: false });
      const { scene, renderer } = this.viewer, sun = new THREE.DirectionalLight(0xffffff, 0.65);
      renderer.outputEncoding = THREE.sRGBEncoding;
      const ground = () => { scene.background = new THREE.Color(getComputedStyle(document.documentElement).getPropertyValue("--ground").trim()); this.viewer.set_dirty(); };
      ground();
      addEventListener("optiplan:theme", ground);
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", ground);
      sun.position.set(2, -2, 4);
      this.root = new THREE.Group();
      scene.add(sun, new THREE.HemisphereLight(0xffffff, 0xd8d2ca, 0.65), this.root);
      this.root.updateMatrixWorld(true);
      this.seen = null;
      this.chosen = null;
      this.made = new Map(); // geometries of what is drawn, by their data
      this.pointing = false;
      SceneHand.listen(this);
      new ResizeObserver(() => this.resize()).observe(pane);
      const draw = () => {
        requestAnimationFrame(draw);
        if (this.viewer.needs_render) this.viewer.render();
      };
      draw();
    }

    resize() {
      const width = Math.max(1, this.pane.clientWidth), height = Math.max(1, this.pane.clientHeight), { camera, renderer } = this.viewer;
      const card = document.getElementById("joints"), aside = card && width > 620 && card.open ? 0.5 * card.offsetWidth : 0;
      camera.aspect = width / height;
      camera.setViewOffset(width, height, aside, 0, width, height); // the middle of what the card leaves free
      camera.updateProjectionMatrix();
      renderer.setSize(width, height);
      this.viewer.set_dirty();
    }

    show(data, tool) {
      this.empty(this.root);
      this.data = data;
      this.objects = null;
      this.geometries = this.remade(data.geometries);
      this.obstacles = new THREE.Group();
      for (const part of data.parts.filter((one) => one.set === "obstacle")) {
        const plane = data.geometries[part.geometry].kind === "plane";
        const mesh = this.mesh(part, new THREE.MeshStandardMaterial({ color: rgb(part.colour), roughness: 0.7, transparent: plane, opacity: plane ? 0.25 : 1 }));
        if (plane) this.spread(mesh, data.geometries[part.geometry]);
        mesh.userData.fixed = plane;
        mesh.userData.own = mesh.material.color.clone();
        this.obstacles.add(mesh);
      }
      this.robot = this.figure((part) => new THREE.MeshStandardMaterial({ color: rgb(part.colour), roughness: 0.62 }));
      this.ghosts = new THREE.Group();
      this.others = new THREE.Group();
      this.gizmo = new THREE.Group();
      this.handle = GoalFrame.make();
      this.handle.visible = Boolean(this.events.goal && tool);
      if (tool) place(this.handle, tool);
      this.root.add(this.obstacles, this.robot, this.ghosts, this.others, this.gizmo, this.handle);
      const start = floats(data.start);
      this.pose(Array.from({ length: data.bodies }, (_, j) => Array.from(start.slice(7 * j, 7 * j + 7))));
      this.viewer.scene.updateMatrixWorld(true);
      if (this.seen !== data.bodies) this.frame();
      this.seen = data.bodies;
      this.resize();
    }

    // Geometries of these data: those that were drawn before stay, and what is drawn no more goes.
    remade(all) {
      const before = this.made, texts = all.map((one) => JSON.stringify(one));
      this.made = new Map(texts.map((text, k) => [text, before.get(text) || makeGeometry(all[k])]));
      for (const [text, geometry] of before) if (!this.made.has(text)) geometry.dispose();
      return texts.map((text) => this.made.get(text));
    }

    // Empties a group: the renderer keeps what it draws in memory until it is told.
    empty(group) {
      const kept = new Set(this.made.values());
      group.traverse(({ geometry }) => { if (geometry && !kept.has(geometry)) geometry.dispose(); });
      group.clear();
    }

    mesh(part, material) {
      const mesh = new THREE.Mesh(this.geometries[part.geometry], material);
      place(mesh, part.pose);
      mesh.name = part.name;
      mesh.userData.link = part.owner;
      return mesh;
    }

    spread(mesh, { normal, offset }) {
      const n = new THREE.Vector3(...normal).normalize();
      const world = n.clone().applyQuaternion(mesh.quaternion);
      mesh.position.addScaledVector(world, offset);
      mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), world);
      mesh.scale.set(1.5, 1.5, 1);
    }

    figure(material) {
      const figure = new THREE.Group(), drawn = new Set(this.data.parts.map((part) => part.set)).has("visual") ? ["visual", "attached"] : ["collision", "frame", "attached"];
      figure.bodies = Array.from({ length: this.data.bodies + 1 }, () => new THREE.Group());
      figure.add(...figure.bodies);
      for (const part of this.data.parts) if (drawn.includes(part.set)) figure.bodies[part.body].add(this.mesh(part, material(part)));
      return figure;
    }

    pose(poses, figure = this.robot) {
      poses.forEach((pose, j) => place(figure.bodies[j + 1], pose));
      this.viewer.set_dirty();
    }

    // Bodies of the robot, by name, in the colour of what touches; all others in their own.
    touching(names) {
      for (const body of [...this.robot.bodies, ...(this.objects ? [this.objects.group] : [])]) for (const mesh of body.children) {
        const own = mesh.userData.own || (mesh.userData.own = mesh.material.color.clone());
        mesh.material.color.copy(names.has(mesh.userData.link) || names.has(mesh.name) ? new THREE.Color(TOUCHING) : own);
      }
      for (const mesh of this.obstacles.children) mesh.material.emissive.setHex(names.has(mesh.name) ? 0x6b1410 : 0);
      this.viewer.set_dirty();
    }

    // Poses that can be dragged: one has the frame, the others are balls to be clicked.
    handles(poses, active) {
      this.handle.visible = poses.length > 0;
      this.empty(this.others);
      poses.forEach((pose, k) => {
        if (k === active) { place(this.handle, pose); return; }
        const ball = GoalFrame.ball(0.6);
        place(ball, pose);
        ball.userData.index = k;
        this.others.add(ball);
      });
      this.viewer.set_dirty();
    }

    // The obstacle that is chosen, with its gizmo; `shape` as the file says it. Null for none.
    choose(name, shape) {
      this.chosen = name;
      this.empty(this.gizmo);
      for (const mesh of this.obstacles.children) mesh.material.color.copy(mesh.name === name ? new THREE.Color(CHOSEN) : mesh.userData.own);
      const mesh = this.obstacles.children.find((one) => one.name === name);
      if (mesh && !mesh.userData.fixed) {
        this.frameOf = GoalFrame.make();
        this.knobs = Gizmo.knobs(shape);
        this.gizmo.add(this.frameOf, this.knobs);
        place(this.gizmo, poseOf(mesh));
      } else this.frameOf = this.knobs = null;
      this.viewer.set_dirty();
    }

    branches(found, chosen = -1) {
      this.ghosts.clear();
      found.forEach((branch, k) => {
        const bad = branch.touching || !branch.within_limits;
        const skin = new THREE.MeshStandardMaterial({ color: bad ? BAD : k === chosen ? CHOSEN : GOOD, transparent: true, opacity: bad ? 0.12 : k === chosen ? 0.6 : 0.3, depthWrite: false,
          polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 4 });
        const ghost = this.figure(() => skin);
        ghost.bodies[0].visible = false;
        ghost.index = k;
        this.pose(branch.poses, ghost);
        this.ghosts.add(ghost);
      });
      this.viewer.set_dirty();
    }

    frame() {
      this.root.updateMatrixWorld(true); // what was placed since it was drawn
      const box = new THREE.Box3().setFromObject(this.robot), one = new THREE.Box3(), { camera, controls } = this.viewer;
      if (this.handle.visible) box.expandByObject(this.handle.ball);
      for (const ball of this.others.children) box.expandByObject(ball);
      const reach = box.getSize(new THREE.Vector3()).length();
      for (const mesh of this.obstacles.children) {
        one.setFromObject(mesh);
        if (!mesh.userData.fixed && one.getSize(new THREE.Vector3()).length() < 1.6 * reach) box.union(one);
      }
      const centre = box.getCenter(new THREE.Vector3()), radius = 0.5 * box.getSize(new THREE.Vector3()).length() || 1;
      camera.fov = 35;
      camera.near = 0.01 * radius;
      camera.far = 80 * radius;
      camera.position.copy(centre).add(new THREE.Vector3(-0.35, 0.5, 1).normalize().multiplyScalar(3.9 * radius));
      controls.target.copy(centre);
      controls.update();
    }

    // Once nothing is in the hand: what is drawn anew before would be another thing than what is dragged.
    free() { return this.held && new Promise((go) => this.pane.addEventListener("optiplan:dropped", go, { once: true })); }

    goal() {
      return poseOf(this.handle);
    }

    aim(pose) {
      if (this.held) return;
      place(this.handle, pose);
      this.viewer.set_dirty();
    }

    // Where on the screen the goal is, or a point of its frame, m; for tests and for people who ask the console.
    goalOnScreen(x = 0, y = 0, z = 0) {
      return this.onScreen(this.handle, x, y, z);
    }

    onScreen(object, x = 0, y = 0, z = 0) {
      this.viewer.scene.updateMatrixWorld(true);
      const at = object.localToWorld(new THREE.Vector3(x, y, z)).project(this.viewer.camera), area = this.pane.getBoundingClientRect();
      return [area.left + 0.5 * (1 + at.x) * area.width, area.top + 0.5 * (1 - at.y) * area.height];
    }

    // The part of the goal's frame that a ray meets; null where there is no goal.
    grip(rays) {
      return this.handle.visible ? GoalFrame.met(this.handle, rays) : null;
    }

    // Obstacles to these poses, by name, apart from the one in the hand.
    move(poses) {
      for (const mesh of this.obstacles.children)
        if (poses[mesh.name] && !mesh.userData.fixed && !(this.held && this.held.object === mesh)) place(mesh, poses[mesh.name]);
      this.viewer.set_dirty();
    }

    // A run of the scene's data: the path of its tool, and what a task takes and puts down.
    motion(run) {
      const points = floats(run.path), line = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(points, 3));
      this.root.add(new THREE.Line(line, new THREE.LineBasicMaterial({ color: GOOD, transparent: true, opacity: 0.6 })));
      this.objects = new OptiPlanObjects.Objects(this, { data: run, figure: this.robot }, (one) => new THREE.MeshStandardMaterial({ color: rgb(one.colour), roughness: 0.7 }));
    }

    // Objects of a task where they are at a time of the planned motion, s.
    at(time) {
      if (this.objects) this.objects.show(time);
      this.viewer.set_dirty();
    }
  }

  // The scene of a page. Where it cannot be drawn, as without WebGL, it says why; what a page does beside it goes on.
  function begin(pane, events) {
    try {
      return new Scene(pane, events);
    } catch (error) {
      pane.replaceChildren(Page.make("p", { className: "trouble", textContent: undrawn(error, "all else is here") }));
      pane.removeAttribute("role"); // there are words to be read now
      return new Proxy({ events, missing: true, data: null, pointing: false, obstacles: { children: [] } }, { get: (own, name) => (name in own ? own[name] : () => {}) });
    }
  }
  return { begin };
})();
