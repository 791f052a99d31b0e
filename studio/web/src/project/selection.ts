// Common highlight of scene, chart and panel: a target, an end effector, a joint, a span of time.

export type Span = { from_s: number; to_s: number };

export class Selection {
  target: number | null = null;
  endEffector: number | null = null;
  joint: number | null = null;
  span: Span | null = null;
  /** The highlighted culprit, if the highlight comes from one. */
  culprit: number | null = null;

  constructor(private readonly changed: () => void) {}

  selectTarget(index: number | null) {
    this.clear(false);
    this.target = index;
    this.changed();
  }

  blame(culprit: number, endEffector: number | null, joint: number | null, span: Span | null) {
    this.clear(false);
    this.culprit = culprit;
    this.endEffector = endEffector;
    this.joint = joint;
    this.span = span;
    this.changed();
  }

  clear(tell = true) {
    this.target = this.endEffector = this.joint = this.span = this.culprit = null;
    if (tell) this.changed();
  }
}
