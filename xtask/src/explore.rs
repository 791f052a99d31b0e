//! A large sweep over designs, split in every way, and a fault campaign: `tests/sweeps/split.sh`.

use crate::{debian, python, shell, workspace};

const KUBERNETES_VALIDATE: &str = "kubernetes-validate==1.37.0";

/// Explores the sweep whole, interrupted, by GNU parallel and by a Slurm of two nodes on the loopback interface, and holds the
/// Job of Kubernetes against its schema.
///
/// # Errors
/// Tables that differ, or the command that installs what is missing.
pub fn check() -> Result<(), String> {
    debian::need(&["parallel", "slurm-wlm", "munge"]).map_err(|install| {
        format!("the check needs GNU parallel and Slurm. On Debian:\n\n    {install}")
    })?;
    let name = "kubernetes-validate";
    let path = python::path(name, KUBERNETES_VALIDATE, "kubernetes_validate, yaml")?;
    let bench = workspace::optimised_program("apps/bench", "rollwalk-bench")?;
    let out = shell::target_folder().join("sweeps");
    let mut split = shell::command("tests/sweeps/split.sh", &[&bench.path]);
    shell::run(split.arg("tests/sweeps/sweep.toml").arg(out).env("PYTHONPATH", path))
}
