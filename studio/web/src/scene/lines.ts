// Lines from plain lists of numbers.

import { BufferGeometry, Float32BufferAttribute } from "three";

export function lineGeometry(points: number[]): BufferGeometry {
  return new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
}
