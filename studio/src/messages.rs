//! Messages between page and engine: JSON, tagged by `kind`. Frames are world, z up; units are m, rad, N, N·m, s.
//!
//! Every request has a number, `seq`, which its answers repeat: any number of `progress`, then one `done`, `faults` or `error`.

mod edit;
mod library;
mod motion;
mod plan;
pub mod robot;
mod scene;
mod slopes;

pub use edit::Edit;
pub use library::{ClipComparison, Edge, Graph, GraphMotion, GraphOther, GraphTransition, Node};
pub use motion::{Goal, Height, MotionView, Target};
pub use plan::{Columns, Culprit, Fix, FramesHeader, Period, Solve};
pub use scene::{Body, EndEffector, Form, Joint, Parameter, Role, Scene, Shape};
pub use slopes::{QuantitySlopes, Slope};

use robot::RobotView;
use rollwalk_planner::Progress;
use rollwalk_planner::report::Report;
use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, Deserialize)]
pub struct Request {
    /// Number of the request, repeated in its answers.
    pub seq: u64,
    #[serde(flatten)]
    pub wanted: RequestKind,
}

/// Request of a page.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum RequestKind {
    /// Requests names and titles of the shipped files.
    Examples,
    /// Requests the text of a shipped file.
    Example {
        /// Path, as in [`ShippedFile::path`].
        path: String,
    },
    /// Creates documents from a URDF.
    Import {
        /// URDF (XML, xacro expanded).
        urdf: File,
        /// Side file with data that a URDF lacks; if `None`, the one that the import proposes is used.
        side: Option<File>,
    },
    /// Creates a first motion for a robot.
    Begin {
        files: Vec<File>,
        /// Path of the robot file in `files`.
        robot: String,
    },
    /// Reads and validates documents.
    Open {
        files: Vec<File>,
        /// Path of the motion file in `files`.
        motion: String,
    },
    /// Changes one item in the text of a document.
    Amend {
        files: Vec<File>,
        /// Path of the motion file in `files`.
        motion: String,
        /// Path of the document to change.
        path: String,
        edit: Edit,
    },
    /// Plans the motion of the documents.
    Plan {
        files: Vec<File>,
        /// Path of the motion file in `files`.
        motion: String,
        /// Starting point of the solve.
        from: SolveOrigin,
        /// Maximum number of iterations of a drag step; `None` plans in full.
        iterations: Option<usize>,
        /// Rate of the frames, Hz.
        frames_hz: f64,
    },
    /// Requests a report on the shown plan.
    Report,
    /// Requests the shown plan as a file.
    PlanJson,
    /// Requests the shown plan as a table.
    Export {
        what: TableForm,
        /// Rows per second, Hz.
        rate_hz: f64,
    },
    /// Requests the shown plan as a moving picture with forces and footfalls, which any browser plays.
    Animation,
    /// Requests the most recent good plan with its multipliers, as bytes.
    Solution,
    /// Plans from the solution whose bytes the request contains.
    Resume,
    /// Computes derivatives of the quantities of a good plan with respect to the robot's parameters. The request contains the
    /// bytes of `solution`.
    Slopes {
        files: Vec<File>,
        /// Path of the motion file in `files`.
        motion: String,
    },
    /// Requests the motions and transitions that a library file names.
    Graph {
        files: Vec<File>,
        /// Path of the library file in `files`.
        library: String,
    },
    /// Creates a first library file with the motions of a project.
    NewLibrary {
        files: Vec<File>,
        /// Path in `files` of a motion file of the library's robot.
        motion: String,
    },
    /// Builds a motion library.
    Library {
        files: Vec<File>,
        /// Path of the library file in `files`.
        library: String,
    },
    /// Compares the shown plan with its motion in the library whose bytes are in the request.
    Compare {
        files: Vec<File>,
        /// Path of the motion file in `files`.
        motion: String,
        /// Path of the library file in `files`.
        library: String,
    },
    /// Exchanges data with a robot; the bytes of the answer must be sent to it.
    Robot {
        /// Time of the page's clock, µs.
        now_us: u64,
        /// Request to the robot.
        #[serde(flatten)]
        wanted: robot::RobotRequest,
    },
}

/// Form of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TableForm {
    Csv,
    Json,
}

/// Starting point of a solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SolveOrigin {
    /// Starts that the planner creates itself.
    Scratch,
    /// Starts that the planner creates itself; if none leads to a plan, the most recent good plan.
    Good,
    /// Plan file in the bytes of the request.
    Plan,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct File {
    /// Path, with `/` between folders.
    pub path: String,
    pub text: String,
}

/// Answer with the number of its request.
#[derive(Clone, Debug, Serialize)]
pub struct NumberedAnswer<'a> {
    /// Number of the request.
    pub seq: u64,
    pub binary: bool,
    #[serde(flatten)]
    pub answer: &'a Answer,
}

