//! What page and engine say to each other: JSON, tagged by `kind`. Frames: world, z up; units m, rad, N, N·m, s.
//!
//! Every request has a number, `seq`, which its answers repeat: any count of `progress`, then one `done`, `faults` or `error`.

use rollwalk_planner::Progress;
use rollwalk_planner::plan::Status;
use rollwalk_planner::report::Report;
use serde::{Deserialize, Serialize};

/// A request.
#[derive(Clone, Debug, Deserialize)]
pub struct Request {
    /// Number of the request.
    pub seq: u64,
    /// What is wanted.
    #[serde(flatten)]
    pub wanted: Wanted,
}

/// What a page wants.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Wanted {
    /// Names and titles of the shipped files.
    Examples,
    /// The text of one of them.
    Example {
        /// Its path, as in [`Listed::path`].
        path: String,
    },
    /// Reads and validates documents.
    Open {
        /// The documents.
        files: Vec<File>,
        /// Path of the motion file among them.
        motion: String,
    },
    /// Changes one thing in the text of a document.
    Amend {
        /// The documents.
        files: Vec<File>,
        /// Path of the motion file among them.
        motion: String,
        /// Path of the document to change.
        path: String,
        /// The change.
        edit: Edit,
    },
    /// Plans the motion of documents.
    Plan {
        /// The documents.
        files: Vec<File>,
        /// Path of the motion file among them.
        motion: String,
        /// Where the solve starts.
        from: From,
        /// Most iterations of a step while something is dragged; without, the plan is made in full.
        iterations: Option<usize>,
        /// Rate of the frames, Hz.
        frames_hz: f64,
    },
    /// What the shown plan is worth.
    Report,
    /// The shown plan as a file.
    PlanJson,
    /// The shown plan as a table.
    Export {
        /// Its form.
        what: TableForm,
        /// Rows per second, Hz.
        rate_hz: f64,
    },
    /// The last good plan with its multipliers, as bytes.
    Solution,
    /// Goes on from the bytes of `solution`, which come with the request.
    Resume,
    /// Builds a motion library.
    Library {
        /// The documents.
        files: Vec<File>,
        /// Path of the library file among them.
        library: String,
    },
}

/// Form of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TableForm {
    /// Comma-separated values.
    Csv,
    /// JSON.
    Json,
}

/// A change of one thing in a document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "edit", rename_all = "snake_case")]
pub enum Edit {
    /// A number of a table, or none.
    Number {
        /// Keys of the table, in arrays of tables indices; empty for the top of the document.
        table: Vec<String>,
        /// Key of the number.
        key: String,
        /// The number; none removes the key.
        value: Option<f64>,
    },
    /// A text of a table, or none.
    Text {
        /// As of numbers.
        table: Vec<String>,
        /// Key of the text.
        key: String,
        /// The text; none removes the key.
        value: Option<String>,
    },
    /// A number wherever the document has it.
    Everywhere {
        /// Its key.
        key: String,
        /// What it is.
        from: f64,
        /// What it becomes.
        value: f64,
    },
    /// A named gait.
    Gait {
        /// Its name, or `stance`.
        gait: String,
        /// Share of the cycle that a foot stands; without, the former one stays.
        duty: Option<f64>,
    },
    /// All footfalls.
    Footfalls {
        /// Whether an end effector is on the ground, `[end effector][sample]`.
        stance: Vec<Vec<bool>>,
    },
    /// Footfalls of one end effector over a span of samples.
    Swing {
        /// Index of the end effector.
        end_effector: usize,
        /// First sample.
        from: usize,
        /// Last sample; in periodic motions it may be before the first.
        to: usize,
        /// On the ground, or in the air.
        stance: bool,
    },
    /// A target of the motion.
    Target {
        /// Which one; none for a new one.
        index: Option<usize>,
        /// The target; none removes it.
        target: Option<Target>,
    },
    /// A height limit of the motion.
    Height {
        /// Which one; none for a new one.
        index: Option<usize>,
        /// The limit; none removes it.
        height: Option<Height>,
    },
    /// A parameter of the robot.
    Parameter {
        /// As in [`Parameter::name`].
        name: String,
        /// Its value, in its unit.
        value: f64,
    },
}

/// Where a solve starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum From {
    /// From the starts that the planner knows.
    Scratch,
    /// From the last good plan.
    Good,
}

/// A document.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct File {
    /// Its path, with `/` between folders.
    pub path: String,
    /// Its text.
    pub text: String,
}

