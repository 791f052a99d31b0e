// Messages between page and engine: requests, answers and their values. Frames: world, z up. Names contain units; all are SI.

export type Vec3 = [number, number, number];
export type File = { path: string; text: string };

/** Names of the command line's files that the page shows first. */
export type InitialFiles = Record<"motion" | "library" | "robot" | "robot_in_motion" | "plan" | "urdf" | "side", string | null>;

/** Start of a solve; the request contains a plan file as bytes. */
export type Start = "scratch" | "good" | "plan";

export type RequestBody =
  | { kind: "examples" }
  | { kind: "example"; path: string }
  | { kind: "import"; urdf: File; side: File | null }
  | { kind: "begin"; files: File[]; robot: string }
  | { kind: "open"; files: File[]; motion: string }
  | { kind: "amend"; files: File[]; motion: string; path: string; edit: Edit }
  | { kind: "plan"; files: File[]; motion: string; from: Start; iterations: number | null; frames_hz: number }
  | { kind: "report" }
  | { kind: "plan_json" }
  | { kind: "animation" }
  | { kind: "solution" }
  | { kind: "resume" }
  | { kind: "slopes"; files: File[]; motion: string }
  | { kind: "graph"; files: File[]; library: string }
  | { kind: "new_library"; files: File[]; motion: string }
  | { kind: "library"; files: File[]; library: string }
  | { kind: "compare"; files: File[]; motion: string; library: string }
  | { kind: "export"; what: "csv" | "json"; rate_hz: number }
  /** Files of the command line, if the engine is in the program that serves the page. */
  | { kind: "given" }
  | { kind: "keep"; text: string; by: string; from: string }
  | { kind: "save"; path: string; text: string }
  | ({ kind: "robot"; now_us: number } & RobotRequest);

export type ConnectionKind = "simulated" | "serial" | "slcan" | "relay";
export type Intent = "arm" | "pause_or_resume" | "return" | "disarm" | "estop" | "clear" | "quit";

/** Request to a robot at the other end of a link. The bytes of the answer must be sent to the robot. */
export type RobotRequest =
  | { robot: "connect"; place: ConnectionKind; files: File[]; file: string; node: number; gamepad: boolean; key: { text: string; nonce: [number, number] } | null }
  | { robot: "tick"; attended: boolean; gamepad: GamepadSeen[] }
  | { robot: "wish"; intent: Intent }
  | { robot: "wish"; intent: "play"; code: number }
  | { robot: "wish"; intent: "speed"; sixty_fourths: number }
  | { robot: "flash" }
  | { robot: "name" }
  | { robot: "leave" };

/** A standard gamepad of the Gamepad API, or the reason why there is none. */
export type GamepadSeen = { id: string; buttons: number[]; axes: number[] } | { gone: string };

export type RobotView = {
  time_s: number;
  contact: boolean;
  round_trip_ms: number | null;
  lost: [number, number];
  state: string | null;
  torque: boolean;
  can_arm: boolean;
  can_play: boolean;
  paused: boolean;
  advice: string;
  mismatch: string | null;
  complaint: string | null;
  faults: string[];
  motions: { name: string; code: number | null; looping: boolean }[];
  /** Motion that plays: clip in the library, present time within the clip, and playback rate (1 at planned speed). */
  playing: { name: string; clip: number; time_s: number; rate: number } | null;
  library: string | null;
  transfer: [number, number] | null;
  asking: string | null;
  /** The gamepad in a few words, if one is used. */
  gamepad: string | null;
  stopping: boolean;
  leaving: "no" | "when_home" | "now";
  speed_64ths: number;
  channels: { name: string; position_rad: number; speed_rad_s: number; torque_nm: number; age_s: number; temperature_c: number | null; voltage_v: number | null }[];
  /** Poses of the scene's bodies, world_from_body. */
  poses: number[][];
  simulated: { fallen: boolean; held: boolean } | null;
  messages: { at_s: number; weight: "note" | "refused" | "warning"; text: string }[];
};

export type Edit =
  | { edit: "number"; table: string[]; key: string; value: number | null }
  | { edit: "text"; table: string[]; key: string; value: string | null }
  | { edit: "gait"; gait: string; duty: number | null }
  | { edit: "footfalls"; stance: boolean[][] }
  | { edit: "swing"; end_effector: number; from: number; to: number; stance: boolean }
  | { edit: "target"; index: number | null; target: Target | null }
  | { edit: "height"; index: number | null; height: Height | null }
  | { edit: "parameter"; name: string; value: number }
  | { edit: "add_motion"; name: string; file: string }
  | { edit: "remove_motion"; name: string }
  | { edit: "transition"; from: string; to: string; duration_s: number | null }
  /** Replaces the value `from` of a limit, wherever the robot file contains it under this key. */
  | { edit: "everywhere"; key: string; from: number; value: number };

