//! Motions that the user requests, and their entries in the controller's library.

use miette::miette;
use rollwalk_host::catalog::{Catalog, CatalogMotion};
use rollwalk_protocol::library::place_of;
use std::fmt;
use std::str::FromStr;

/// Requested motion.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionRequest {
    motion: String,
    seconds: Option<f64>,
}

impl MotionRequest {
    /// True if the request has a playing time.
    pub fn has_seconds(&self) -> bool {
        self.seconds.is_some()
    }
}

impl fmt::Display for MotionRequest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.motion)?;
        self.seconds.map_or(Ok(()), |seconds| write!(f, ":{seconds}"))
    }
}

impl FromStr for MotionRequest {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let (motion, seconds) = match text.rsplit_once(':') {
            None => (text, None),
            Some((motion, seconds)) => {
                let parsed = seconds.parse().ok().filter(|s: &f64| s.is_finite() && *s > 0.0);
                let wrong = || {
                    format!(
                        "`{seconds}` is not a duration in s: give seconds above 0, as in walk:10"
                    )
                };
                (motion, Some(parsed.ok_or_else(wrong)?))
            }
        };
        if motion.is_empty() {
            return Err("the motion is missing: give a code or a name, as in walk:10".into());
        }
        Ok(Self { motion: motion.into(), seconds })
    }
}

/// A motion to be played.
pub struct SelectedMotion<'a> {
    pub code: u8,
    /// Requested playing time, s.
    pub seconds: Option<f64>,
    /// Index and entry of the motion in the catalogue, if known.
    pub motion: Option<(usize, &'a CatalogMotion)>,
}

impl SelectedMotion<'_> {
    pub fn name(&self) -> String {
        self.motion.map_or_else(|| format!("code {}", self.code), |(_, motion)| motion.name.clone())
    }
}

/// Returns the requested motion. If the catalogue is that of the controller's library, an unknown code is refused here, before
/// the robot moves.
///
/// # Errors
/// Returns an error if the requested motion does not exist or has no code, with the available motions or codes, or if the motion
/// names of the library are unknown.
pub fn choose<'a>(
    wanted: &MotionRequest,
    catalog: Option<&'a Catalog>,
    is_its_own: bool,
) -> miette::Result<SelectedMotion<'a>> {
    let MotionRequest { motion: text, seconds } = wanted;
    let motions = || catalog.into_iter().flat_map(|catalog| catalog.motions.iter().enumerate());
    if let Ok(code) = text.parse::<u8>() {
        let motion = motions().find(|(_, motion)| motion.code == Some(code));
        return match catalog.filter(|_| is_its_own && motion.is_none()) {
            None => Ok(SelectedMotion { code, seconds: *seconds, motion }),
            Some(catalog) => Err(miette!(
                help = format!("give one of {}", codes(catalog)),
                "the library of {} has no motion with code {code}",
                catalog.robot
            )),
        };
    }
    let Some(catalog) = catalog else {
        return Err(miette!(
            help = "give the library with --library LIB.rwl, or the code of the motion",
            "`{text}`: the motion names of the controller's library are unknown on this computer"
        ));
    };
    let found = motions().find(|(_, motion)| motion.name == *text);
    match found.map(|found| (found, found.1.code)) {
        Some((motion, Some(code))) => {
            Ok(SelectedMotion { code, seconds: *seconds, motion: Some(motion) })
        }
        Some((_, None)) => Err(miette!(
            "`{text}` has no command code: it is played only on the way to other motions"
        )),
        None => {
            let names: Vec<_> = catalog.motions.iter().map(|motion| motion.name.as_str()).collect();
            Err(miette!(
                help = format!("give one of {}", names.join(", ")),
                "the library of {} has no motion `{text}`",
                catalog.robot
            ))
        }
    }
}

