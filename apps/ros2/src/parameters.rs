//! Parameters of the node, set at the start by `-p NAME:=VALUE` after `--ros-args`.

use miette::miette;
use std::ops::RangeInclusive;

/// Range of the velocity timeout, s. A timeout below a publisher's jitter would halt the robot between two commands.
const TIMEOUT_S: RangeInclusive<f64> = 0.1..=10.0;

/// Parameters with the names and meanings of ros2_control's `diff_drive_controller`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// `use_stamped_vel`: true if velocities are TwistStamped, false if they are Twist.
    pub use_stamped_vel: bool,
    /// `cmd_vel_timeout`: time after which a velocity expires, s.
    pub cmd_vel_timeout_s: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self { use_stamped_vel: false, cmd_vel_timeout_s: 0.5 }
    }
}

impl Parameters {
    /// Sets a parameter from the text `NAME:=VALUE`.
    ///
    /// # Errors
    /// Returns an error if the parameter does not exist, or if the value is invalid.
    pub fn set(&mut self, text: &str) -> miette::Result<()> {
        let (name, value) = text
            .split_once(":=")
            .ok_or_else(|| miette!("`-p {text}`: give a parameter as NAME:=VALUE"))?;
        match name {
            "use_stamped_vel" => {
                self.use_stamped_vel = match value {
                    "true" | "True" => true,
                    "false" | "False" => false,
                    _ => return Err(miette!("{name} is `{value}`; expected true or false")),
                }
            }
            "cmd_vel_timeout" => {
                let seconds = value.parse().ok().filter(|seconds| TIMEOUT_S.contains(seconds));
                self.cmd_vel_timeout_s = seconds.ok_or_else(|| {
                    let (least, most) = (TIMEOUT_S.start(), TIMEOUT_S.end());
                    miette!("{name} is `{value}`; expected a time from {least} to {most} s")
                })?;
            }
            _ => {
                return Err(miette!(
                    help = "give `use_stamped_vel` or `cmd_vel_timeout`",
                    "the node has no parameter `{name}`"
                ));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_have_the_values_that_are_set_last() {
        let mut parameters = Parameters::default();
        assert_eq!(parameters, Parameters { use_stamped_vel: false, cmd_vel_timeout_s: 0.5 });
        for text in ["use_stamped_vel:=false", "use_stamped_vel:=true", "cmd_vel_timeout:=1"] {
            parameters.set(text).unwrap();
        }
        assert_eq!(parameters, Parameters { use_stamped_vel: true, cmd_vel_timeout_s: 1.0 });
    }

    #[test]
    fn what_cannot_be_set_is_refused_by_name_and_value() {
        for (text, words) in [
            ("rate:=3", "no parameter `rate`"),
            ("use_stamped_vel", "`-p use_stamped_vel`: give a parameter as NAME:=VALUE"),
            ("use_stamped_vel:=1", "use_stamped_vel is `1`; expected true or false"),
            ("cmd_vel_timeout:=0", "cmd_vel_timeout is `0`; expected a time from 0.1 to 10 s"),
            ("cmd_vel_timeout:=NaN", "cmd_vel_timeout is `NaN`"),
            ("cmd_vel_timeout:=soon", "cmd_vel_timeout is `soon`"),
        ] {
            let error = Parameters::default().set(text).unwrap_err().to_string();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
