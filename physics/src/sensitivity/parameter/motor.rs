//! Drives: gains and rotor inertia of motors.

use crate::motor::Motor;
use crate::sensitivity::parameter::{Column, Constant, Parameter, SolvedStep};
use crate::system::System;

/// Parameter with one common value for several motors. Controllers must not change it in the motors' laws during a rollout.
#[derive(Clone, Debug)]
pub struct MotorParameter {
    /// Force indices of the motors.
    pub motors: Vec<usize>,
    /// Quantity that the parameter changes.
    pub of: MotorQuantity,
}

/// Parameter of a motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotorQuantity {
    /// Position gain kp, N·m/rad.
    PositionGain,
    /// Speed gain kd, N·m·s/rad.
    SpeedGain,
    /// Feed-forward torque, N·m.
    Torque,
    /// Inertia of the rotor, kg·m².
    Armature,
}

impl MotorQuantity {
    fn value_mut(self, motor: &mut Motor) -> &mut f64 {
        match self {
            Self::PositionGain => &mut motor.law.kp_nm_rad,
            Self::SpeedGain => &mut motor.law.kd_nm_s_rad,
            Self::Torque => &mut motor.law.torque_nm,
            Self::Armature => &mut motor.armature_kg_m2,
        }
    }
}

impl Parameter for MotorParameter {
    fn residual(&self, solved: &SolvedStep<'_>, column: &mut Column) {
        for &number in &self.motors {
            let motor: &Motor = solved.force(number);
            let wrenches = solved.view(number, |view| {
                let by = motor.law_by(view);
                let torque = match self.of {
                    MotorQuantity::PositionGain => by.kp_rad,
                    MotorQuantity::SpeedGain => by.kd_rad_s,
                    MotorQuantity::Torque => by.torque,
                    MotorQuantity::Armature => -motor.acceleration(view),
                };
                motor.unit_wrenches(view.now).map(|unit| unit * torque)
            });
            column.add_force(&motor.bodies, &wrenches);
        }
    }
}

impl Constant for MotorParameter {
    fn value(&self, system: &System) -> f64 {
        let motor = self.motors.first().and_then(|&motor| system.force::<Motor>(motor));
        *self.of.value_mut(&mut motor.expect("the force is a motor").clone())
    }

    fn set(&self, system: &mut System, value: f64) {
        for &motor in &self.motors {
            let motor = system.force_mut::<Motor>(motor).expect("the force is a motor");
            *self.of.value_mut(motor) = value;
        }
    }
}
