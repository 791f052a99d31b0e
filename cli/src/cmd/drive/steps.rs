//! Predefined steering: `--steer AT:FORWARD,LEFT,TURN`.

use rollwalk_planner::receding::Steering;
use rollwalk_terminal::inputs::number_within;
use std::fmt;
use std::str::FromStr;

/// Maximum duration of a drive, s: a day.
const LONGEST_S: f64 = 86_400.0;
/// Maximum steering speed, m/s and rad/s; larger values are typing errors.
const FASTEST: f64 = 20.0;

/// Steering step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Start of the step, in seconds after the robot begins to follow the steering.
    pub at_s: f64,
    /// Steering until the next step.
    pub steering: Steering,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Steering { forward_m_s, left_m_s, turn_rad_s } = self.steering;
        write!(f, "{}:{forward_m_s},{left_m_s},{turn_rad_s}", self.at_s)
    }
}

impl FromStr for Step {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form =
            "is not of the form AT:FORWARD,LEFT,TURN, such as 2.5:0.15,0,0.3 (s, m/s, m/s, rad/s)";
        let (at, velocity) = text.split_once(':').ok_or(form)?;
        let at_s =
            number_within(at, 0.0..=LONGEST_S).map_err(|why| format!("time `{at}` {why}"))?;
        let part = |text: &str| {
            number_within(text, -FASTEST..=FASTEST).map_err(|why| format!("speed `{text}` {why}"))
        };
        let parts = velocity.split(',').map(part).collect::<Result<Vec<_>, _>>()?;
        let &[forward_m_s, left_m_s, turn_rad_s] = parts.as_slice() else {
            return Err(form.into());
        };
        Ok(Self { at_s, steering: Steering { forward_m_s, left_m_s, turn_rad_s } })
    }
}

/// Steering of the most recent step at `time_s`.
pub fn at(steps: &[Step], time_s: f64) -> Steering {
    let begun = steps.iter().rev().find(|step| step.at_s <= time_s);
    begun.map(|step| step.steering).unwrap_or_default()
}

/// Checks that the start times increase, and that each is before the end of the drive at `until_s`.
///
/// # Errors
/// Returns a message about the first step that violates this.
pub fn check(steps: &[Step], until_s: f64) -> Result<(), String> {
    if let Some(late) = steps.iter().find(|step| step.at_s >= until_s) {
        return Err(format!(
            "--steer at {} s would never begin, because --until {until_s} ends the drive earlier",
            late.at_s
        ));
    }
    match steps.windows(2).find(|pair| pair[1].at_s <= pair[0].at_s) {
        Some(pair) => Err(format!(
            "--steer at {} s is given after --steer at {} s: give the steps in order of time",
            pair[1].at_s, pair[0].at_s
        )),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_read_and_wrong_ones_say_what_would_be_right() {
        let step: Step = "2.5:0.15,0,-0.3".parse().unwrap();
        let steering = Steering { forward_m_s: 0.15, left_m_s: 0.0, turn_rad_s: -0.3 };
        assert_eq!(step, Step { at_s: 2.5, steering });
        for (wrong, says) in [
            ("0.15,0,0", "AT:FORWARD"),
            ("2:0.15", "AT:FORWARD"),
            ("x:0,0,0", "time `x` is not a number"),
            ("2:0,0,99", "speed `99` must be from"),
            ("-1:0,0,0", "time `-1` must be from"),
            ("2:0,NaN,0", "speed `NaN` must be from"),
        ] {
            let why = wrong.parse::<Step>().unwrap_err();
            assert!(why.contains(says), "{wrong}: {why}");
        }
    }

    #[test]
    fn the_last_step_before_a_time_counts() {
        let step = |text: &str| text.parse::<Step>().unwrap();
        let steps = [step("1:0.1,0,0"), step("3:0,0,0.2")];
        assert_eq!(at(&steps, 0.5), Steering::default());
        assert_eq!(at(&steps, 2.9), steps[0].steering);
        assert_eq!(at(&steps, 9.0), steps[1].steering);
        assert_eq!(check(&steps, 4.0), Ok(()));
        assert!(check(&steps, 3.0).unwrap_err().contains("--steer at 3 s would never begin"));
        assert!(check(&[steps[1], steps[0]], 4.0).unwrap_err().contains("steps in order of time"));
    }
}
