// Renderer, light and loop, which draws only after a change.

import { AmbientLight, Color, DirectionalLight, Object3D, PerspectiveCamera, Scene, WebGLRenderer } from "three";
import type { Palette } from "./palette.ts";

Object3D.DEFAULT_UP.set(0, 0, 1);

export class Stage {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(35, 1, 0.02, 200);
  readonly renderer: WebGLRenderer;
  readonly low: boolean;
  readonly sun = new DirectionalLight(0xffffff, 2.1);
  /** Frames drawn so far. */
  draws = 0;
  #asked = false;
  #before: (() => void)[] = [];
  #ambient = new AmbientLight(0xffffff, 1.5);

  constructor(readonly host: HTMLElement) {
    const quality = qualityOf();
    if (quality === null) throw new Error("no WebGL 2");
    this.low = quality === "low";
    this.renderer = new WebGLRenderer({ antialias: !this.low, preserveDrawingBuffer: navigator.webdriver, powerPreference: "high-performance" });
    this.renderer.setPixelRatio(this.low ? 1 : Math.min(devicePixelRatio, 2));
    if (!this.low) {
      this.renderer.shadowMap.enabled = true;
      this.sun.castShadow = true;
      this.sun.shadow.mapSize.set(1024, 1024);
      const { camera } = this.sun.shadow;
      [camera.left, camera.right, camera.top, camera.bottom, camera.near, camera.far] = [-1.2, 1.2, 1.2, -1.2, 0.1, 8];
    }
    this.scene.add(this.sun, this.sun.target, this.#ambient);
    const canvas = this.renderer.domElement;
    canvas.className = "canvas";
    canvas.tabIndex = 0;
    canvas.addEventListener("webglcontextrestored", () => this.invalidate());
    host.append(canvas);
    new ResizeObserver(() => this.#resize()).observe(host);
    this.#resize();
  }

  get canvas(): HTMLCanvasElement {
    return this.renderer.domElement;
  }

  /** Called before each drawing: poses, labels. */
  beforeDraw(step: () => void) {
    this.#before.push(step);
  }

  colour(palette: Palette) {
    this.scene.background = new Color(palette.sky);
    this.invalidate();
  }

  /** The sun is near the robot, so that the shadow is always in the map. */
  lightAt(x: number, y: number) {
    this.sun.position.set(x - 0.7, y - 1.3, 3);
    this.sun.target.position.set(x, y, 0);
  }

  invalidate() {
    if (this.#asked) return;
    this.#asked = true;
    requestAnimationFrame(() => {
      this.#asked = false;
      this.draw();
    });
  }

  draw() {
    for (const step of this.#before) step();
    this.renderer.render(this.scene, this.camera);
    this.draws++;
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }
}

/**
 * Quality of drawing. Rendering in software competes with the planner for the processor, so expensive parts are left out. Null
 * without WebGL 2.
 */
function qualityOf(): "low" | "high" | null {
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) return null;
  const info = context.getExtension("WEBGL_debug_renderer_info");
  const name = String(context.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : context.RENDERER));
  context.getExtension("WEBGL_lose_context")?.loseContext();
  const asked = new URLSearchParams(location.search).get("quality");
  if (asked === "low" || asked === "high") return asked;
  return /swiftshader|llvmpipe|software|basic render/i.test(name) ? "low" : "high";
}
