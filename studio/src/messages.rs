//! Messages between page and engine: JSON, tagged by `kind`. Frames: world, z up; units m, rad, N, N·m, s.
//!
//! Every request has a number, `seq`, which its answers repeat: any count of `progress`, then one `done`, `faults` or `error`.

mod edit;
mod library;
mod motion;
mod plan;
pub mod robot;
mod scene;
mod slopes;

pub use edit::Edit;
pub use library::{Compared, Edge, Graph, GraphMotion, GraphOther, GraphTransition, Node};
pub use motion::{Goal, Height, MotionView, Target};
pub use plan::{Columns, Culprit, Fix, FramesHeader, Period, Solve};
pub use scene::{Body, EndEffector, Form, Joint, Parameter, Role, Scene, Shape};
pub use slopes::{Slope, SlopesOf};

use robot::RobotView;
use rollwalk_planner::Progress;
use rollwalk_planner::report::Report;
use serde::{Deserialize, Serialize};

#[derive(Clone, Debug, Deserialize)]
pub struct Request {
    /// Number of the request.
    pub seq: u64,
    #[serde(flatten)]
    pub wanted: Wanted,
}

/// Request of a page.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Wanted {
    /// Names and titles of the shipped files.
    Examples,
    /// Text of one of them.
    Example {
        /// Path, as in [`Listed::path`].
        path: String,
    },
    /// Makes documents of a URDF.
    Import {
        /// The URDF (XML, xacro expanded).
        urdf: File,
        /// The side file with what a URDF lacks; without, the one that the import proposes.
        side: Option<File>,
    },
    /// Makes a first motion for a robot.
    Begin {
        files: Vec<File>,
        /// Path of the robot file among them.
        robot: String,
    },
    /// Reads and validates documents.
    Open {
        files: Vec<File>,
        /// Path of the motion file among them.
        motion: String,
    },
    /// Changes one thing in the text of a document.
    Amend {
        files: Vec<File>,
        /// Path of the motion file among them.
        motion: String,
        /// Path of the document to change.
        path: String,
        edit: Edit,
    },
    /// Plans the motion of documents.
    Plan {
        files: Vec<File>,
        /// Path of the motion file among them.
        motion: String,
        /// Start of the solve.
        from: From,
        /// Most iterations of a step while something is dragged; without, the plan is made in full.
        iterations: Option<usize>,
        /// Rate of the frames, Hz.
        frames_hz: f64,
    },
    /// Reports on the shown plan.
    Report,
    /// The shown plan as a file.
    PlanJson,
    /// The shown plan as a table.
    Export {
        what: TableForm,
        /// Rows per second, Hz.
        rate_hz: f64,
    },
    /// The robot as it moves, with forces and footfalls: a picture that any browser plays.
    Animation,
    /// The last good plan with its multipliers, as bytes.
    Solution,
    /// Goes on from the bytes of `solution`, which come with the request.
    Resume,
    /// Computes slopes of a good plan's quantities with respect to the robot's parameters. The request carries the bytes of
    /// `solution`.
    Slopes {
        files: Vec<File>,
        /// Path of the motion file among them.
        motion: String,
    },
    /// The motions and transitions that a library file names.
    Graph {
        files: Vec<File>,
        /// Path of the library file among them.
        library: String,
    },
    /// A first library file of the motions of a project.
    NewLibrary {
        files: Vec<File>,
        /// Path of the motion file among them whose robot it is for.
        motion: String,
    },
    /// Builds a motion library.
    Library {
        files: Vec<File>,
        /// Path of the library file among them.
        library: String,
    },
    /// Compares the shown plan with its motion in a library, whose bytes come with the request.
    Compare {
        files: Vec<File>,
        /// Path of the motion file among them.
        motion: String,
        /// Path of the library file among them.
        library: String,
    },
    /// Talks to a robot; the answer's bytes are to be sent to it.
    Robot {
        /// Time by the page's clock, µs.
        now_us: u64,
        /// Request to the robot.
        #[serde(flatten)]
        wanted: robot::Wanted,
    },
}

/// Form of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TableForm {
    Csv,
    Json,
}

/// Start of a solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum From {
    /// Starts that the planner builds itself.
    Scratch,
    /// Starts that the planner builds itself; if none leads to a plan, the last good plan.
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

/// An answer with the number of its request.
#[derive(Clone, Debug, Serialize)]
pub struct Told<'a> {
    /// Number of the request.
    pub seq: u64,
    pub binary: bool,
    #[serde(flatten)]
    pub answer: &'a Answer,
}