/// An answer with the number of its request.
#[derive(Clone, Debug, Serialize)]
pub struct Told<'a> {
    /// Number of the request.
    pub seq: u64,
    /// Whether bytes follow.
    pub binary: bool,
    /// The answer.
    #[serde(flatten)]
    pub answer: &'a Answer,
}

/// An answer.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Answer {
    /// An iteration of a solve.
    Progress {
        /// Its number, from 1.
        iteration: usize,
        /// Worst constraint residual as a fraction of its tolerance.
        worst_level: f64,
        /// The worst constraint.
        worst_constraint: &'static str,
        /// What is being planned.
        what: String,
    },
    /// The result.
    Done(Box<Done>),
    /// The documents have faults; nothing else happened.
    Faults {
        /// The faults, in the order of the documents' texts.
        faults: Vec<Fault>,
    },
    /// The request cannot be served.
    Error {
        /// Why.
        message: String,
        /// What would be right.
        help: String,
    },
}

/// The result of a request.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Done {
    /// Of `examples`.
    Examples {
        /// The shipped files.
        examples: Vec<Listed>,
    },
    /// Of `example`, `plan_json` and `export`.
    Text {
        /// The text.
        text: String,
    },
    /// Of `open`.
    Opened(Opened),
    /// Of `amend`.
    Amended {
        /// The text after the edit.
        text: String,
        /// Faults that the documents have with it.
        faults: Vec<Fault>,
    },
    /// Of `plan`; its bytes are the frames.
    Planned {
        /// What was planned.
        #[serde(flatten)]
        opened: Opened,
        /// Outcome of the solve.
        solve: Solve,
        /// What the frames are.
        frames: FramesHeader,
        /// Whether all constraints hold, at the samples and as the motion is played.
        converged: bool,
        /// Whether the plan is the start of plans to come.
        good: bool,
    },
    /// Of `report`.
    Reported {
        /// What the plan is worth, in words.
        words: String,
        /// Whether it may be played.
        holds: bool,
        /// The report, as `rollwalk report --json` has it.
        #[serde(flatten)]
        report: Report,
    },
    /// Of `library`; its bytes are the library, unless a plan does not hold.
    Library {
        /// Motions, in the order of the file.
        nodes: Vec<Node>,
        /// Transitions that were planned.
        edges: Vec<Edge>,
        /// Index of the motion that is SAFE.
        safe: usize,
        /// Plans that do not hold, because of which there is no library.
        failures: Vec<String>,
    },
    /// Of `solution` and `resume`.
    Kept {},
}

/// A motion of a library.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Node {
    /// Its name.
    pub name: String,
    /// Command code that selects it.
    pub code: u8,
    /// Duration, s; of periodic motions the period.
    pub duration_s: f64,
    /// Frames at 60 Hz; none without a library.
    pub frames: Option<usize>,
    /// Whether it repeats.
    pub periodic: bool,
    /// Status of its plan.
    pub status: Status,
}

/// A transition of a library.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Edge {
    /// Index of the motion that it leaves.
    pub from: usize,
    /// Index of the motion that it enters.
    pub to: usize,
    /// Duration, s.
    pub duration_s: f64,
    /// Frames at 60 Hz; none without a library.
    pub frames: Option<usize>,
    /// Status of its plan.
    pub status: Status,
}

impl Answer {
    /// Progress of the solve of `what`.
    pub fn progress(state: &Progress, what: &str) -> Self {
        Self::Progress {
            iteration: state.iteration,
            worst_level: state.worst_level,
            worst_constraint: state.worst_constraint.name(),
            what: what.to_owned(),
        }
    }
}

/// A shipped file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Listed {
    /// Its path in the checkout.
    pub path: &'static str,
    /// What it describes.
    pub of: Of,
    /// Its name.
    pub name: String,
    /// What its first lines say of it.
    pub title: String,
    /// Path of the robot file that it names.
    pub robot: Option<String>,
}

/// What a shipped file describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Of {
    /// A robot.
    Robot,
    /// A motion.
    Motion,
    /// A motion library.
    Library,
    /// What may change about a robot.
    Design,
}

/// A fault of a document.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Fault {
    /// The document.
    pub path: String,
    /// What is wrong.
    pub message: String,
    /// Short note at the text.
    pub label: String,
    /// What would be right.
    pub help: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// Where the text begins and ends, in bytes of UTF-8.
    pub span: [usize; 2],
}

