//! Kinds of parameters: key in a design file, unit, and the changed value.

use std::fmt;

/// Coordinate axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Forward.
    X,
    /// Coordinate to the left; right limbs are mirrored.
    Y,
    /// Up.
    Z,
}

impl Axis {
    /// Axis of a letter.
    pub fn of(letter: &str) -> Option<Self> {
        Some(match letter {
            "x" => Self::X,
            "y" => Self::Y,
            "z" => Self::Z,
            _ => return None,
        })
    }

    /// Letter of the axis.
    pub fn letter(self) -> char {
        ['x', 'y', 'z'][self.index()]
    }

    /// Index of the axis in a vector.
    pub fn index(self) -> usize {
        self as usize
    }
}

/// Kind of value that a parameter changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Length of a link, from its joint to the next joint, foot or wheel.
    Length,
    /// Coordinate of a joint in its parent link.
    Joint,
    /// Coordinate of the mounting points of limbs.
    Mount,
    /// Coordinate of the centre of a foot or wheel in its link.
    Center,
    /// Radius of a foot or wheel.
    Radius,
    /// Tilt of a wheel's axis about the x axis of its link.
    Tilt,
    /// Speed limit of a servo.
    Speed,
    /// Torque limit of a servo.
    Torque,
    /// Mass of a link's heaviest part.
    Mass,
    /// Length in a motion file.
    MotionLength,
    /// Time in a motion file.
    MotionTime,
    /// Angle in a motion file.
    MotionAngle,
}

impl Kind {
    /// List of all kinds.
    pub const ALL: [Self; 12] = [
        Self::Length,
        Self::Joint,
        Self::Mount,
        Self::Center,
        Self::Radius,
        Self::Tilt,
        Self::Speed,
        Self::Torque,
        Self::Mass,
        Self::MotionLength,
        Self::MotionTime,
        Self::MotionAngle,
    ];

    /// Key in a design file.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Length => "length_of",
            Self::Joint => "joint",
            Self::Mount => "mount",
            Self::Center => "center_of",
            Self::Radius => "radius_of",
            Self::Tilt => "tilt_of",
            Self::Speed => "speed_of",
            Self::Torque => "torque_of",
            Self::Mass => "mass_of",
            Self::MotionLength => "length_in",
            Self::MotionTime => "time_in",
            Self::MotionAngle => "angle_in",
        }
    }

    /// Unit of the values, and the keys of the lower bound, the upper bound and the manufacturing step.
    pub const fn unit(self) -> (&'static str, [&'static str; 3]) {
        match self {
            Self::Tilt | Self::MotionAngle => ("rad", ["min_rad", "max_rad", "step_rad"]),
            Self::Speed => ("rad/s", ["min_rad_s", "max_rad_s", "step_rad_s"]),
            Self::Torque => ("N·m", ["min_nm", "max_nm", "step_nm"]),
            Self::MotionTime => ("s", ["min_s", "max_s", "step_s"]),
            Self::Mass => ("kg", ["min_kg", "max_kg", "step_kg"]),
            _ => ("m", ["min_m", "max_m", "step_m"]),
        }
    }

    /// Returns true if the parameter changes a value of a motion file. Design files write such a parameter as stem and key:
    /// `walk/duration_s`.
    pub const fn is_of_motion(self) -> bool {
        matches!(self, Self::MotionLength | Self::MotionTime | Self::MotionAngle)
    }

    /// Returns true if the value must be positive, as a length or a mass.
    pub const fn is_positive(self) -> bool {
        matches!(
            self,
            Self::Length
                | Self::Radius
                | Self::Speed
                | Self::Torque
                | Self::Mass
                | Self::MotionTime
        )
    }

    /// Returns true if the value is a coordinate. Design files append its axis after a dot: `leg/*_knee.z`.
    pub const fn has_axis(self) -> bool {
        matches!(self, Self::Joint | Self::Mount | Self::Center)
    }
}

/// Kind and location of the value that a parameter changes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// Kind of the value.
    pub kind: Kind,
    /// Template of the link, joint or end effector. `None` for servos and for parts outside templates. For a value of a motion:
    /// the stem of the motion file.
    pub template: Option<String>,
    /// Name of the link, joint, end effector or servo. For a value of a motion: its keys, joined by dots.
    pub name: String,
    /// Axis of a coordinate; `None` for other kinds.
    pub axis: Option<Axis>,
    /// Limbs that the parameter changes, which then get their own template. Empty for all limbs of the template.
    pub limbs: Vec<String>,
}

impl Location {
    /// Returns true if both parameters change the same value.
    pub fn meets(&self, other: &Self) -> bool {
        let same_limbs = self.limbs.is_empty()
            || other.limbs.is_empty()
            || self.limbs.iter().any(|limb| other.limbs.contains(limb));
        let place = |of: &Self| Self { limbs: Vec::new(), ..of.clone() };
        same_limbs && place(self) == place(other)
    }

    /// Copy that changes all limbs of another template.
    pub fn of_template(&self, template: &str) -> Self {
        Self { template: Some(template.to_owned()), limbs: Vec::new(), ..self.clone() }
    }
}

/// Prints the notation of design files.
impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = \"", self.kind.key())?;
        if let Some(template) = &self.template {
            write!(f, "{template}/")?;
        }
        f.write_str(&self.name)?;
        if let Some(axis) = self.axis {
            write!(f, ".{}", axis.letter())?;
        }
        f.write_str("\"")?;
        if !self.limbs.is_empty() {
            write!(f, " of {}", self.limbs.join(", "))?;
        }
        Ok(())
    }
}
