//! `rollwalk` for Python: robots, motions, plans, libraries, designs and simulations as objects, values as NumPy arrays.
//!
//! This is a front end like the command line, on the same crates and without logic of its own. The package
//! `apps/python/python/rollwalk` re-exports these classes and functions, and defines the exceptions and the type stubs.
//! `docs/python.md` is the tutorial.
//!
//! | module | content |
//! |---|---|
//! | `arrays` | rows of values as NumPy arrays |
//! | `batch` | many motions planned at once |
//! | `design` | designs, and derivatives of their plans |
//! | `documents` | files, and the files that they name |
//! | `error` | exceptions, with the messages of the command line |
//! | `library` | motion libraries |
//! | `motion` | motion goals |
//! | `robot` | robots, with forward kinematics |
//! | `plan` | planning of motions, and plans |
//! | `report` | residuals of plans |
//! | `samples` | plans sampled at any rate |
//! | `simulate` | plans on the simulated ground |
//! | `watch` | long operations: progress, Ctrl-C, other threads |

mod arrays;
mod batch;
mod design;
mod documents;
mod error;
mod library;
mod motion;
mod plan;
mod report;
mod robot;
mod samples;
mod simulate;
mod watch;

/// Motions of robots with legs and wheels: the compiled part of the package `rollwalk`.
#[pyo3::pymodule]
mod _rollwalk {
    #[pymodule_export]
    use crate::batch::{BatchProgress, plan_many};
    #[pymodule_export]
    use crate::design::{Design, Gradients, Parameter};
    #[pymodule_export]
    use crate::documents::write_shipped;
    #[pymodule_export]
    use crate::library::build_library;
    #[pymodule_export]
    use crate::motion::Motion;
    #[pymodule_export]
    use crate::plan::{Culprit, Diagnosis, Plan, Progress, plan};
    #[pymodule_export]
    use crate::report::{Report, Residual};
    #[pymodule_export]
    use crate::robot::Robot;
    #[pymodule_export]
    use crate::samples::Samples;
    #[pymodule_export]
    use crate::simulate::{Simulation, simulate};
}