/// Documents that were read.
#[derive(Clone, Debug, Serialize)]
pub struct Opened {
    /// The robot.
    pub scene: Scene,
    /// The motion.
    pub motion: MotionView,
    /// Paths of the documents that were read, as they were found: motion, robot.
    pub read: [String; 2],
}

/// A robot to be drawn.
#[derive(Clone, Debug, Serialize)]
pub struct Scene {
    /// Name of the robot.
    pub name: String,
    /// Bodies that move: the links, then every wheel that turns.
    pub bodies: Vec<Body>,
    /// Poses of the bodies as the robot stands, world_from_body, `x y z qw qx qy qz`.
    pub standing: Vec<[f64; 7]>,
    /// Joints, in robot order.
    pub joints: Vec<Joint>,
    /// Feet, wheels and blades, in robot order.
    pub end_effectors: Vec<EndEffector>,
    /// Mass of the robot, kg.
    pub mass_kg: f64,
    /// Numbers of the robot file that are worth a slider.
    pub parameters: Vec<Parameter>,
}

/// A number of a robot file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// By which edits name it.
    pub name: String,
    /// As people call it.
    pub label: String,
    /// Its unit.
    pub unit: &'static str,
    /// Present value.
    pub value: f64,
    /// Least value of a slider.
    pub min: f64,
    /// Largest value of a slider.
    pub max: f64,
    /// Step of a slider.
    pub step: f64,
}

/// A rigid body.
#[derive(Clone, Debug, Serialize)]
pub struct Body {
    /// Name of the link, or of the wheel.
    pub name: String,
    /// What it looks like.
    pub shapes: Vec<Shape>,
}

/// A shape of a body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Shape {
    /// Its form.
    #[serde(flatten)]
    pub form: Form,
    /// body_from_shape.
    pub position_m: [f64; 3],
    /// body_from_shape.
    pub orientation_wxyz: [f64; 4],
    /// What it stands for.
    pub role: Role,
}

/// Form of a shape.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "shape", rename_all = "snake_case")]
pub enum Form {
    /// A box.
    Box {
        /// Sides along x, y and z, m.
        size_m: [f64; 3],
    },
    /// A cylinder along y.
    Cylinder {
        /// Radius, m.
        radius_m: f64,
        /// Length, m.
        length_m: f64,
    },
    /// A ball.
    Sphere {
        /// Radius, m.
        radius_m: f64,
    },
    /// All points within a radius of a segment along z.
    Capsule {
        /// Radius, m.
        radius_m: f64,
        /// Length of the segment, m.
        length_m: f64,
    },
}

/// What a shape stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// A part of a link.
    Part,
    /// Room that others keep clear of.
    Clearance,
    /// A wheel.
    Wheel,
    /// A foot.
    Foot,
    /// The blade of a skate.
    Blade,
}

/// A joint with its limits.
#[derive(Clone, Debug, Serialize)]
pub struct Joint {
    /// Its name.
    pub name: String,
    /// Index of the link that it moves among the bodies.
    pub body: usize,
    /// Smallest angle, rad.
    pub position_min_rad: f64,
    /// Largest angle, rad.
    pub position_max_rad: f64,
    /// Largest speed, rad/s.
    pub speed_max_rad_s: f64,
    /// Largest torque, N·m.
    pub torque_max_nm: f64,
}

/// A foot, wheel or blade.
#[derive(Clone, Debug, Serialize)]
pub struct EndEffector {
    /// Its name.
    pub name: String,
    /// Kind of contact, as robot files spell it.
    pub contact: &'static str,
    /// Radius of foot, wheel or curvature, m.
    pub radius_m: f64,
    /// Index of its link among the bodies.
    pub body: usize,
    /// Index of its wheel among the bodies, if it turns.
    pub wheel_body: Option<usize>,
    /// Whether a motor drives it.
    pub driven: bool,
    /// Friction coefficient against the ground.
    pub friction_coefficient: f64,
    /// Largest speed of its motor, rad/s.
    pub motor_speed_max_rad_s: Option<f64>,
    /// Largest torque of its motor, N·m.
    pub motor_torque_max_nm: Option<f64>,
}

