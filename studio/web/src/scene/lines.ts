// Lines from plain lists of numbers, materials that are made once, and what gives the memory of objects back.

import { BufferGeometry, Float32BufferAttribute, type Material, type Object3D } from "three";

export function lineGeometry(points: number[]): BufferGeometry {
  return new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
}

type Kind<M, P> = new (parameters: P) => M;
const materials = new Map<Kind<Material, any>, Map<string, Material>>();
const kept = new Set<Material>();

/**
 * A material that all objects of this look share, for all time. When the last material of a kind is disposed of, its program
 * goes too, and linking it again takes longer than the drawing: what is made anew with every plan has its materials from here.
 */
export function shared<M extends Material, P>(kind: Kind<M, P>, parameters: P): M {
  const ofKind = materials.get(kind) ?? new Map<string, Material>();
  materials.set(kind, ofKind);
  const look = JSON.stringify(parameters);
  const known = ofKind.get(look) ?? new kind(parameters);
  ofKind.set(look, known);
  kept.add(known);
  return known as M;
}

/** Takes objects out of the scene, with their geometries and the materials that are theirs alone. */
export function dispose(group: Object3D) {
  group.removeFromParent();
  group.traverse((object) => {
    const { geometry, material } = object as { geometry?: BufferGeometry; material?: Material | Material[] };
    geometry?.dispose();
    for (const one of Array.isArray(material) ? material : material ? [material] : []) if (!kept.has(one)) one.dispose();
  });
}