export type Fault = {
  path: string;
  message: string;
  label: string;
  help: string;
  line: number;
  column: number;
  /** UTF-8 byte offsets into the text. */
  span: [number, number];
};

export type Shape = {
  position_m: Vec3;
  orientation_wxyz: [number, number, number, number];
  role: "part" | "clearance" | "wheel" | "foot" | "blade";
} & (
  | { shape: "box"; size_m: Vec3 }
  | { shape: "cylinder"; radius_m: number; length_m: number } // axis along y
  | { shape: "sphere"; radius_m: number }
  | { shape: "capsule"; radius_m: number; length_m: number } // axis along z
);

export type Joint = {
  name: string;
  /** Link that the joint moves. */
  body: number;
  position_min_rad: number;
  position_max_rad: number;
  speed_max_rad_s: number;
  torque_max_nm: number;
};

export type EndEffector = {
  name: string;
  contact: string;
  radius_m: number;
  body: number;
  wheel_body: number | null;
  driven: boolean;
  friction_coefficient: number;
  motor_speed_max_rad_s: number | null;
  motor_torque_max_nm: number | null;
};

export type Parameter = {
  name: string;
  label: string;
  unit: string;
  value: number;
  min: number;
  max: number;
  step: number;
};

/** A quantity of plans, and its change with a small step of each parameter, with the motion planned again. */
export type QuantitySlopes = { name: string; unit: string; value: number; /** Changes are not compared with less than this. */ little: number; slopes: { name: string; step: number; by_step: number }[] };

export type Scene = {
  name: string;
  bodies: { name: string; shapes: Shape[] }[];
  /** Poses of all bodies of the standing robot, `x y z qw qx qy qz`; empty if the robot cannot stand. */
  standing: number[][];
  joints: Joint[];
  end_effectors: EndEffector[];
  mass_kg: number;
  parameters: Parameter[];
};

export type Target = {
  of: string;
  at_s: number;
  forward_m?: number | null;
  left_m?: number | null;
  up_m?: number | null;
  speed_forward_m_s?: number | null;
  speed_left_m_s?: number | null;
  speed_up_m_s?: number | null;
  heading_rad?: number | null;
};

export type Height = {
  of: string;
  from_s?: number | null;
  to_s?: number | null;
  above_m?: number | null;
  below_m?: number | null;
};

export type Goal = { forward_m: number | null; left_m: number | null; turn_rad: number | null };

export type MotionView = {
  name: string;
  ends: "periodic" | "at_rest";
  duration_s: number;
  samples: number;
  swing_height_m: number;
  /** [end effector][sample] */
  stance: boolean[][];
  goal: Goal;
  targets: Target[];
  heights: Height[];
  gaits: string[];
  needs_feedback: string | null;
};

export type Fix = { label: string; path: string; edit: Edit };

export type Culprit = {
  constraint: string;
  what: string;
  from_s: number | null;
  to_s: number | null;
  end_effector: number | null;
  joint: number | null;
  advice: string;
  fix?: Fix | null;
};

export type Solve = {
  status: string;
  words: string;
  iterations: number;
  energy: number;
  worst_level: number;
  worst_constraint: string;
  culprits: Culprit[];
};

/** Motions and transitions in the text of a library file, read without validation. */
export type Graph = {
  motions: { name: string; file: string; code: number | null; periodic: boolean }[];
  /** Name of the motion that is SAFE. */
  safe: string;
  /** Duration of the transitions between SAFE and all other motions, s; null without them. */
  via_safe_s: number | null;
  /** Transitions that the file lists individually. */
  transitions: { from: string; to: string; duration_s: number | null }[];
  /** Motion files of the project that the library does not contain. */
  others: { name: string; file: string }[];
  faults: Fault[];
};

export type FramesHeader = {
  count: number;
  rate_hz: number;
  duration_s: number;
  period: { offset_m: [number, number]; yaw_rad: number } | null;
  width: number;
  columns: { bodies: number; com: number; end_effectors: number; joints: number; wheels: number };
};

export type OpenedDocuments = { scene: Scene; motion: MotionView; /** Paths of motion and robot as they were found. */ read: [string, string] };
export type Planned = OpenedDocuments & { solve: Solve; frames: FramesHeader; converged: boolean; good: boolean };

export type Progress = {
  /** Outcome of the first start, after it has found the request infeasible. */
  refused?: Solve;
  iteration: number;
  worst_level: number;
  worst_constraint: string;
  what: string;
};
