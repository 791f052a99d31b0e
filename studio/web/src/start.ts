// Assembles the page around an engine.

import { buildCommands } from "./commands.ts";
import type { Fault } from "./contract.ts";
import type { Engine } from "./engine/engine.ts";
import { libraryPanel } from "./panel/library.ts";
import { motionPanel } from "./panel/motion.ts";
import { reportPanel } from "./panel/report.ts";
import { robotPanel } from "./panel/robot.ts";
import { buildStatus } from "./panel/status.ts";
import { textPane } from "./panel/text.ts";
import { keepSaved } from "./project/autosave.ts";
import { acceptDrops } from "./project/files.ts";
import { openFirst, openLink } from "./project/first.ts";
import { LibraryBuild } from "./project/library.ts";
import { Playback } from "./project/playback.ts";
import { isDark, load, type Settings } from "./project/settings.ts";
import { Studio } from "./project/studio.ts";
import { PlanComparison } from "./robot/beside.ts";
import { RobotLink, talksToRobots } from "./robot/link.ts";
import { runPanel } from "./robot/panel.ts";
import { emergencyStop, playByNumber } from "./robot/stop.ts";
import { View } from "./scene/view.ts";
import { buildTimeline } from "./timeline/timeline.ts";
import { buildTransport } from "./timeline/transport.ts";
import { h } from "./ui/dom.ts";
import { buildHeader } from "./ui/header.ts";
import { bindKeys } from "./ui/keyboard.ts";
import { buildShell } from "./ui/shell.ts";
import { buildViewTools, staleNote } from "./ui/viewtools.ts";

export async function start(root: HTMLElement, engine: Engine) {
  engine.prepare("documents");
  engine.prepare("solver");
  const settings = load();
  const studio = new Studio(engine);
  const playback = new Playback();
  const paint = () => (document.documentElement.dataset.theme = isDark(settings.theme) ? "dark" : "light");
  paint();
  const shell = buildShell(root);
  const view = buildView(shell.view, studio, playback, settings);
  const timeline = buildTimeline(shell.tracks, studio, playback, settings);
  const restyle = () => {
    paint();
    view?.restyle();
    timeline.restyle();
  };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", restyle);

  const commands = buildCommands(studio, playback, view, settings, restyle);
  buildHeader(shell.header, studio, commands);
  buildTransport(shell.transport, studio, playback);
  const tools = view ? buildViewTools(shell.viewTools, view, settings) : null;
  const text = textPane(studio);
  const report = reportPanel(studio, playback);
  const robot = robotPanel(studio);
  shell.tab("Motion", motionPanel(studio, playback));
  shell.tab("Robot", robot.element, robot.shown);
  shell.tab("Report", report.element, report.shown);
  const library = new LibraryBuild(studio);
  shell.tab("Library", libraryPanel(studio, library, commands.examples));
  const link = new RobotLink(studio);
  const beside = new PlanComparison(studio, link);
  staleNote(shell.stale, studio, link);
  const run = shell.tab("Run", runPanel(studio, link, library, beside));
  run.hidden = true;
  emergencyStop(shell.view, link);
  playByNumber(link);
  if (view) link.onChange(() => view.showLive(link.view?.poses ?? null, beside.row()));
  link.onChange(() => playback.hold(link.connected));
  shell.tab("Text", text.element, text.update);
  buildStatus(shell.status, studio, link, {
    jump(fault: Fault) {
      shell.openTab("Text");
      text.jump(fault);
    },
    seek: (time_s) => playback.seek(time_s),
  });
  bindKeys(commands, playback, view, tools);
  acceptDrops(studio, root);

  // For tests and the console; the page itself does not read it.
  Object.assign(globalThis, { studio: { state: studio, playback, view, link, beside } });

  await openFirst(studio);
  run.hidden = !(await talksToRobots(engine));
  if (!run.hidden && RobotLink.takeLeft()) {
    shell.openTab("Run");
    studio.notify("The page was reloaded while a robot was connected. A robot with torque on returns to SAFE automatically, then turns torque off. Connect to see the state of the robot.");
  }
  keepSaved(studio);
  addEventListener("hashchange", () => void openLink(studio));
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches && !navigator.webdriver) playWhenPlanned(studio, playback);
}

/** Builds the 3D view; null without WebGL 2, without which everything else works. */
function buildView(host: HTMLElement, studio: Studio, playback: Playback, settings: Settings): View | null {
  try {
    return new View(host, studio, playback, settings);
  } catch {
    host.append(h("p", { class: "no-view", text: "This browser has no WebGL 2, so the robot cannot be drawn. Planning and editing still work." }));
    studio.events.on("plan", () => playback.setFrames(studio.shown?.frames.header ?? null));
    return null;
  }
}

/** The first motion plays as soon as it is planned, because users look at a moving picture first. */
function playWhenPlanned(studio: Studio, playback: Playback) {
  let played = false;
  const play = () => {
    if (played || !studio.shown) return;
    played = true;
    if (!playback.held) playback.play();
  };
  studio.events.on("plan", play);
  play();
}
