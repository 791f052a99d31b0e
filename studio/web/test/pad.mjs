// A fake gamepad in the page: `navigator.getGamepads` as in browsers.

export function fakePad() {
  const fake = { pad: null };
  /** Presses the buttons with these numbers, and releases all others. */
  fake.hold = (down) => {
    const buttons = Array.from({ length: 17 }, (_, index) => ({ pressed: down.includes(index), value: Number(down.includes(index)) }));
    // Rests a finger on the left trigger. Browsers may report it as pressed long before it is halfway down.
    buttons[6] = { pressed: true, value: 0.05 };
    const id = "Xbox 360 Controller (STANDARD GAMEPAD Vendor: 045e Product: 028e)";
    fake.pad = { id, index: 0, connected: true, mapping: "standard", buttons, axes: [0, 0, 0, 0] };
  };
  globalThis.fakePad = fake;
  navigator.getGamepads = () => [fake.pad, null, null, null];
}
