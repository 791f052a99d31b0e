// A gamepad that is none, in the page: `navigator.getGamepads` as browsers have it.

export function fakePad() {
  const fake = { pad: null };
  /** Buttons with these numbers are down, no others. */
  fake.hold = (down) => {
    const buttons = Array.from({ length: 17 }, (_, index) => ({ pressed: down.includes(index), value: Number(down.includes(index)) }));
    // A finger on the left trigger: browsers may call it pressed long before it is half way down.
    buttons[6] = { pressed: true, value: 0.05 };
    const id = "Xbox 360 Controller (STANDARD GAMEPAD Vendor: 045e Product: 028e)";
    fake.pad = { id, index: 0, connected: true, mapping: "standard", buttons, axes: [0, 0, 0, 0] };
  };
  globalThis.fakePad = fake;
  navigator.getGamepads = () => [fake.pad, null, null, null];
}
