"use strict";
// Start and goal as outlines: drawn flat into a picture of their own, of which only the rims are laid over the scene.
const OptiPlanOutlines = (() => {
  const THREE = MeshCat.THREE;
  const RIM = `uniform sampler2D flat_; uniform vec2 step_; uniform vec3 colour; varying vec2 at;
    void main() {
      float own = texture2D(flat_, at).a, near = 0.0;
      for (int i = -1; i <= 1; i++) for (int j = -1; j <= 1; j++) near += texture2D(flat_, at + vec2(float(i), float(j)) * step_).a;
      float rim = 1.0 - abs(near / 9.0 - 0.5) * 2.0;
      gl_FragColor = vec4(colour, max(0.85 * smoothstep(0.05, 0.6, rim), 0.07 * own));
    }`;

  class Outlines {
    constructor() {
      this.ghosts = [];
      this.flat = new THREE.MeshBasicMaterial({ color: 0xffffff });
      this.scene = new THREE.Scene();
      this.camera = new THREE.OrthographicCamera(-1, 1, 1, -1, 0, 1);
      this.quad = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), new THREE.ShaderMaterial({
        uniforms: { flat_: { value: null }, step_: { value: new THREE.Vector2() }, colour: { value: new THREE.Color() } },
        vertexShader: "varying vec2 at; void main() { at = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }",
        fragmentShader: RIM, transparent: true, depthTest: false, depthWrite: false,
      }));
      this.quad.frustumCulled = false;
      this.scene.add(this.quad);
    }

    // `figure` is drawn on its own, so it must not be part of any scene; `layer` tells whether it is wanted.
    add(figure, colour, layer) {
      const scene = new THREE.Scene();
      scene.add(figure);
      this.ghosts.push({ scene, figure, colour: new THREE.Color(colour), layer, target: null, seen: "" });
    }

    // After the scene has been drawn. `place` is the matrix of the world in which the figures stand.
    draw(renderer, camera, place) {
      const size = renderer.getDrawingBufferSize(new THREE.Vector2()), automatic = renderer.autoClear;
      const seen = [...camera.matrixWorldInverse.elements, ...camera.projectionMatrix.elements, size.x, size.y].join();
      renderer.autoClear = false;
      for (const ghost of this.ghosts) {
        if (!ghost.layer.visible) continue;
        if (ghost.seen !== seen) this.drawFlat(renderer, camera, place, ghost, size);
        ghost.seen = seen;
        const { flat_, step_, colour } = this.quad.material.uniforms;
        flat_.value = ghost.target.texture;
        step_.value.set(1.1 / size.x, 1.1 / size.y).multiplyScalar(Math.max(1, renderer.getPixelRatio()));
        colour.value.copy(ghost.colour);
        renderer.render(this.scene, this.camera);
      }
      renderer.autoClear = automatic;
    }

    drawFlat(renderer, camera, place, ghost, size) {
      if (!ghost.target || ghost.target.width !== size.x || ghost.target.height !== size.y) {
        if (ghost.target) ghost.target.dispose();
        ghost.target = new THREE.WebGLRenderTarget(size.x, size.y, { depthBuffer: false });
      }
      ghost.scene.overrideMaterial = this.flat;
      ghost.figure.matrixAutoUpdate = false;
      ghost.figure.matrix.copy(place);
      const clear = renderer.getClearColor(new THREE.Color()), alpha = renderer.getClearAlpha();
      renderer.setRenderTarget(ghost.target);
      renderer.setClearColor(0x000000, 0);
      renderer.clear();
      renderer.render(ghost.scene, camera);
      renderer.setRenderTarget(null);
      renderer.setClearColor(clear, alpha);
    }
  }
  return { Outlines };
})();
