// The library build: one at a time, in a separate lane. The panels of library and robot show it.

import type { Progress } from "../contract.ts";
import { Cancelled } from "../engine/engine.ts";
import type { Edge, Node } from "../panel/graph.ts";
import { baseName } from "./documents.ts";
import type { Studio } from "./studio.ts";

export type Built = { name: string; /** Identity of the library, as robots report it. */ identity: string | null; nodes: Node[]; edges: Edge[]; failures: string[]; bytes: Uint8Array | null };

export class LibraryBuild {
  built: Built | null = null;
  building: { progress: Progress | null; parts: string[] } | null = null;
  #listeners: (() => void)[] = [];
  #of = "";

  constructor(private readonly studio: Studio) {
    studio.events.on("documents", () => {
      if (!this.built || this.#of === this.#documents()) return;
      // The built library belongs to other documents.
      this.built = null;
      this.#tell();
    });
  }

  onChange(listener: () => void) {
    this.#listeners.push(listener);
  }

  async build() {
    const { studio } = this;
    const library = studio.documents.libraryPath;
    if (!library || this.building) return;
    const building = { progress: null as Progress | null, parts: [] as string[] };
    this.building = building;
    this.built = null;
    this.#of = this.#documents();
    this.#tell();
    const progress = (one: Progress) => {
      building.progress = one;
      if (building.parts.at(-1) !== one.what) building.parts.push(one.what);
      this.#tell();
    };
    try {
      const { value, binary } = await studio.engine.request("library", { kind: "library", files: studio.documents.files(), library }, { progress });
      this.built = { name: baseName(library).replace(/\.toml$/, ".rwl"), identity: value.identity, nodes: value.nodes, edges: value.edges, failures: value.failures, bytes: binary };
    } catch (error) {
      if (!(error instanceof Cancelled)) studio.showError(error);
    }
    this.building = null;
    // A build is rare, so its worker and memory are released.
    studio.engine.cancel("library");
    this.#tell();
  }

  stop() {
    this.studio.engine.cancel("library");
  }

  #documents(): string {
    return JSON.stringify(this.studio.documents.now.files);
  }

  #tell() {
    for (const listener of this.#listeners) listener();
  }
}
