//! A robot under design: the robot file at any values of its parameters, with the motions that it is for.

use crate::catalog::Servo;
use crate::file::{self, DesignFile};
use crate::parameter::{Kind, Place};
use crate::text::{Nothing, RobotText, number};
use rollwalk_planner::motion::Motion;
use rollwalk_planner::sensitivity::{Design, Parameter};
use rollwalk_robot::Robot;
use rollwalk_robot::document::DocumentError;
use std::path::Path;
use toml_edit::DocumentMut;

/// A file that has been read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedText {
    /// Name of the file in messages.
    pub name: String,
    /// Content of the file.
    pub text: String,
}

#[derive(Clone, Debug)]
struct MotionText {
    name: String,
    document: DocumentMut,
}

impl MotionText {
    fn new(file: NamedText) -> Self {
        // What is no TOML is said when the motion is read.
        Self { document: file.text.parse().unwrap_or_default(), name: file.name }
    }

    /// File name without folder and ending, by which parameters name the motion.
    fn stem(&self) -> &str {
        Path::new(&self.name).file_stem().and_then(|stem| stem.to_str()).unwrap_or_default()
    }
}

/// A robot file with parameters, and motion files.
#[derive(Clone, Debug)]
pub struct Designed {
    /// The design file.
    pub file: DesignFile,
    robot: NamedText,
    text: RobotText,
    motions: Vec<MotionText>,
    original: Vec<f64>,
    /// Error of the original robot if it does not reach the targets of its motions; `None` if it does.
    beyond: Option<DocumentError>,
}

/// A robot at some values of the parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// Values of the parameters, each in its kind's unit.
    pub values: Vec<f64>,
    /// The robot file, comments kept.
    pub text: String,
    /// The robot that it describes.
    pub robot: Robot,
    /// The motion files, comments kept.
    pub motion_texts: Vec<String>,
    /// The motions, as this robot does them.
    pub motions: Vec<Motion>,
}

impl Designed {
    /// Reads the text of a design file, the robot file and the motion files that it names, which are in its order.
    ///
    /// # Errors
    /// Everything that is wrong with one of them, and parameters that do not fit the robot.
    pub fn new(
        design: &NamedText,
        robot: NamedText,
        motions: Vec<NamedText>,
    ) -> Result<Self, DocumentError> {
        let file = DesignFile::from_toml(&design.name, &design.text)?;
        // Its faults are said with their places, and nothing that it says is misread below.
        Robot::from_toml(&robot.name, &robot.text)?;
        let mut text = RobotText::new(&robot.text).unwrap_or_default();
        let motions: Vec<MotionText> = motions.into_iter().map(MotionText::new).collect();
        let of_motion = |place: &Place| {
            let stem = place.template.as_deref().unwrap_or_default();
            let motion = motions.iter().find(|motion| motion.stem() == stem);
            let known = || motions.iter().map(MotionText::stem).collect::<Vec<_>>().join(", ");
            let motion = motion.ok_or_else(|| Nothing {
                problem: format!("the design has no motion file `{stem}`"),
                help: format!("there are {}: give {}/duration_s, for example", known(), stem),
            })?;
            number::value(&motion.document, &place.name)
        };
        let original = file.check(&design.name, &design.text, |place| {
            if place.kind.is_of_motion() { of_motion(place) } else { text.value(place) }
        })?;
        Self { file, robot, text, motions, original, beyond: None }.checked()
    }

    /// Checks that the motions fit the original robot, or one with all parameters at their most or all at their least. Targets
    /// may be beyond the reach of the original.
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

    /// Error of the original robot if it does not reach the targets of its motions; `None` if it does.
    pub fn beyond(&self) -> Option<&DocumentError> {
        self.beyond.as_ref()
    }

    /// A robot file and motions of which nothing may change.
    ///
    /// # Errors
    /// Everything that is wrong with one of them.
    pub fn fixed(robot: NamedText, motions: Vec<NamedText>) -> Result<Self, DocumentError> {
        Self::with_parameters(robot, motions, Vec::new())
    }

    /// A robot file and motions with parameters of no design file. Those that the robot file does not have are left out.
    ///
    /// # Errors
    /// Everything that is wrong with one of the files.
    pub fn with_parameters(
        robot: NamedText,
        motions: Vec<NamedText>,
        parameters: Vec<file::Parameter>,
    ) -> Result<Self, DocumentError> {
        Robot::from_toml(&robot.name, &robot.text)?;
        let mut text = RobotText::new(&robot.text).unwrap_or_default();
        let known = parameters.into_iter().filter_map(|of| Some((text.value(&of.place).ok()?, of)));
        let (original, parameters) = known.unzip();
        let file = DesignFile { parameters, ..DesignFile::default() };
        let motions = motions.into_iter().map(MotionText::new).collect();
        Self { file, robot, text, motions, original, beyond: None }.checked()
    }

