//! Commands that consist of steps: `cargo xtask test` ([`mod@test`]) and `cargo xtask nightly` ([`nightly`]).
//!
//! [`Run`] prints the seconds of each step, and a table at the end. A step that keeps only one core busy can run in a separate
//! process, in parallel with the steps that follow it.

pub mod nightly;
mod record;
mod run;
pub mod test;

use crate::changes;
use crate::extent::Extent;
use clap::ValueEnum;
use record::Record;
pub use run::Run;
use std::time::Instant;

/// Step of a command; `--only` selects it by its name.
pub trait Step: ValueEnum + 'static {
    /// Subcommand of `cargo xtask` with the given steps.
    const COMMAND: &'static str;
    /// Name of the step for `--only`.
    fn name(&self) -> String {
        self.to_possible_value().expect("no step is hidden").get_name().to_owned()
    }

    /// Short description.
    fn title(&self) -> &'static str;

    /// Step that must succeed before this one; `None` if there is none.
    fn needs(&self) -> Option<Self> {
        None
    }

    /// Folders and files that the step checks ([`changes::concern`]); empty if the step has no brief form.
    fn checks(&self) -> &'static [&'static str] {
        &[]
    }

    /// Description of the checks that the brief form leaves to `cargo xtask nightly`.
    fn left_out(&self) -> &'static str {
        ""
    }

    /// True if a step that has passed at a commit is not repeated at it, because the command takes hours.
    const IS_RESUMED: bool = false;

    /// Runs the step.
    ///
    /// # Errors
    /// Returns the first failure, with the remedy if it is known.
    fn check(&self, extent: Extent) -> Result<(), String>;

    /// True if the step runs in parallel with the steps that follow it.
    fn is_beside(&self) -> bool {
        false
    }

    /// True if no other step may run at the same time, because the step has real-time deadlines.
    fn is_alone(&self) -> bool {
        false
    }
}

/// Runs all steps of a command, or `only` one. A step with a brief form runs in it if `brief` is true, or if all steps run and no
/// file that it checks has changed. If a step fails, the steps that need it are skipped; all others run. A command of hours
/// ([`Step::IS_RESUMED`]) continues with the steps that have not passed at this commit.
///
/// # Errors
/// Returns the failed steps, with the commands that run them alone.
pub fn run<S: Step>(only: Option<S>, brief: bool) -> Result<(), String> {
    let alone = only.is_some();
    // Without git, everything is checked.
    let changed = changes::files(None).ok();
    let extent = |step: &S| {
        let is_same = changed.as_ref().is_some_and(|files| !changes::concern(files, step.checks()));
        let has_brief = !step.checks().is_empty();
        if has_brief && (brief || !alone && is_same) { Extent::Brief } else { Extent::Short }
    };
    let steps = only.map_or_else(|| S::value_variants().to_vec(), |step| vec![step]);
    let record = S::IS_RESUMED.then(|| Record::open(S::COMMAND));
    let passed_before = |name: &str| record.as_ref().filter(|_| !alone)?.passed(name);
    let mut run = Run::new(S::COMMAND, steps.len());
    for step in &steps {
        let name = step.name();
        let extent = extent(step);
        if extent == Extent::Brief && !alone {
            run.leave(&name, step.left_out());
        }
        run.collect();
        if step.is_alone() {
            run.join();
        }
        let needed = step.needs().map(|needed| needed.name());
        if let Some(needed) = needed.filter(|needed| run.has_failed(needed)) {
            run.skip(&name, step.title(), &needed);
        } else if let Some(seconds) = passed_before(&name) {
            run.keep(&name, step.title(), seconds);
        } else if step.is_beside() && !alone {
            run.beside(&name, step.title(), extent == Extent::Brief);
        } else {
            run.step(&name, step.title(), || {
                let start = Instant::now();
                step.check(extent)?;
                if let Some(record) = &record {
                    record.add(&name, start.elapsed().as_secs_f64());
                }
                Ok(())
            });
        }
    }
    run.finish()
}
