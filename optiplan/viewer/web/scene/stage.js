"use strict";
// What the scene stands on and is lit by: floor, grid, sun. Colours follow the theme.
const OptiPlanStage = (() => {
  const THREE = MeshCat.THREE, { named } = OptiPlanShapes;

  class Stage {
    // `root` holds all that is shown; `box` is what the camera frames, in three.js's own axes (y up); `low`: the floor, m.
    constructor(viewer, root, box, low = box.min.y) {
      const { scene, renderer } = viewer;
      Object.assign(this, { scene, root, box, low: low - 0.002 });
      this.centre = box.getCenter(new THREE.Vector3());
      this.radius = 0.5 * box.getSize(new THREE.Vector3()).length();
      renderer.shadowMap.autoUpdate = false; // only when bodies have moved
      this.addLights();
      this.floor = new THREE.Group();
      scene.add(this.floor);
      this.colour();
    }

    // Takes the colours of the page, which may have changed.
    colour() {
      const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
      this.scene.background = new THREE.Color(css("--ground")); // three.js 132 clears without converting colours
      this.floor.clear();
      this.addFloor(css("--grid-main"), css("--grid"));
    }

    addLights() {
      const { scene, radius } = this, sun = new THREE.DirectionalLight(0xffffff, 0.66);
      const up = scene.worldToLocal(this.centre.clone());
      sun.position.copy(up).add(new THREE.Vector3(1.2, -1.6, 3).multiplyScalar(radius));
      sun.target.position.copy(up);
      sun.castShadow = true;
      sun.shadow.mapSize.set(2048, 2048);
      Object.assign(sun.shadow.camera, { left: -1.5 * radius, right: 1.5 * radius, top: 1.5 * radius, bottom: -1.5 * radius, near: 0.01, far: 8 * radius });
      sun.shadow.bias = -5e-4;
      sun.shadow.normalBias = 4e-3 * radius;
      sun.shadow.radius = 3;
      const sky = new THREE.HemisphereLight(0xffffff, 0xd8d2ca, 0.66), side = new THREE.DirectionalLight(0xdfe9ff, 0.22);
      sky.position.set(0, 0, 1);
      side.position.set(-2, 1, 1.2);
      scene.add(sun, sun.target, sky, side);
    }

    addFloor(main, fine) {
      const { radius, low } = this, cell = radius > 2.5 ? 0.5 : 0.25, half = cell * Math.ceil((2.6 * radius) / cell);
      const middle = this.scene.worldToLocal(this.centre.clone());
      const x = cell * Math.round(middle.x / cell), y = cell * Math.round(middle.y / cell);
      const shade = new THREE.Mesh(new THREE.PlaneGeometry(8 * half, 8 * half), new THREE.ShadowMaterial({ opacity: 0.16, depthWrite: false }));
      shade.receiveShadow = true;
      shade.position.set(x, y, low - 1e-3);
      const grid = new THREE.GridHelper(2 * half, Math.round((2 * half) / cell), named(main), named(fine));
      grid.rotateX(Math.PI / 2);
      grid.position.set(x, y, low);
      this.floor.add(shade, grid);
    }
  }

  // A half-space has no end: what is drawn is the piece of its surface nearest to the scene.
  function spreadPlane(mesh, centre, size) {
    const { normal, offset } = mesh.userData.plane, n = new THREE.Vector3(...normal).normalize();
    const foot = n.clone().multiplyScalar(offset).applyQuaternion(mesh.quaternion).add(mesh.position);
    n.applyQuaternion(mesh.quaternion);
    mesh.position.copy(centre).addScaledVector(n, n.dot(foot.sub(centre)));
    mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), n);
    mesh.scale.set(size, size, 1);
    mesh.add(new THREE.LineSegments(new THREE.EdgesGeometry(mesh.geometry), new THREE.LineBasicMaterial({ color: named("#a79a88") })));
  }

  return { Stage, spreadPlane };
})();