#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Answer {
    /// Iteration of a solve.
    Progress {
        /// Number of the iteration, from 1.
        iteration: usize,
        /// Worst constraint residual as a fraction of its tolerance.
        worst_level: f64,
        worst_constraint: &'static str,
        /// Name of the motion that is being planned.
        what: String,
        /// Result of the first start, sent once after it has proved infeasible.
        #[serde(skip_serializing_if = "Option::is_none")]
        refused: Option<Box<Solve>>,
    },
    Done(Box<RequestResult>),
    /// Faults of the documents; the request had no other effect.
    Faults {
        /// Faults, in the order of the documents' texts.
        faults: Vec<Fault>,
    },
    /// Request that cannot be served.
    Error {
        message: String,
        /// Advice on valid requests.
        help: String,
    },
}

/// Result of a request.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum RequestResult {
    /// Result of `examples`.
    Examples { examples: Vec<ShippedFile> },
    /// Result of `example`, `plan_json`, `export` and `animation`.
    Text { text: String },
    /// Result of `import`.
    Imported {
        /// First motion, robot file and side file.
        files: Vec<File>,
        /// Path of the motion file in `files`.
        motion: String,
        /// Assumptions and changes of the import, each with its location in the URDF.
        warnings: Vec<String>,
    },
    /// Result of `begin`.
    Begun {
        /// Motion file.
        file: File,
    },
    /// Result of `open`.
    Opened(Box<OpenedDocuments>),
    /// Result of `amend`.
    Amended {
        /// Text after the edit.
        text: String,
        /// Faults of the documents after the edit.
        faults: Vec<Fault>,
    },
    /// Result of `robot`; the bytes of the answer must be sent to the robot.
    Robot {
        /// State for the page; `None` after the end of the connection.
        view: Option<Box<RobotView>>,
    },
    /// Result of `plan`; the bytes of the answer are the frames.
    Planned {
        #[serde(flatten)]
        opened: Box<OpenedDocuments>,
        /// Outcome of the solve.
        solve: Solve,
        /// Layout of the frames.
        frames: FramesHeader,
        /// True if all constraints are met, at the samples and between them as the motion is played.
        converged: bool,
        /// True if later plans can start from this plan.
        good: bool,
    },
    /// Result of `report`.
    Reported {
        /// Report as text.
        words: String,
        /// True if the plan is consistent and may be played.
        consistent: bool,
        /// Report, as in `rollwalk report --json`.
        #[serde(flatten)]
        report: Report,
    },
    /// Result of `slopes`.
    Slopes {
        /// Quantities of design files that are defined for the motion.
        quantities: Vec<QuantitySlopes>,
    },
    /// Result of `graph`.
    Graph(Graph),
    /// Result of `new_library`: the library file, and a standing motion if the project had none.
    NewLibrary {
        /// Documents to add to the project.
        files: Vec<File>,
    },
    /// Result of `library`; the bytes of the answer are the library, or empty if a plan failed its checks.
    Library {
        /// Motions, in the order of the file.
        nodes: Vec<Node>,
        /// Planned transitions.
        edges: Vec<Edge>,
        /// Index of the motion that is SAFE.
        safe: usize,
        /// Identity of the library, as reported by robots that have it; `None` without a library.
        identity: Option<String>,
        /// Plans that failed their checks, so that no library was built.
        failures: Vec<String>,
    },
    /// Result of `compare`.
    Compared(ClipComparison),
    /// Result of `solution` and `resume`.
    Kept {},
}

impl Answer {
    /// Progress of the solve of the motion called `what`.
    pub fn progress(state: &Progress, what: &str) -> Self {
        Self::Progress {
            iteration: state.iteration,
            worst_level: state.worst_level,
            worst_constraint: state.worst_constraint.name(),
            what: what.to_owned(),
            refused: None,
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ShippedFile {
    /// Path of the file in the checkout.
    pub path: &'static str,
    pub of: ShippedKind,
    pub name: String,
    /// Title from the first lines of the file.
    pub title: String,
    /// Path of the robot file that the file names.
    pub robot: Option<String>,
}

/// Kind of a shipped file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ShippedKind {
    Robot,
    Motion,
    Library,
    /// Design: a robot with variable parameters.
    Design,
}

/// Fault of a document.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Fault {
    pub path: String,
    pub message: String,
    /// Short note on the marked text.
    pub label: String,
    /// Advice on valid values.
    pub help: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// Start and end of the marked text, in bytes of UTF-8.
    pub span: [usize; 2],
}

/// Documents that were read.
#[derive(Clone, Debug, Serialize)]
pub struct OpenedDocuments {
    pub scene: Scene,
    pub motion: MotionView,
    /// Paths of the documents that were read: motion, robot.
    pub read: [String; 2],
}
