//! What page and engine say to each other: JSON, tagged by `kind`. Frames: world, z up; units m, rad, N, N·m, s.
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
    /// How the robot's parameters change what a good plan is judged by; the plan is the bytes of `solution`, which come with the request.
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
        /// What is wanted of it.
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

/// Where a solve starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum From {
    /// From the starts that the planner knows.
    Scratch,
    /// The starts that the planner knows; where none leads to a plan, the last good one.
    Good,
    /// From the plan file whose bytes come with the request.
    Plan,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct File {
    /// Its path, with `/` between folders.
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
        /// Its number, from 1.
        iteration: usize,
        /// Worst constraint residual as a fraction of its tolerance.
        worst_level: f64,
        worst_constraint: &'static str,
        /// What is being planned.
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
        /// What would be right.
        help: String,
    },
}

/// The result of a request.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Done {
    /// Of `examples`.
    Examples { examples: Vec<Listed> },
    /// Of `example`, `plan_json`, `export` and `animation`.
    Text { text: String },
    /// Of `import`.
    Imported {
        /// A first motion, the robot file and the side file.
        files: Vec<File>,
        /// Path of the motion file among them.
        motion: String,
        /// What was assumed or changed, each with its place in the URDF.
        warnings: Vec<String>,
    },
    /// Of `begin`.
    Begun {
        /// The motion file.
        file: File,
    },
    /// Of `open`.
    Opened(Box<Opened>),
    /// Of `amend`.
    Amended {
        /// The text after the edit.
        text: String,
        /// Faults that the documents have with it.
        faults: Vec<Fault>,
    },
    /// Of `robot`; its bytes are to be sent.
    Robot {
        /// What the page shows; none after the end of the connection.
        view: Option<Box<RobotView>>,
    },
    /// Of `plan`; its bytes are the frames.
    Planned {
        #[serde(flatten)]
        opened: Box<Opened>,
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
        consistent: bool,
        /// The report, as `rollwalk report --json` has it.
        #[serde(flatten)]
        report: Report,
    },
    /// Of `slopes`.
    Slopes {
        /// What plans are judged by, as far as the motion has it.
        quantities: Vec<SlopesOf>,
    },
    /// Of `graph`.
    Graph(Graph),
    /// Of `new_library`: the library file, and a motion that stands if there was none.
    NewLibrary {
        /// Documents to be added.
        files: Vec<File>,
    },
    /// Of `library`; its bytes are the library, unless a plan does not hold.
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
    /// Of `compare`.
    Compared(Compared),
    /// Of `solution` and `resume`.
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
    /// Its path in the checkout.
    pub path: &'static str,
    pub of: Of,
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
    Robot,
    Motion,
    Library,
    /// What may change about a robot.
    Design,
}

/// A fault of a document.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Fault {
    pub path: String,
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
    pub scene: Scene,
    pub motion: MotionView,
    /// Paths of the documents that were read, as they were found: motion, robot.
    pub read: [String; 2],
}
