// Lines from lists of numbers, shared materials, and disposal of objects.

import { BufferGeometry, Float32BufferAttribute, type Material, type Object3D } from "three";

export function lineGeometry(points: number[]): BufferGeometry {
  return new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
}

type Kind<M, P> = new (parameters: P) => M;
const materials = new Map<Kind<Material, any>, Map<string, Material>>();
const kept = new Set<Material>();

/**
 * A permanent material that all objects of this look share. The disposal of the last material of a kind also deletes its program,
 * and linking it again takes longer than drawing. Objects that are created for every plan use these materials.
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

/** Removes objects from the scene, and disposes of their geometries and unshared materials. */
export function dispose(group: Object3D) {
  group.removeFromParent();
  group.traverse((object) => {
    const { geometry, material } = object as { geometry?: BufferGeometry; material?: Material | Material[] };
    geometry?.dispose();
    for (const one of Array.isArray(material) ? material : material ? [material] : []) if (!kept.has(one)) one.dispose();
  });
}
