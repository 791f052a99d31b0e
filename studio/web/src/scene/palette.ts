// Colours of the scene, light and dark, and of end effectors. The latter are Okabe and Ito's, which colour-blind people can
// distinguish; a short name is always beside them.

export type Palette = {
  sky: number;
  line: number;
  lineStrong: number;
  text: string;
  part: number;
  edge: number;
  wheel: number;
  foot: number;
  com: number;
  force: number;
  cone: number;
  polygon: number;
  accent: number;
  danger: number;
};

export const LIGHT: Palette = {
  sky: 0xf3f5f7,
  line: 0xd5dbe1,
  lineStrong: 0xa9b4bf,
  text: "#5b6570",
  part: 0xb9c4cf,
  edge: 0x5f6b78,
  wheel: 0x3a424b,
  foot: 0x3a424b,
  com: 0x1a1d21,
  force: 0xc2410c,
  cone: 0xc2410c,
  polygon: 0x0b6bcb,
  accent: 0x0b6bcb,
  danger: 0xc62828,
};

export const DARK: Palette = {
  sky: 0x15181c,
  line: 0x262c33,
  lineStrong: 0x414b56,
  text: "#97a3af",
  part: 0x8895a3,
  edge: 0xa9b6c2,
  wheel: 0x46515c,
  foot: 0x46515c,
  com: 0xf0f3f6,
  force: 0xff9a5c,
  cone: 0xff9a5c,
  polygon: 0x5aa9ff,
  accent: 0x5aa9ff,
  danger: 0xff6b6b,
};

const FEET_LIGHT = ["#0072b2", "#b35900", "#007a5a", "#a8407f", "#5b5bd6", "#6b6b00"];
const FEET_DARK = ["#56b4e9", "#e69f00", "#2bc49a", "#e08cc0", "#a5a5ff", "#d6d64a"];

export function footColour(index: number, dark: boolean): string {
  const feet = dark ? FEET_DARK : FEET_LIGHT;
  return feet[index % feet.length];
}

/** Short names that fit beside a line: front_left -> FL. Names whose short forms would be equal stay long. */
export function shortNames(names: string[]): string[] {
  const short = names.map((name) => name.split("_").map((word) => word[0]?.toUpperCase() ?? "").join(""));
  return new Set(short).size === names.length ? short : names;
}
