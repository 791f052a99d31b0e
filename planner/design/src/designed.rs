//! Robot under design: a robot file with parameters, and the motions that the robot must do.

use crate::catalog::Servo;
use crate::file::{self, DesignFile};
use crate::parameter::{Kind, Location};
use crate::text::{NoEffect, RobotText, number};
use rollwalk_multibody::ground::Terrain;
use rollwalk_planner::Structures;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::sensitivity::{Design, Parameter};
use rollwalk_robot::Robot;
use rollwalk_robot::document::DocumentError;
use std::path::Path;
use toml_edit::DocumentMut;

/// Name and content of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedText {
    /// Name of the file, for messages.
    pub name: String,
    /// Content of the file.
    pub text: String,
}

/// Motion file, with the terrain that it names.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionFile {
    /// The motion file.
    pub file: NamedText,
    /// Terrain; `None` for level ground.
    pub terrain: Option<Terrain>,
}

impl From<NamedText> for MotionFile {
    fn from(file: NamedText) -> Self {
        Self { file, terrain: None }
    }
}

#[derive(Clone, Debug)]
struct MotionText {
    name: String,
    document: DocumentMut,
    terrain: Option<Terrain>,
}

impl NamedText {
    /// Checks that a motion file has a number at a path.
    ///
    /// # Errors
    /// If there is no such number.
    pub(crate) fn check_motion_value(&self, path: &str) -> Result<(), NoEffect> {
        number::value(&MotionText::new(self.clone().into()).document, path).map(drop)
    }
}

impl MotionText {
    fn new(MotionFile { file, terrain }: MotionFile) -> Self {
        // Text that is not TOML is reported when the motion is read.
        Self { document: file.text.parse().unwrap_or_default(), name: file.name, terrain }
    }

    /// File name without folder and extension, by which parameters refer to the motion.
    fn stem(&self) -> &str {
        Path::new(&self.name).file_stem().and_then(|stem| stem.to_str()).unwrap_or_default()
    }
}

/// Robot file with parameters, and motion files.
#[derive(Clone, Debug)]
pub struct Designed {
    /// The design file.
    pub file: DesignFile,
    robot: NamedText,
    text: RobotText,
    motions: Vec<MotionText>,
    original: Vec<f64>,
    /// Error of the original robot if it cannot reach the targets of its motions; `None` if it can.
    beyond: Option<DocumentError>,
    /// Structures of earlier plans. Clones share them.
    pub(crate) structures: Structures,
}

/// Robot at given values of the parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// Values of the parameters, in the units of their kinds.
    pub values: Vec<f64>,
    /// Text of the robot file, comments kept.
    pub text: String,
    /// Robot that the text describes.
    pub robot: Robot,
    /// Texts of the motion files, comments kept.
    pub motion_texts: Vec<String>,
    /// Motions of this robot.
    pub motions: Vec<Motion>,
}

impl Designed {
    /// Reads a design file with its robot file and its motion files. `motions` must be in the order of the design file.
    ///
    /// # Errors
    /// Returns the faults of the first invalid file, or the parameters that do not fit the robot.
    pub fn new(
        design: &NamedText,
        robot: NamedText,
        motions: impl IntoIterator<Item: Into<MotionFile>>,
    ) -> Result<Self, DocumentError> {
        let file = DesignFile::from_toml(&design.name, &design.text)?;
        // Faults of the robot are reported with their positions, so the code below reads valid text.
        Robot::from_toml(&robot.name, &robot.text)?;
        let mut text = RobotText::new(&robot.text).unwrap_or_default();
        let motions = motions.into_iter().map(|motion| MotionText::new(motion.into()));
        let motions: Vec<MotionText> = motions.collect();
        let of_motion = |place: &Location| {
            let stem = place.template.as_deref().unwrap_or_default();
            let motion = motions.iter().find(|motion| motion.stem() == stem);
            let known = || motions.iter().map(MotionText::stem).collect::<Vec<_>>();
            let motion = motion.ok_or_else(|| NoEffect {
                problem: format!("the design has no motion file `{stem}`"),
                help: match known()[..] {
                    [] => "list the file in `motions`".to_owned(),
                    [first, ..] => format!(
                        "give one of the motion files {}, as in {first}/duration_s",
                        known().join(", ")
                    ),
                },
            })?;
            number::value(&motion.document, &place.name)
        };
        let original = file.check(&design.name, &design.text, |place| {
            if place.kind.is_of_motion() { of_motion(place) } else { text.value(place) }
        })?;
        Self {
            file,
            robot,
            text,
            motions,
            original,
            beyond: None,
            structures: Structures::default(),
        }
        .checked()
    }

