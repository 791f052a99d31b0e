// Elements in one call. Attributes that begin with "on" are listeners; `text` is text, never markup.

type Value = string | number | boolean | null | undefined | ((event: any) => void);
type Child = Node | string | null | undefined | false;

export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Record<string, Value> = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  return dress(document.createElement(tag), attributes, children);
}

export function s<K extends keyof SVGElementTagNameMap>(
  tag: K,
  attributes: Record<string, Value> = {},
  ...children: Child[]
): SVGElementTagNameMap[K] {
  return dress(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
}

function dress<T extends Element>(element: T, attributes: Record<string, Value>, children: Child[]): T {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value as EventListener);
    else if (name === "text") element.textContent = String(value);
    else element.setAttribute(name, value === true ? "" : String(value));
  }
  for (const child of children) if (child) element.append(child);
  return element;
}

/** An icon by the path of its strokes on a grid of 20. */
export function icon(path: string): SVGElement {
  return s("svg", { viewBox: "0 0 20 20", class: "icon", "aria-hidden": "true" }, s("path", { d: path }));
}

export function replace(parent: Element, ...children: Child[]) {
  parent.replaceChildren(...children.filter((child): child is Node | string => !!child));
}

/** A number with the given maximum of decimals, and a real minus sign. */
export function format(value: number, digits = 3): string {
  if (!Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  const bare = Number(text) === 0 ? (0).toFixed(digits) : text;
  return bare.replace("-", "−");
}

/** Text in which names in backticks are set as code, as in messages of the engine. */
export function prose(text: string): DocumentFragment {
  const fragment = document.createDocumentFragment();
  text.split("`").forEach((part, index) => fragment.append(index % 2 === 1 ? h("code", { text: part }) : part));
  return fragment;
}
