// Display settings, which this browser keeps between sessions.

export type Layer =
  | "forces"
  | "cones"
  | "com_path"
  | "foot_paths"
  | "polygon"
  | "ghosts"
  | "clearance"
  | "targets"
  | "marks";

export type Theme = "system" | "light" | "dark";

export type Settings = { theme: Theme; layers: Record<Layer, boolean>; follow: boolean; plotHeight: number; quantity: string };

const KEY = "rollwalk-studio-settings";

const DEFAULTS: Settings = {
  theme: "system",
  layers: {
    forces: true,
    cones: false,
    com_path: true,
    foot_paths: true,
    polygon: true,
    ghosts: false,
    clearance: false,
    targets: true,
    marks: true,
  },
  follow: true,
  plotHeight: 150,
  quantity: "joint_torque",
};

export function load(): Settings {
  try {
    const kept = JSON.parse(localStorage.getItem(KEY) ?? "{}");
    return { ...DEFAULTS, ...kept, layers: { ...DEFAULTS.layers, ...kept.layers } };
  } catch {
    return structuredClone(DEFAULTS);
  }
}

export function save(settings: Settings) {
  try {
    localStorage.setItem(KEY, JSON.stringify(settings));
  } catch {
    // Storage may be full or forbidden. Then settings last until the page is closed.
  }
}

/** True for dark colours. */
export function isDark(theme: Theme): boolean {
  return theme === "dark" || (theme === "system" && matchMedia("(prefers-color-scheme: dark)").matches);
}

/** Value that is stored until the tab is closed, also across reloads; null without one, or if storage is forbidden. */
export function kept(key: string): string | null {
  try {
    return sessionStorage.getItem(key);
  } catch {
    return null;
  }
}

/** `null` removes the value. */
export function keep(key: string, value: string | null) {
  try {
    if (value === null) sessionStorage.removeItem(key);
    else sessionStorage.setItem(key, value);
  } catch {
    // Without storage, a reload loses the value.
  }
}
