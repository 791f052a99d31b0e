// The ground: lines every 0.1, 0.5 and 1 m that fade with distance, and distances in metres along x and y.

import { CanvasTexture, Color, DoubleSide, Group, Mesh, MeshBasicMaterial, PlaneGeometry, ShaderMaterial, ShadowMaterial } from "three";
import type { Palette } from "./palette.ts";

const SIZE_M = 60;
const LABELS = { from: -2, to: 12, step: 0.5 };

export class Ground {
  readonly group = new Group();
  #grid: ShaderMaterial;
  #labels = new Group();

  constructor(shadows: boolean) {
    this.#grid = new ShaderMaterial({
      uniforms: { fine: { value: new Color() }, strong: { value: new Color() }, centre: { value: [0, 0] } },
      vertexShader: "varying vec2 p; void main() { vec4 w = modelMatrix * vec4(position, 1.0); p = w.xy; gl_Position = projectionMatrix * viewMatrix * w; }",
      fragmentShader: `
        varying vec2 p;
        uniform vec3 fine;
        uniform vec3 strong;
        uniform vec2 centre;
        float lines(float step_m, float width) {
          vec2 at = p / step_m;
          vec2 d = fwidth(at);
          vec2 line = 1.0 - smoothstep(d * width * 0.5, d * (width * 0.5 + 1.0), abs(fract(at - 0.5) - 0.5));
          // Lines closer than a few pixels would be a grey haze.
          vec2 room = 1.0 - smoothstep(0.12, 0.35, d);
          return max(line.x * room.x, line.y * room.y);
        }
        float axis(float at) {
          return 1.0 - smoothstep(fwidth(at) * 0.5, fwidth(at) * 1.5, abs(at));
        }
        void main() {
          float far = 1.0 - smoothstep(1.0, 6.0, distance(p, centre));
          float tenth = lines(0.1, 0.3) * 0.6;
          float half_metre = lines(0.5, 0.5);
          float metre = lines(1.0, 0.7);
          float a = max(max(tenth, half_metre * 0.9), metre);
          vec3 colour = mix(fine, strong, max(metre, max(axis(p.x), axis(p.y))));
          gl_FragColor = vec4(colour, max(a, max(axis(p.x), axis(p.y))) * far);
          #include <colorspace_fragment>
        }`,
      transparent: true,
      depthWrite: false,
      side: DoubleSide,
    });
    const plane = new Mesh(new PlaneGeometry(SIZE_M, SIZE_M), this.#grid);
    plane.renderOrder = -2;
    this.group.add(plane, this.#labels);
    if (shadows) {
      const shade = new Mesh(new PlaneGeometry(SIZE_M, SIZE_M), new ShadowMaterial({ opacity: 0.18 }));
      shade.receiveShadow = true;
      shade.position.z = -0.001;
      shade.renderOrder = -1;
      this.group.add(shade);
    }
  }

  colour(palette: Palette) {
    this.#grid.uniforms.fine.value.set(palette.line);
    this.#grid.uniforms.strong.value.set(palette.lineStrong);
    this.#labels.clear();
    for (let at = LABELS.from; at <= LABELS.to + 1e-9; at += LABELS.step) {
      this.#label(at, 0, palette);
      if (at !== 0 && Math.abs(at) <= 2) this.#label(0, at, palette);
    }
  }

  marks(shown: boolean) {
    this.group.children[0].visible = shown;
    this.#labels.visible = shown;
  }

  centre(x: number, y: number) {
    this.#grid.uniforms.centre.value = [x, y];
  }

  #label(x: number, y: number, palette: Palette) {
    const value = x === 0 ? y : x;
    const text = x === 0 && y === 0 ? "0 m" : `${value.toFixed(1).replace("-", "−")} m`;
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [128, 40];
    const pen = canvas.getContext("2d")!;
    pen.font = "26px system-ui, sans-serif";
    pen.fillStyle = palette.text;
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    pen.fillText(text, 4, 22);
    const texture = new CanvasTexture(canvas);
    texture.anisotropy = 4;
    const material = new MeshBasicMaterial({ map: texture, transparent: true, depthWrite: false, side: DoubleSide });
    const label = new Mesh(new PlaneGeometry(0.128, 0.04), material);
    // Readable from the robot's right side, where the camera is when the page opens.
    label.position.set(x + 0.07, y - 0.028, 0.0005);
    label.renderOrder = -1;
    this.#labels.add(label);
  }
}
