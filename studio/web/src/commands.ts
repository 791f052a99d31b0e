// Commands of header, menus and keyboard.

import { Cancelled } from "./engine/engine.ts";
import { baseName } from "./project/documents.ts";
import { download, pickFiles, saveDocument } from "./project/files.ts";
import type { Playback } from "./project/playback.ts";
import { save, type Settings, type Theme } from "./project/settings.ts";
import { linkTo } from "./project/share.ts";
import type { Studio } from "./project/studio.ts";
import { canRecord, savePicture, saveVideo } from "./scene/record.ts";
import type { View } from "./scene/view.ts";
import { openGallery } from "./ui/gallery.ts";
import { openHelp } from "./ui/help.ts";
import type { Item } from "./ui/menu.ts";

export type Commands = ReturnType<typeof buildCommands>;

export function buildCommands(studio: Studio, playback: Playback, view: View | null, settings: Settings, restyle: () => void) {
  const name = () => studio.motion?.name ?? "motion";
  const exported = async (file: string, body: Parameters<Studio["engine"]["request"]>[1]) => {
    try {
      const { value, binary } = await studio.engine.request("solver", body);
      download(file, binary ?? value.text);
      studio.notify(`Saved ${file}.`);
    } catch (error) {
      if (!(error instanceof Cancelled)) studio.showError(error);
    }
  };
  const share = async () => {
    try {
      const link = await linkTo(studio.documents.now);
      await navigator.clipboard.writeText(link);
      const isPublic = location.protocol.startsWith("http") && !["127.0.0.1", "localhost"].includes(location.hostname);
      const limit = isPublic ? "" : " The link works only on computers where this page has the same address. Send others the files or the animation instead.";
      studio.notify(`Copied a link of ${link.length} characters that contains the whole project. Nothing was sent.${limit}`);
    } catch {
      // Without a clipboard (not allowed, or an insecure page), the link goes to the address bar.
      history.replaceState(null, "", await linkTo(studio.documents.now));
      studio.notify("The link is in the address bar and contains the whole project. Nothing was sent.");
    }
  };
  const planned = () => studio.shown === null;
  return {
    undo: () => studio.undo(),
    redo: () => studio.redo(),
    open: () => void pickFiles(studio),
    save: () => void saveDocument(studio, studio.documents.motionPath),
    examples: () => void openGallery(studio),
    help: () => openHelp(studio.engine.place),
    saveItems: (): Item[] => [
      ...studio.documents.now.files.map(({ path }, index) => ({
        text: baseName(path),
        hint: studio.documents.changed(path) ? "changed" : undefined,
        shortcut: index === studio.documents.now.files.findIndex((file) => file.path === studio.documents.motionPath) ? "Ctrl+S" : undefined,
        act: () => void saveDocument(studio, path),
      })),
      "line",
      { heading: "Export the plan" },
      { text: `${name()}.json`, hint: "plan file", disabled: planned(), act: () => void exported(`${name()}.json`, { kind: "plan_json" }) },
      { text: `${name()}.csv`, hint: "table, 60 Hz", disabled: planned(), act: () => void exported(`${name()}.csv`, { kind: "export", what: "csv", rate_hz: 60 }) },
    ],
    shareItems: (): Item[] => [
      { text: "Copy link", hint: "the link itself contains the project; nothing is sent", act: () => void share() },
      "line",
      {
        text: "Animation",
        hint: "SVG that moves in any browser and in READMEs",
        disabled: planned(),
        act: () => void exported(`${name()}.svg`, { kind: "animation" }),
      },
      { text: "Picture", hint: "PNG of the view", disabled: planned() || !view, act: () => view && savePicture(view.stage, `${name()}.png`) },
      {
        text: "Video",
        hint: "WebM of one run at the chosen speed",
        disabled: planned() || !view || !canRecord || playback.held,
        act: () => {
          if (!view) return;
          studio.notify("Recording…");
          saveVideo(view.stage, playback, `${name()}.webm`).then(
            () => studio.notify(`Saved ${name()}.webm.`),
            (error) => studio.showError(error),
          );
        },
      },
    ],
    themeItems: (): Item[] =>
      (["system", "light", "dark"] as Theme[]).map((theme) => ({
        text: { system: "As the system", light: "Light", dark: "Dark" }[theme],
        checked: settings.theme === theme,
        act() {
          settings.theme = theme;
          save(settings);
          restyle();
        },
      })),
  };
}
