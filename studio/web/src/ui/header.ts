// The header: open files and whether they are saved; open, save, share, undo, theme, help.

import type { Commands } from "../commands.ts";
import { baseName, type Documents } from "../project/documents.ts";
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
  const shareMenu = menu(more, () => commands.shareItems(), "right");
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

  let drawn = "";
  const update = () => {
    const { documents } = studio;
    undo.disabled = !documents.canUndo;
    redo.disabled = !documents.canRedo;
    const now = key(documents);
    if (now === drawn) return;
    drawn = now;
    const mark = (path: string | undefined) =>
      path
        ? h(
            "span",
            { class: "file", title: documents.changed(path) ? `${path}: changed since it was opened or saved` : path },
            baseName(path),
            documents.changed(path) ? h("span", { class: "dot", "aria-label": "changed", role: "img" }) : null,
          )
        : null;
    const { motionPaths, motionPath } = documents;
    const choice = h(
      "select",
      { "aria-label": "Motion", onchange: () => studio.chooseMotion(choice.value) },
      ...motionPaths.map((path) => h("option", { value: path, text: `${baseName(path)}${documents.changed(path) ? " •" : ""}`, selected: path === motionPath })),
    );
    const focused = files.contains(document.activeElement);
    replace(files, motionPaths.length > 1 ? choice : mark(motionPath), documents.robotPath ? h("span", { class: "muted", text: "on" }) : null, mark(documents.robotPath));
    if (focused) choice.focus();
  };
  studio.events.on("documents", update);
  update();
}

/** Key of the displayed file names, from all data that they depend on. */
function key(documents: Documents): string {
  return JSON.stringify([documents.motionPath, documents.now.files.map(({ path }) => [path, documents.changed(path)])]);
}

export function iconButton(name: IconName, label: string, act: () => void): HTMLButtonElement {
  return h("button", { type: "button", class: "icon-button", "aria-label": label, title: label, onclick: act }, picture(name));
}

export function textButton(text: string, name: IconName | null, act?: () => void): HTMLButtonElement {
  return h("button", { type: "button", class: "button", onclick: act }, name ? picture(name) : null, h("span", { text }));
}
