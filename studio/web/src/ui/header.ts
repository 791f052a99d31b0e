// The header: what is open and whether it is saved, open, save, share, undo, theme, help.

import type { Commands } from "../commands.ts";
import { baseName } from "../project/documents.ts";
import type { Studio } from "../project/studio.ts";
import { h, replace } from "./dom.ts";
import { type IconName, picture } from "./icons.ts";
import { menu } from "./menu.ts";

export function buildHeader(host: HTMLElement, studio: Studio, commands: Commands) {
  const files = h("div", { class: "files" });
  const undo = iconButton("undo", "Undo (Ctrl+Z)", commands.undo);
  const redo = iconButton("redo", "Redo (Ctrl+Y)", commands.redo);
  const save = textButton("Save", "save");
  const more = textButton("Share", "share");
  const theme = iconButton("theme", "Theme", () => {});
  const saveMenu = menu(save, () => commands.saveItems(), "left");
  const shareMenu = menu(more, () => commands.shareItems(), "left");
  const themeMenu = menu(theme, () => commands.themeItems(), "right");
  replace(
    host,
    h("div", { class: "brand", text: "Rollwalk studio" }),
    files,
    h("div", { class: "gap" }),
    h("div", { class: "group" }, undo, redo),
    h(
      "div",
      { class: "group" },
      textButton("Examples", null, commands.examples),
      textButton("Open", "open", commands.open),
      saveMenu,
      shareMenu,
    ),
    h("div", { class: "group" }, themeMenu, iconButton("help", "Keyboard and mouse (?)", commands.help)),
  );

  const update = () => {
    const { documents } = studio;
    const mark = (path: string | undefined) =>
      path
        ? h(
            "span",
            { class: "file", title: documents.changed(path) ? `${path}: changed since it was opened or saved` : path },
            baseName(path),
            documents.changed(path) ? h("span", { class: "dot", "aria-label": "changed", role: "img" }) : null,
          )
        : null;
    replace(files, mark(documents.motionPath), documents.robotPath ? h("span", { class: "muted", text: "on" }) : null, mark(documents.robotPath));
    undo.disabled = !documents.canUndo;
    redo.disabled = !documents.canRedo;
  };
  studio.events.on("documents", update);
  update();
}

export function iconButton(name: IconName, label: string, act: () => void): HTMLButtonElement {
  return h("button", { type: "button", class: "icon-button", "aria-label": label, title: label, onclick: act }, picture(name));
}

export function textButton(text: string, name: IconName | null, act?: () => void): HTMLButtonElement {
  return h("button", { type: "button", class: "button", onclick: act }, name ? picture(name) : null, h("span", { text }));
}
