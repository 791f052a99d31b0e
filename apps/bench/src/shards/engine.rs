//! Engines that run shards of work: GNU parallel, Slurm, Kubernetes.

use indicatif::ProgressBar;
use miette::{IntoDiagnostic, miette};
use rollwalk_terminal::{files, interrupt, output};
use std::io::{self, BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

/// Engine that runs shards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Engine {
    /// GNU parallel, on this machine or the machines in its configuration.
    Parallel,
    /// Array job of Slurm.
    Slurm,
    /// Indexed Job of Kubernetes. Its manifest is written, but not submitted.
    Kubernetes,
}

/// Job for an engine.
pub struct Job<'a> {
    /// Name of the work.
    pub name: &'a str,
    /// Command-line arguments of the work, without the folder and the shard.
    pub words: Vec<String>,
    /// Option for the folder.
    pub option: &'a str,
    /// Folder of journals, which all shards share.
    pub folder: &'a Path,
    /// Number of shards.
    pub shards: usize,
}

/// Interval at which journals are read while an engine works.
const LOOK: Duration = Duration::from_secs(1);

/// Writes the job. Unless `dry` is true or the engine is Kubernetes, submits it and monitors it until it ends. Returns false
/// after an interrupt. A job that ends with a failure is only reported, since its finished results are kept.
///
/// # Errors Returns an error if the job cannot be written, if the engine does not start, or if a journal cannot be read.
pub fn run(
    engine: Engine,
    job: &Job<'_>,
    dry: bool,
    bar: &dyn Fn() -> ProgressBar,
    done: &dyn Fn() -> miette::Result<usize>,
) -> miette::Result<bool> {
    let (name, text) = match engine {
        Engine::Parallel => ("parallel.sh", job.parallel()?),
        Engine::Slurm => ("slurm.sh", job.slurm()?),
        Engine::Kubernetes => ("kubernetes.yaml", job.kubernetes()?),
    };
    let path = job.folder.join(name);
    files::write(&path, text.as_bytes())?;
    let command = match engine {
        Engine::Parallel => vec!["sh".to_owned(), path.display().to_string()],
        Engine::Slurm => {
            vec!["sbatch".into(), "--parsable".into(), "--wait".into(), path.display().to_string()]
        }
        Engine::Kubernetes => {
            vec!["kubectl".into(), "apply".into(), "-f".into(), path.display().to_string()]
        }
    };
    let shown = command.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ");
    if dry || engine == Engine::Kubernetes {
        output::print(&format!("wrote {}; next: {shown}", path.display()))?;
        if engine == Engine::Kubernetes && !dry {
            output::print(
                "afterwards, run the same command without --engine and --shards to write the tables",
            )?;
        }
        return Ok(true);
    }
    let mut started = Command::new(&command[0]);
    let child = started.args(&command[1..]).stdout(Stdio::piped()).spawn();
    let child = child.map_err(|error| {
        miette!(
            help = "install the program, or run each shard yourself with --shard K/N",
            "cannot run {shown}: {error}"
        )
    })?;
    watch(engine, child, &bar(), done)
}

fn watch(
    engine: Engine,
    mut child: Child,
    bar: &ProgressBar,
    done: &dyn Fn() -> miette::Result<usize>,
) -> miette::Result<bool> {
    let mut first = String::new();
    if engine == Engine::Slurm
        && let Some(stdout) = child.stdout.take()
    {
        // The first line is the number of the job. It arrives after the submission.
        BufReader::new(stdout).read_line(&mut first).into_diagnostic()?;
        if !first.is_empty() {
            output::print_line(format_args!("submitted to Slurm as job {}", first.trim()));
        }
    } else if let Some(stdout) = child.stdout.take() {
        thread::spawn(move || {
            BufReader::new(stdout).lines().map_while(Result::ok).for_each(output::print_line)
        });
    }
    loop {
        if let Some(status) = child.try_wait().into_diagnostic()? {
            bar.finish_and_clear();
            if !status.success() && !interrupt::requested() {
                output::print_line(format_args!(
                    "the job ended with {status}; finished results are kept"
                ));
            }
            return Ok(!interrupt::requested());
        }
        if interrupt::requested() {
            bar.finish_and_clear();
            if engine == Engine::Slurm && !first.is_empty() {
                let _ = Command::new("scancel").arg(first.trim()).status();
            }
            let _ = child.kill();
            let _ = child.wait();
            return Ok(false);
        }
        bar.set_position(done()? as u64);
        thread::sleep(LOOK);
    }
}

