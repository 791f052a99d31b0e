//! File that stores the saved gains of a simulated controller between runs, beside the file of its library.

use miette::miette;
use rollwalk_firmware::store::ParameterSet;
use rollwalk_planner::json::Format;
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_sim_host::store::KeepParameters;
use rollwalk_terminal::files::{self, Output};
use rollwalk_terminal::kind::Kind;
use rollwalk_terminal::output;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

const FORMAT: &str = "rollwalk-gains";
const VERSION: u32 = 1;

/// Format of the file.
const JSON: Format = Format {
    name: FORMAT,
    version: VERSION,
    what: "list of gains",
    make_again: "remove the file, and save the gains again with `rollwalk gains save`",
    help: "docs/parameters.md describes the file",
};

/// Content of the file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Saved {
    format: String,
    version: u32,
    /// Hash of the robot's configuration.
    config_hash: u32,
    /// Fraction of the library's torques that is fed forward.
    feed_forward: f32,
    channels: Vec<Channel>,
}

/// Values of a channel.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Channel {
    kp_nm_rad: f32,
    kd_nm_s_rad: f32,
    torque_limit_nm: f32,
}

/// Saved gains of a simulated controller.
pub struct Gains {
    output: Output,
    path: PathBuf,
    /// Set of an earlier run.
    pub saved: Option<ParameterSet>,
}

impl Gains {
    /// Reads the gains beside a library file, `pup.gains.json` for `pup.rwl`, and checks that the file can be written.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or written, or has another format.
    pub fn beside(library: &Path) -> miette::Result<Self> {
        let path = library.with_extension("gains.json");
        // This order guarantees that a file that was read is not used for another output.
        let output = Output::of_source(&path)?;
        let saved = path.exists().then(|| read(&path)).transpose()?;
        Ok(Self { output, path, saved })
    }

    /// Function that writes each set that a host saves. A failure is printed, and the host's request is refused.
    pub fn keeper(self) -> KeepParameters {
        Box::new(move |set| match self.output.write(text(set).as_bytes()) {
            Ok(()) => {
                output::print_line(format_args!(
                    "{} now contains the saved gains",
                    self.path.display()
                ));
                true
            }
            Err(error) => {
                output::print_report(&error);
                false
            }
        })
    }
}

/// Function that refuses to save gains, for a controller without a file.
pub fn no_file() -> KeepParameters {
    Box::new(|_| {
        output::print_line(
            "a host cannot save gains: start rollwalk-sim with --library LIB.rwl, which stores gains in a file beside LIB.rwl",
        );
        false
    })
}

fn read(path: &Path) -> miette::Result<ParameterSet> {
    let text = files::read_text(path, Kind::Gains)?;
    let saved: Saved = JSON.read(&path.display().to_string(), &text)?;
    let count = saved.channels.len();
    if count > MAX_CHANNELS {
        return Err(miette!(
            "{}: channels has {count} entries, but controllers have at most {MAX_CHANNELS}",
            path.display()
        ));
    }
    let values = |of: &Channel| [of.kp_nm_rad, of.kd_nm_s_rad, of.torque_limit_nm];
    Ok(ParameterSet {
        config_hash: saved.config_hash,
        values: saved.channels.iter().map(values).collect(),
        feed_forward: saved.feed_forward,
    })
}

fn text(set: &ParameterSet) -> String {
    let channel = |&[kp_nm_rad, kd_nm_s_rad, torque_limit_nm]: &[f32; 3]| Channel {
        kp_nm_rad,
        kd_nm_s_rad,
        torque_limit_nm,
    };
    let saved = Saved {
        format: FORMAT.to_owned(),
        version: VERSION,
        config_hash: set.config_hash,
        feed_forward: set.feed_forward,
        channels: set.values.iter().map(channel).collect(),
    };
    // Only maps with non-string keys cannot become JSON, and a set has no map.
    serde_json::to_string_pretty(&saved).unwrap_or_default() + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn set() -> ParameterSet {
        let values = [[80.0, 0.1, 3.3], [0.0, 0.25, 1e-3]].into_iter().collect();
        ParameterSet { config_hash: 0xFFFF_FFFE, values, feed_forward: 0.1 }
    }

    #[test]
    fn a_set_is_the_same_after_a_restart() {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("pup.rwl");
        let gains = Gains::beside(&library).unwrap();
        assert_eq!(gains.saved, None);
        let mut keep = gains.keeper();
        assert!(keep(&set()));
        assert_eq!(Gains::beside(&library).unwrap().saved, Some(set()));
        fs::remove_dir_all(folder.path()).unwrap();
        assert!(!keep(&set()), "the host receives a refusal");
    }

    #[test]
    fn the_text_of_the_file_is_that_of_its_format() {
        let expected = r#"{
  "format": "rollwalk-gains",
  "version": 1,
  "config_hash": 4294967294,
  "feed_forward": 0.1,
  "channels": [
    {
      "kp_nm_rad": 80.0,
      "kd_nm_s_rad": 0.1,
      "torque_limit_nm": 3.3
    },
    {
      "kp_nm_rad": 0.0,
      "kd_nm_s_rad": 0.25,
      "torque_limit_nm": 0.001
    }
  ]
}
"#;
        assert_eq!(text(&set()), expected);
    }

    #[test]
    fn a_file_that_does_not_fit_is_refused_with_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let many = vec![[0.0; 3]; MAX_CHANNELS];
        let full = ParameterSet { values: many.into_iter().collect(), ..set() };
        let one_more = text(&full).replace(
            "\"channels\": [",
            "\"channels\": [\n    {\"kp_nm_rad\": 1, \
            \"kd_nm_s_rad\": 1, \"torque_limit_nm\": 1},",
        );
        for (number, (content, words)) in [
            ("", "the file is empty"),
            (&text(&set()).replace("\"version\": 1", "\"version\": 2"), "version"),
            (&text(&set()).replace("rollwalk-gains", "rollwalk-plan"), "format"),
            (&one_more, "channels has 65 entries"),
        ]
        .into_iter()
        .enumerate()
        {
            let library = folder.path().join(format!("pup_{number}.rwl"));
            let path = library.with_extension("gains.json");
            fs::write(&path, content).unwrap();
            let error = Gains::beside(&library).err().unwrap().to_string();
            assert!(error.contains(words) && error.contains(".gains.json"), "{error}");
        }
    }
}
