// Lines from plain lists of numbers, and what gives the memory of objects back.

import { BufferGeometry, Float32BufferAttribute, type Material, type Object3D } from "three";

export function lineGeometry(points: number[]): BufferGeometry {
  return new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
}

/** Takes objects out of the scene, with their geometries and materials. */
export function dispose(group: Object3D) {
  group.removeFromParent();
  group.traverse((object) => {
    const { geometry, material } = object as { geometry?: BufferGeometry; material?: Material | Material[] };
    geometry?.dispose();
    for (const one of Array.isArray(material) ? material : material ? [material] : []) one.dispose();
  });
}