impl Job<'_> {
    /// Command of a shard, without the selection of the shard.
    fn command(&self) -> miette::Result<String> {
        let absolute = |path: &Path| Ok(std::path::absolute(path)?.to_string_lossy().into_owned());
        let absolute = |path: &Path| absolute(path).map_err(|error: io::Error| miette!("{error}"));
        let program = absolute(&std::env::current_exe().into_diagnostic()?)?;
        let folder = [self.option.to_owned(), absolute(self.folder)?];
        let words = std::iter::once(&program).chain(&self.words).chain(&folder);
        Ok(words.map(|word| quoted(word)).collect::<Vec<_>>().join(" "))
    }

    fn parallel(&self) -> miette::Result<String> {
        let (command, shards) = (self.command()?, self.shards);
        let one = quoted(&format!("{command} --cores 1 --shard {{}}/{shards}"));
        Ok(format!("#!/bin/sh\nexec parallel --will-cite {one} ::: $(seq {shards})\n"))
    }

    fn slurm(&self) -> miette::Result<String> {
        let (command, shards) = (self.command()?, self.shards);
        let log = std::path::absolute(self.folder).into_diagnostic()?.join("slurm-%A-%a.log");
        Ok(format!(
            "#!/bin/sh\n#SBATCH --job-name=rollwalk-{}\n#SBATCH --array=0-{}\n#SBATCH --cpus-per-task=1\n\
             #SBATCH --output={}\nexec {command} --cores 1 --shards {shards}\n",
            self.name,
            shards - 1,
            quoted(&log.to_string_lossy())
        ))
    }

    /// Manifest for Kubernetes. Image and volume depend on the cluster: a comment in the manifest explains what to change.
    fn kubernetes(&self) -> miette::Result<String> {
        let (command, shards, name) = (self.command()?, self.shards, self.name);
        let folder = std::path::absolute(self.folder).into_diagnostic()?;
        let text = |text: &str| serde_json::to_string(text).into_diagnostic();
        let line = text(&format!("exec {command} --cores 1 --shards {shards}"))?;
        let folder = text(&folder.to_string_lossy())?;
        Ok(format!(
            "# The image contains rollwalk, and the files that the command names, at the paths below. All nodes can write to the volume.\n\
             apiVersion: batch/v1\nkind: Job\nmetadata:\n  name: rollwalk-{name}\nspec:\n  completionMode: Indexed\n  \
             completions: {shards}\n  parallelism: {shards}\n  template:\n    spec:\n      restartPolicy: OnFailure\n      \
             containers:\n        - name: shard\n          image: rollwalk:latest\n          command: [\"sh\", \"-c\", {line}]\n          \
             resources:\n            requests:\n              cpu: \"1\"\n          volumeMounts:\n            - name: results\n              \
             mountPath: {folder}\n      volumes:\n        - name: results\n          persistentVolumeClaim:\n            claimName: rollwalk-results\n"
        ))
    }
}

/// Quotes a word for a shell.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_reach_the_shell_as_they_are() {
        assert_eq!(quoted("/a/b-c_1.toml"), "/a/b-c_1.toml");
        assert_eq!(quoted("it's $HOME"), "'it'\\''s $HOME'");
        assert_eq!(quoted(""), "''");
        let job = Job {
            name: "sweep",
            words: ["explore", "/my sweep.toml"].map(str::to_owned).to_vec(),
            option: "-o",
            folder: Path::new("/out"),
            shards: 3,
        };
        let slurm = job.slurm().unwrap();
        assert!(
            slurm.contains("--array=0-2\n") && slurm.contains("my sweep.toml' -o /out"),
            "{slurm}"
        );
        let manifest = job.kubernetes().unwrap();
        assert!(
            manifest.contains("completionMode: Indexed") && manifest.contains("completions: 3")
        );
        assert!(job.parallel().unwrap().contains("--shard {}/3"));
    }
}
