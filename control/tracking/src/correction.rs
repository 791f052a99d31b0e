//! Corrections of the plan by the gains of its linear model: forces of the ground and speeds of end effectors that errors call
//! for, and the accelerations that these forces cause.

use crate::gains::Gains;
use crate::model::{self, COM, FEET, SPIN, TURN, VELOCITY, heading_rad};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix6xX, Rotation3, Vector2, Vector3};
use rollwalk_multibody::{ANGULAR, Kinematics, Tree, centroidal_momentum_matrix, rotation};

/// Farthest that a foothold moves away from the planned one, m.
const STEP_M: f64 = 0.25;

/// Corrections of a tick.
#[derive(Clone, Debug)]
pub(crate) struct Correction {
    gains: Gains,
    error: DVector<f64>,
    input: DVector<f64>,
    momentum: Matrix6xX<f64>,
    /// Acceleration of the centre of mass, m/s², and angular acceleration of the body, rad/s².
    pub com_m_s2: Vector3<f64>,
    pub body_rad_s2: Vector3<f64>,
    /// Force of the ground on each end effector, N, and its speed, m/s.
    pub force_n: Vec<Vector3<f64>>,
    pub speed_m_s: Vec<Vector3<f64>>,
    /// Offset of each end effector's foothold from the planned one, m; in the air, the desired offset.
    pub foothold_m: Vec<Vector3<f64>>,
    /// The same after the last tick that had a solution.
    last_m: Vec<Vector3<f64>>,
}

/// Contact or lowest point of an end effector.
pub(crate) struct Place {
    /// Planned and measured position, m.
    pub planned: Vector3<f64>,
    pub measured: Vector3<f64>,
    /// Planned force of the ground, N, where it stands.
    pub force_n: Option<Vector3<f64>>,
}

impl Correction {
    /// Zero corrections, for a plan with these gains.
    pub fn new(gains: Gains, tree: &Tree) -> Self {
        let feet = tree.robot().end_effectors.len();
        let none = vec![Vector3::zeros(); feet];
        Self {
            gains,
            error: DVector::zeros(model::states(feet)),
            input: DVector::zeros(model::inputs(feet)),
            momentum: Matrix6xX::zeros(tree.dofs()),
            com_m_s2: Vector3::zeros(),
            body_rad_s2: Vector3::zeros(),
            force_n: none.clone(),
            speed_m_s: none.clone(),
            foothold_m: none.clone(),
            last_m: none,
        }
    }

    /// Goes on with another plan that begins where the one before ends: footholds stay.
    pub fn change_gains(&mut self, gains: Gains) {
        self.gains = gains;
    }

    /// Corrections at a time of the plan, s, for the next tick, s long, from the motion that is planned and that which is
    /// measured, with the mass matrix of the latter.
    pub fn update(
        &mut self,
        tree: &Tree,
        [time_s, tick_s]: [f64; 2],
        [planned, measured]: [&Kinematics; 2],
        mass: &DMatrix<f64>,
        places: impl Iterator<Item = Place> + Clone,
    ) {
        let feet = self.force_n.len();
        let (there, here) = (&planned.frames, &measured.frames);
        let heading = heading_rad(&there.world_from_link[0]);
        let world_from_heading = Rotation3::from_axis_angle(&Vector3::z_axis(), heading);
        let heading_from_world = world_from_heading.inverse();
        let com = here.com(tree);
        let shift = com - there.com(tree);
        let turn = rotation::log(&(here.world_from_link[0] * there.world_from_link[0].transpose()));
        let velocity = measured.com_velocity(tree) - planned.com_velocity(tree);
        let spin = measured.angular_velocity[0] - planned.angular_velocity[0];
        for (at, value) in [(COM, shift), (TURN, turn), (VELOCITY, velocity), (SPIN, spin)] {
            self.error.fixed_rows_mut::<3>(at).copy_from(&(heading_from_world * value));
        }
        for (j, place) in places.clone().enumerate() {
            let off = heading_from_world * (place.measured - place.planned);
            self.error.fixed_rows_mut::<2>(FEET + 2 * j).copy_from(&off.xy());
        }
        self.input.gemv(-1.0, self.gains.at(time_s), &self.error, 0.0);

        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        for (j, place) in places.enumerate() {
            let speed = self.input.fixed_rows::<2>(model::speed_of(j, feet));
            self.speed_m_s[j] = world_from_heading * Vector3::new(speed[0], speed[1], 0.0);
            let mut off = place.measured - place.planned;
            off.z = 0.0;
            let mut foothold = off;
            self.force_n[j] = match place.force_n {
                Some(planned_n) => {
                    let change = world_from_heading * self.input.fixed_rows::<3>(3 * j);
                    force += change;
                    moment +=
                        (place.measured - com).cross(&change) + (off - shift).cross(&planned_n);
                    change
                }
                None => {
                    foothold = self.last_m[j] + self.speed_m_s[j] * tick_s;
                    Vector3::zeros()
                }
            };
            self.foothold_m[j] = foothold * (STEP_M / foothold.norm().max(STEP_M));
        }
        self.com_m_s2 = force / tree.total_mass_kg();
        centroidal_momentum_matrix(mass, &(com - here.link_origins[0]), &mut self.momentum);
        let inertia: Matrix3<f64> = self.momentum.fixed_view::<3, 3>(ANGULAR, ANGULAR).into();
        self.body_rad_s2 = inertia.try_inverse().map_or(Vector3::zeros(), |per| per * moment);
    }

    /// Keeps the footholds that the next tick begins with, after one that had a solution and then moved the plan by this, m.
    pub fn keep(&mut self, shift_m: Vector2<f64>) {
        self.last_m.copy_from_slice(&self.foothold_m);
        // Footholds stay where they are in the world.
        for last_m in &mut self.last_m {
            last_m.x -= shift_m.x;
            last_m.y -= shift_m.y;
        }
    }
}