    /// The same with other motions.
    ///
    /// # Errors
    /// They do not fit the robot.
    pub fn with_motions(mut self, motions: Vec<NamedText>) -> Result<Self, DocumentError> {
        self.motions = motions.into_iter().map(MotionText::new).collect();
        self.checked()
    }

    /// The same with the speed, torque and torque-speed line of another servo in an actuator of the robot file, and with its mass
    /// in the parts that are this actuator.
    ///
    /// # Errors
    /// The robot file breaks a rule with it.
    pub fn with_servo(mut self, actuator: &str, servo: &Servo) -> Result<Self, DocumentError> {
        self.text.set_servo(actuator, servo);
        self.checked()
    }

    /// Model of an actuator of the robot file; `None` if it has none of this name.
    pub fn model_of(&self, actuator: &str) -> Option<&str> {
        self.text.model_of(actuator)
    }

    /// A warning if no part of the robot file is this actuator, so that the mass stays as it is with another servo.
    pub fn mass_unknown(&self, actuator: &str) -> Option<String> {
        let known = !self.text.clone().parts_of(actuator).is_empty();
        (!known).then(|| {
            format!(
                "warning: no part of {} has actuator = \"{actuator}\": masses stay as they are with another servo \
                 (docs/robot-files.md)",
                self.robot.name
            )
        })
    }

    /// Present value of a place in the robot file.
    ///
    /// # Errors
    /// The robot has no such part.
    pub fn value_of(&self, place: &Place) -> Result<f64, Nothing> {
        self.text.clone().value(place)
    }

    /// Values of the parameters in the robot file.
    pub fn original(&self) -> &[f64] {
        &self.original
    }

    /// The robot at other values, within their bounds or not.
    ///
    /// # Errors
    /// It breaks a rule of robot files, or a motion file does not fit it any more.
    pub fn at(&self, values: &[f64]) -> Result<Variant, DocumentError> {
        let mut text = self.text.clone();
        // Templates of all limbs first: later some limbs have copies.
        for of_all in [true, false] {
            let all = self.file.parameters.iter().zip(values);
            for (parameter, value) in all.filter(|(of, _)| of.place.limbs.is_empty() == of_all) {
                // The places have been checked.
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
        let motion =
            |(file, text): (&MotionText, &String)| Motion::from_toml(&file.name, text, &robot);
        let motions = both.map(motion).collect::<Result<_, _>>()?;
        Ok(Variant { values: values.to_vec(), text, robot, motion_texts, motions })
    }

    /// Neighbours on either side of some values along a parameter, from which derivatives by it are taken.
    ///
    /// # Errors
    /// As [`at`](Self::at).
    pub fn around(&self, values: &[f64], parameter: usize) -> Result<Neighbours, DocumentError> {
        let half = HALF_DIFFERENCE * self.unit(parameter);
        let at = |by: f64| {
            let mut values = values.to_vec();
            values[parameter] += by;
            self.at(&values)
        };
        Ok(Neighbours { ahead: at(half)?, behind: at(-half)?, apart: 2.0 * half })
    }

    /// A change of a parameter that is small, but not very small: 1 cm, 0.1 rad, a tenth of a limit, a mass or a number of a
    /// motion. Parameters are
    /// compared in these units.
    pub fn unit(&self, parameter: usize) -> f64 {
        match self.file.parameters[parameter].place.kind {
            Kind::Tilt => 0.1,
            Kind::Speed | Kind::Torque | Kind::Mass => 0.1 * self.original[parameter].abs(),
            kind if kind.is_of_motion() => 0.1 * self.original[parameter].abs().max(0.1),
            _ => 0.01,
        }
    }
}

/// Distance of a neighbour, in units of its parameter.
const HALF_DIFFERENCE: f64 = 1e-3;

/// Neighbours of a robot along one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Neighbours {
    ahead: Variant,
    behind: Variant,
    apart: f64,
}

impl Neighbours {
    /// Parameter of the plan of one of the motions, on that plan's samples.
    pub fn of_motion<'a>(&'a self, motions: &'a [Motion; 2]) -> Parameter<'a> {
        let [ahead, behind] = motions;
        Parameter {
            ahead: Design { robot: &self.ahead.robot, motion: ahead },
            behind: Design { robot: &self.behind.robot, motion: behind },
            apart: self.apart,
        }
    }

    /// A motion as the neighbours do it, on the samples of a plan.
    pub fn motions(&self, index: usize, planned: &Motion) -> [Motion; 2] {
        [&self.ahead, &self.behind].map(|variant| on_samples_of(&variant.motions[index], planned))
    }
}

/// A motion on the samples of a plan of it: plans may have more than their motion files ask for.
pub fn on_samples_of(motion: &Motion, planned: &Motion) -> Motion {
    Motion { stance: planned.stance.clone(), ..motion.clone() }
}
