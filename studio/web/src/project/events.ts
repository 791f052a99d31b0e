// Named events with their listeners.

export class Events<Name extends string> {
  #listeners = new Map<Name, (() => void)[]>();

  on(names: Name | Name[], listener: () => void) {
    for (const name of Array.isArray(names) ? names : [names]) {
      const list = this.#listeners.get(name) ?? [];
      list.push(listener);
      this.#listeners.set(name, list);
    }
  }

  emit(...names: Name[]) {
    const called = new Set<() => void>();
    for (const name of names) for (const listener of this.#listeners.get(name) ?? []) called.add(listener);
    for (const listener of called) {
      try {
        listener();
      } catch (error) {
        // A view that fails to draw must not stop planning or other views.
        console.error(error);
      }
    }
  }
}