/// A motion to be edited.
#[derive(Clone, Debug, Serialize)]
pub struct MotionView {
    /// Its name.
    pub name: String,
    /// Its ends: `periodic` or `at_rest`.
    pub ends: String,
    /// Duration, s.
    pub duration_s: f64,
    /// Count of samples.
    pub samples: usize,
    /// Height of swings, m.
    pub swing_height_m: f64,
    /// Whether an end effector is on the ground, `[end effector][sample]`.
    pub stance: Vec<Vec<bool>>,
    /// Displacement and turn.
    pub goal: Goal,
    /// Targets, in the order of the file.
    pub targets: Vec<Target>,
    /// Height limits, in the order of the file.
    pub heights: Vec<Height>,
    /// Named gaits that fit the robot.
    pub gaits: Vec<&'static str>,
    /// Why the motion does not hold without feedback, as its file says.
    pub needs_feedback: Option<String>,
}

/// Displacement and turn over a motion; what is not given is free.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Goal {
    /// Forward, m.
    pub forward_m: Option<f64>,
    /// To the left, m.
    pub left_m: Option<f64>,
    /// Turn to the left, rad.
    pub turn_rad: Option<f64>,
}

/// A target, as motion files have it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Target {
    /// `com`, `body` or an end effector.
    pub of: String,
    /// Time, s.
    pub at_s: f64,
    /// Position forward of the start, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forward_m: Option<f64>,
    /// Position to its left, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_m: Option<f64>,
    /// Height above the ground, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up_m: Option<f64>,
    /// Speed forward, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_forward_m_s: Option<f64>,
    /// Speed to the left, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_left_m_s: Option<f64>,
    /// Speed upward, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_up_m_s: Option<f64>,
    /// Heading relative to the start, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heading_rad: Option<f64>,
}

/// A height limit, as motion files have it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Height {
    /// `com` or `body`.
    pub of: String,
    /// Start of its span, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from_s: Option<f64>,
    /// End of its span, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
    /// Lowest height, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub above_m: Option<f64>,
    /// Greatest height, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub below_m: Option<f64>,
}

/// Outcome of a solve.
#[derive(Clone, Debug, Serialize)]
pub struct Solve {
    /// Status, as plans spell it.
    pub status: Status,
    /// The same in a sentence or two.
    pub words: String,
    /// Iterations.
    pub iterations: usize,
    /// Energy.
    pub energy: f64,
    /// Worst constraint residual as a fraction of its tolerance.
    pub worst_level: f64,
    /// The worst constraint.
    pub worst_constraint: &'static str,
    /// Constraints that contradict each other.
    pub culprits: Vec<Culprit>,
}

/// A constraint that takes part in a contradiction.
#[derive(Clone, Debug, Serialize)]
pub struct Culprit {
    /// Its name.
    pub constraint: &'static str,
    /// Name, subject, time and amount, in words.
    pub what: String,
    /// When it pulls first, s.
    pub from_s: f64,
    /// When it pulls last, s.
    pub to_s: f64,
    /// End effector that it is about.
    pub end_effector: Option<usize>,
    /// Joint that it is about.
    pub joint: Option<usize>,
    /// What to change.
    pub advice: String,
    /// A change after which there is a plan.
    pub fix: Option<Fix>,
}

/// A change that helps.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fix {
    /// In words.
    pub label: String,
    /// Path of the document.
    pub path: String,
    /// The change.
    pub edit: Edit,
}

/// What the bytes of `plan` are: `count` rows of `width` numbers, float32, little-endian. Row i is at i / `rate_hz`; the last
/// is at or before `duration_s`, of periodic motions before it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FramesHeader {
    /// Rows.
    pub count: usize,
    /// Rows per second, Hz.
    pub rate_hz: f64,
    /// Duration of the motion, s.
    pub duration_s: f64,
    /// By how much a periodic motion moves on.
    pub period: Option<Period>,
    /// Numbers in a row.
    pub width: usize,
    /// Where in a row they are.
    pub columns: Columns,
}

/// Displacement of a period: turn, then move.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Period {
    /// Offset in x and y, m.
    pub offset_m: [f64; 2],
    /// Turn, rad.
    pub yaw_rad: f64,
}

/// First column of each group.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Columns {
    /// 7 for each body: position, m, and orientation `qw qx qy qz`, world_from_body.
    pub bodies: usize,
    /// Centre of mass, m.
    pub com: usize,
    /// 7 for each end effector: contact 0 or 1, contact point, m, ground force, N.
    pub end_effectors: usize,
    /// 3 for each joint: angle, rad, speed, rad/s, torque, N·m.
    pub joints: usize,
    /// 2 for each driven wheel in order: motor speed, rad/s, motor torque, N·m.
    pub wheels: usize,
}