#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Answer {
    /// An iteration of a solve.
    Progress {
        /// Number of the iteration, from 1.
        iteration: usize,
        /// Worst constraint residual as a fraction of its tolerance.
        worst_level: f64,
        worst_constraint: &'static str,
        /// Subject of the plan.
        what: String,
        /// Outcome of the first start, once that has found the request infeasible.
        #[serde(skip_serializing_if = "Option::is_none")]
        refused: Option<Box<Solve>>,
    },
    Done(Box<Done>),
    /// The documents have faults; nothing else happened.
    Faults {
        /// The faults, in the order of the documents' texts.
        faults: Vec<Fault>,
    },
    /// The request cannot be served.
    Error {
        message: String,
        /// Advice on what is valid.
        help: String,
    },
}

/// The result of a request.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Done {
    /// Result of `examples`.
    Examples { examples: Vec<Listed> },
    /// Result of `example`, `plan_json`, `export` and `animation`.
    Text { text: String },
    /// Result of `import`.
    Imported {
        /// A first motion, the robot file and the side file.
        files: Vec<File>,
        /// Path of the motion file among them.
        motion: String,
        /// Assumptions and changes, each with its place in the URDF.
        warnings: Vec<String>,
    },
    /// Result of `begin`.
    Begun {
        /// The motion file.
        file: File,
    },
    /// Result of `open`.
    Opened(Box<Opened>),
    /// Result of `amend`.
    Amended {
        /// The text after the edit.
        text: String,
        /// Faults that the documents have with it.
        faults: Vec<Fault>,
    },
    /// Result of `robot`; the bytes of the answer are to be sent.
    Robot {
        /// State for the page; none after the end of the connection.
        view: Option<Box<RobotView>>,
    },
    /// Result of `plan`; the bytes of the answer are the frames.
    Planned {
        #[serde(flatten)]
        opened: Box<Opened>,
        /// Outcome of the solve.
        solve: Solve,
        /// Layout of the frames.
        frames: FramesHeader,
        /// True if all constraints hold, at the samples and between them as the motion is played.
        converged: bool,
        /// True if later plans start from this plan.
        good: bool,
    },
    /// Result of `report`.
    Reported {
        /// Report in words.
        words: String,
        /// True if the plan may be played.
        consistent: bool,
        /// The report, as `rollwalk report --json` has it.
        #[serde(flatten)]
        report: Report,
    },
    /// Result of `slopes`.
    Slopes {
        /// Quantities of design files that the motion has.
        quantities: Vec<SlopesOf>,
    },
    /// Result of `graph`.
    Graph(Graph),
    /// Result of `new_library`: the library file, and a standing motion if there was none.
    NewLibrary {
        /// Documents to be added.
        files: Vec<File>,
    },
    /// Result of `library`; the bytes of the answer are the library, unless a plan does not hold.
    Library {
        /// Motions, in the order of the file.
        nodes: Vec<Node>,
        /// Transitions that were planned.
        edges: Vec<Edge>,
        /// Index of the motion that is SAFE.
        safe: usize,
        /// Identity of the library, as robots name the one that they have; none without a library.
        identity: Option<String>,
        /// Plans that do not hold, because of which there is no library.
        failures: Vec<String>,
    },
    /// Result of `compare`.
    Compared(Compared),
    /// Result of `solution` and `resume`.
    Kept {},
}

impl Answer {
    /// Progress of the solve of `what`.
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
pub struct Listed {
    /// Path in the checkout.
    pub path: &'static str,
    pub of: Of,
    pub name: String,
    /// Title from the first lines of the file.
    pub title: String,
    /// Path of the robot file that it names.
    pub robot: Option<String>,
}

/// Subject of a shipped file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Of {
    Robot,
    Motion,
    Library,
    /// Variable parameters of a robot.
    Design,
}

/// A fault of a document.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Fault {
    pub path: String,
    pub message: String,
    /// Short note at the text.
    pub label: String,
    /// Advice on what is valid.
    pub help: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// Start and end of the text, in bytes of UTF-8.
    pub span: [usize; 2],
}

/// Documents that were read.
#[derive(Clone, Debug, Serialize)]
pub struct Opened {
    pub scene: Scene,
    pub motion: MotionView,
    /// Paths of the documents that were read, as they were found: motion, robot.
    pub read: [String; 2],
}
