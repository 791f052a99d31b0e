// Transport: play, pause, to the start, loop, speed, time as a number, and progress of planning.

import { type Playback, SPEEDS } from "../project/playback.ts";
import type { Studio } from "../project/studio.ts";
import { format, h, replace } from "../ui/dom.ts";
import { iconButton } from "../ui/header.ts";
import { picture } from "../ui/icons.ts";

export function buildTransport(host: HTMLElement, studio: Studio, playback: Playback) {
  const play = iconButton("play", "Play (Space)", () => playback.toggle());
  play.classList.add("primary");
  const start = iconButton("start", "To the start (Home)", () => playback.seek(0));
  const loop = iconButton("loop", "Repeat", () => {
    playback.loop = !playback.loop;
    loop.setAttribute("aria-pressed", String(playback.loop));
  });
  loop.setAttribute("aria-pressed", String(playback.loop));
  const speed = h("select", { "aria-label": "Speed of playback", onchange: () => (playback.speed = Number(speed.value)) }, ...SPEEDS.map((one) => h("option", { value: one, text: `${one}×`, selected: one === 1 })));
  const time = h("span", { class: "time" });
  const cycle = h("span", { class: "muted" });
  const hint = h("span", { class: "muted hint", text: "Footfalls: drag a gap or its edges; drag over a bar to paint a new swing; Delete removes a swing" });
  replace(host, start, play, loop, speed, time, cycle, h("span", { class: "gap" }), hint);

  let playing: boolean | null = null;
  let held = false;
  const update = () => {
    play.disabled = playback.held;
    if (playing !== playback.playing || held !== playback.held) {
      ({ playing, held } = playback);
      replace(play, picture(playing ? "pause" : "play"));
      const title = held ? "The view shows the robot. Disconnect to play plans" : playing ? "Pause (Space)" : "Play (Space)";
      play.setAttribute("aria-label", title);
      play.title = title;
    }
    time.textContent = `${format(playback.within_s, 2)} s / ${format(playback.duration_s, 2)} s`;
    cycle.textContent = playback.cycle > 0 ? `cycle ${playback.cycle + 1}` : "";
  };
  playback.onChange(update);
  studio.events.on("plan", update);
  update();
}