    /// Checks that the motions fit a robot of this design: the original, or the one with all parameters at their maximum, or at
    /// their minimum. The original may be unable to reach the targets.
    fn checked(mut self) -> Result<Self, DocumentError> {
        self.beyond = self.at(&self.original).err();
        if let Some(error) = &self.beyond {
            let parameters = &self.file.parameters;
            let most: Vec<f64> = parameters.iter().map(|of| of.max).collect();
            let least: Vec<f64> = parameters.iter().map(|of| of.min).collect();
            if parameters.is_empty() || (self.at(&most).is_err() && self.at(&least).is_err()) {
                return Err(error.clone());
            }
        }
        Ok(self)
    }

    /// Error of the original robot if it cannot reach the targets of its motions; `None` if it can.
    pub fn beyond(&self) -> Option<&DocumentError> {
        self.beyond.as_ref()
    }

    /// Design without parameters.
    ///
    /// # Errors
    /// Returns the faults of the first invalid file.
    pub fn fixed(robot: NamedText, motions: Vec<MotionFile>) -> Result<Self, DocumentError> {
        Self::with_parameters(robot, motions, Vec::new())
    }

    /// Design with parameters that no design file lists. Parameters that the robot file lacks are dropped.
    ///
    /// # Errors
    /// Returns the faults of the first invalid file.
    pub fn with_parameters(
        robot: NamedText,
        motions: Vec<MotionFile>,
        parameters: Vec<file::Parameter>,
    ) -> Result<Self, DocumentError> {
        Robot::from_toml(&robot.name, &robot.text)?;
        let mut text = RobotText::new(&robot.text).unwrap_or_default();
        let known = parameters.into_iter().filter_map(|of| Some((text.value(&of.place).ok()?, of)));
        let (original, parameters) = known.unzip();
        let file = DesignFile { parameters, ..DesignFile::default() };
        let motions = motions.into_iter().map(MotionText::new).collect();
        Self {
            file,
            robot,
            text,
            motions,
            original,
            beyond: None,
            structures: Structures::default(),
        }
        .checked()
    }

    /// Replaces the motions.
    ///
    /// # Errors
    /// If the motions do not fit the robot.
    pub fn with_motions(mut self, motions: Vec<MotionFile>) -> Result<Self, DocumentError> {
        self.motions = motions.into_iter().map(MotionText::new).collect();
        self.checked()
    }

