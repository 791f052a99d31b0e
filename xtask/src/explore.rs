//! Test of a large sweep over designs, split in all supported ways, and of a fault campaign: `tests/sweeps/split.sh`.

use crate::{debian, python, shell, workspace};

const KUBERNETES_VALIDATE: &str = "kubernetes-validate==1.37.0";

/// Runs the sweep at once, interrupted, by GNU parallel, and by Slurm with two nodes on the loopback interface. Validates the
/// Kubernetes Job against its schema.
///
/// # Errors
/// Returns an error if the tables differ. If a program is missing, the error contains the command that installs it.
pub fn check() -> Result<(), String> {
    debian::need(&["parallel", "slurm-wlm", "munge"]).map_err(|install| {
        format!("the check requires GNU parallel and Slurm. On Debian:\n\n    {install}")
    })?;
    let name = "kubernetes-validate";
    let path = python::path(name, KUBERNETES_VALIDATE, "kubernetes_validate, yaml")?;
    let bench = workspace::optimised_program("apps/bench", "rollwalk-bench")?;
    let out = shell::target_folder().join("sweeps");
    let mut split = shell::command("tests/sweeps/split.sh", &[&bench.path]);
    shell::run(split.arg("tests/sweeps/sweep.toml").arg(out).env("PYTHONPATH", path))
}