/// Checks, before the robot is armed, that `--at` permits the motions for a place: one motion at the given place.
///
/// # Errors
/// Returns an error with the place that a motion needs and the one that was given.
pub fn check_place(chosen: &[SelectedMotion<'_>], at: Option<&str>) -> miette::Result<()> {
    let mut left = at;
    let names = chosen.iter().filter_map(|chosen| Some(chosen.motion?.1.name.as_str()));
    for (name, needed) in names.filter_map(|name| Some((name, place_of(name)?))) {
        let given = match (at, left.take()) {
            (_, Some(given)) if given == needed => continue,
            (_, Some(given)) => format!("--at is `{given}`"),
            (None, None) => "--at is missing".to_owned(),
            (Some(_), None) => "--at permits only one motion for a place".to_owned(),
        };
        let help = match at {
            Some(at) if at == needed => {
                "play the motions one by one, and make sure each time that the robot stands there"
                    .to_owned()
            }
            _ => format!("bring the robot to `{needed}`, and then give --at {needed}"),
        };
        return Err(miette!(help = help, "`{name}` begins at the place `{needed}`, but {given}"));
    }
    Ok(())
}

/// List of the command codes and their motions.
fn codes(catalog: &Catalog) -> String {
    let known = |motion: &CatalogMotion| Some(format!("{} ({})", motion.code?, motion.name));
    catalog.motions.iter().filter_map(known).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_may_have_seconds() {
        let wanted = |motion: &str, seconds| MotionRequest { motion: motion.into(), seconds };
        assert_eq!("walk".parse(), Ok(wanted("walk", None)));
        assert_eq!("3:4.5".parse(), Ok(wanted("3", Some(4.5))));
        for wrong in ["walk:", "walk:-1", "walk:NaN", "walk:fast", ":3", ""] {
            wrong.parse::<MotionRequest>().expect_err(wrong);
        }
    }

    #[test]
    fn a_code_counts_as_wrong_only_by_the_controllers_own_library() {
        let motion = |name: &str, code| CatalogMotion {
            name: name.into(),
            code,
            frames: 60,
            looping: false,
        };
        let catalog = Catalog {
            robot: "pup".into(),
            config_hash: 1,
            library: 2,
            motions: vec![motion("stand", Some(1)), motion("step", None), motion("walk", Some(4))],
            transitions: Vec::new(),
            safe: 0,
            channels: Vec::new(),
            actuators: Default::default(),
        };
        let code = |code: &str, catalog, is_its_own| {
            let chosen = choose(&code.parse().unwrap(), catalog, is_its_own);
            chosen.map(|chosen| (chosen.code, chosen.motion.map(|(node, _)| node)))
        };
        assert_eq!(code("4", Some(&catalog), true).unwrap(), (4, Some(2)));
        let error = code("99", Some(&catalog), true).unwrap_err();
        assert_eq!(error.to_string(), "the library of pup has no motion with code 99");
        assert_eq!(error.help().unwrap().to_string(), "give one of 1 (stand), 4 (walk)");
        assert_eq!(code("99", Some(&catalog), false).unwrap(), (99, None));
        assert_eq!(code("99", None, false).unwrap(), (99, None));
    }

    #[test]
    fn a_place_permits_one_motion_that_begins_there() {
        let motion = |name: &str| CatalogMotion {
            name: name.into(),
            code: Some(1),
            frames: 60,
            looping: false,
        };
        let motions = ["stand", "climb@stairs", "down@stairs"].map(motion);
        let check = |played: &[usize], at| {
            let select = |&node: &usize| SelectedMotion {
                code: 1,
                seconds: None,
                motion: Some((node, &motions[node])),
            };
            check_place(&played.iter().map(select).collect::<Vec<_>>(), at)
        };
        let refused = |played: &[usize], at| {
            let error = check(played, at).unwrap_err();
            (error.to_string(), error.help().unwrap().to_string())
        };
        assert!(check(&[0, 0], None).is_ok() && check(&[0, 1, 0], Some("stairs")).is_ok());
        let (error, help) = refused(&[0, 1], Some("table"));
        assert_eq!(error, "`climb@stairs` begins at the place `stairs`, but --at is `table`");
        assert_eq!(help, "bring the robot to `stairs`, and then give --at stairs");
        let (error, _) = refused(&[1], None);
        assert_eq!(error, "`climb@stairs` begins at the place `stairs`, but --at is missing");
        let (error, help) = refused(&[1, 0, 2], Some("stairs"));
        assert!(
            error.starts_with("`down@stairs` begins")
                && error.ends_with("only one motion for a place")
        );
        assert!(help.starts_with("play the motions one by one"), "{help}");
    }
}