    /// Replaces numbers at paths in all motion files. Motion files without such a number stay unchanged.
    pub fn with_motion_values<'v>(mut self, values: impl Iterator<Item = (&'v str, f64)>) -> Self {
        for (path, value) in values {
            for motion in &mut self.motions {
                number::set(&mut motion.document, path, value);
            }
        }
        self
    }

    /// Returns the motion files.
    pub fn motions(&self) -> Vec<NamedText> {
        let text =
            |of: &MotionText| NamedText { name: of.name.clone(), text: of.document.to_string() };
        self.motions.iter().map(text).collect()
    }

    /// Replaces the servo of an actuator in the robot file: speed limit, torque limit, torque-speed line, and the mass of the
    /// parts that name the actuator.
    ///
    /// # Errors
    /// If the changed robot file breaks a rule.
    pub fn with_servo(mut self, actuator: &str, servo: &Servo) -> Result<Self, DocumentError> {
        self.text.set_servo(actuator, servo);
        self.checked()
    }

    /// Model of an actuator in the robot file; `None` if the file has no actuator with the given name.
    pub fn model_of(&self, actuator: &str) -> Option<&str> {
        self.text.model_of(actuator)
    }

    /// Warning if no part of the robot file names this actuator. Another servo then leaves the masses unchanged.
    pub fn mass_unknown(&self, actuator: &str) -> Option<String> {
        let known = !self.text.clone().parts_of(actuator).is_empty();
        (!known).then(|| {
            format!(
                "warning: no part of {} has actuator = \"{actuator}\", so another servo does not \
                 change the masses (docs/robot-files.md)",
                self.robot.name
            )
        })
    }

    /// Present value of a parameter in the robot file.
    ///
    /// # Errors
    /// If the robot lacks the part that the parameter changes.
    pub fn value_of(&self, place: &Location) -> Result<f64, NoEffect> {
        self.text.clone().value(place)
    }

    /// Values of the parameters in the original robot file.
    pub fn original(&self) -> &[f64] {
        &self.original
    }

    /// Builds the robot at other values, which may exceed the bounds of the parameters.
    ///
    /// # Errors
    /// If the robot file breaks a rule at these values, or a motion file does not fit the robot.
    pub fn at(&self, values: &[f64]) -> Result<Variant, DocumentError> {
        let mut text = self.text.clone();
        // Templates of all limbs come first, because limbs are copied later.
        for of_all in [true, false] {
            let all = self.file.parameters.iter().zip(values);
            for (parameter, value) in all.filter(|(of, _)| of.place.limbs.is_empty() == of_all) {
                // The positions were checked, so this cannot fail.
                let _ = text.set(&parameter.place, *value);
            }
        }
        let text = text.to_string();
        let robot = Robot::from_toml(&self.robot.name, &text)?;
        let changed = |motion: &MotionText| {
            let mut document = motion.document.clone();
            let all = self.file.parameters.iter().zip(values).filter(|(of, _)| {
                of.place.kind.is_of_motion() && of.place.template.as_deref() == Some(motion.stem())
            });
            all.for_each(|(of, value)| number::set(&mut document, &of.place.name, *value));
            document.to_string()
        };
        let motion_texts: Vec<String> = self.motions.iter().map(changed).collect();
        let both = self.motions.iter().zip(&motion_texts);
        let motion = |(file, text): (&MotionText, &String)| {
            Motion::from_toml_on(&file.name, text, &robot, file.terrain.as_ref())
        };
        let motions = both.map(motion).collect::<Result<_, _>>()?;
        Ok(Variant { values: values.to_vec(), text, robot, motion_texts, motions })
    }

    /// Returns the two robots for central differences with respect to one parameter.
    ///
    /// # Errors
    /// Returns the errors of [`at`](Self::at).
    pub fn around(&self, values: &[f64], parameter: usize) -> Result<Neighbours, DocumentError> {
        let half = HALF_DIFFERENCE * self.unit(parameter);
        let at = |by: f64| {
            let mut values = values.to_vec();
            values[parameter] += by;
            self.at(&values)
        };
        Ok(Neighbours { ahead: at(half)?, behind: at(-half)?, apart: 2.0 * half })
    }

    /// Unit of change of a parameter: 0.01 m, 0.1 rad, or 10 % of a speed, torque, mass or motion value. Changes of different
    /// parameters are compared in these units.
    pub fn unit(&self, parameter: usize) -> f64 {
        match self.file.parameters[parameter].place.kind {
            Kind::Tilt => 0.1,
            Kind::Speed | Kind::Torque | Kind::Mass => 0.1 * self.original[parameter].abs(),
            kind if kind.is_of_motion() => 0.1 * self.original[parameter].abs().max(0.1),
            _ => 0.01,
        }
    }
}

/// Half of the step of central differences, in units of the parameter.
const HALF_DIFFERENCE: f64 = 1e-3;

/// Robots on both sides of a design, for central differences with respect to one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Neighbours {
    ahead: Variant,
    behind: Variant,
    apart: f64,
}

impl Neighbours {
    /// Parameter for the sensitivity of one plan. `motions` comes from [`motions`](Self::motions).
    pub fn of_motion<'a>(&'a self, motions: &'a [Motion; 2]) -> Parameter<'a> {
        let [ahead, behind] = motions;
        Parameter {
            ahead: Design { robot: &self.ahead.robot, motion: ahead },
            behind: Design { robot: &self.behind.robot, motion: behind },
            apart: self.apart,
        }
    }

    /// Motion `index` of both neighbours, on the samples of `planned`.
    pub fn motions(&self, index: usize, planned: &Motion) -> [Motion; 2] {
        [&self.ahead, &self.behind].map(|variant| on_samples_of(&variant.motions[index], planned))
    }
}

/// Copies a motion onto the samples of its plan. A plan may have more samples than its motion file requests.
pub fn on_samples_of(motion: &Motion, planned: &Motion) -> Motion {
    Motion { stance: planned.stance.clone(), ..motion.clone() }
}
