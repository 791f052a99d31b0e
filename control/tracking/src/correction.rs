//! Corrections of the plan by the gains of its linear model: ground forces, end-effector speeds, and the accelerations due to
//! these forces.

use crate::gains::Gains;
use crate::model::{self, COM, FEET, SPIN, TURN, VELOCITY, heading_rad};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix6xX, Rotation3, Vector2, Vector3};
use rollwalk_multibody::{ANGULAR, Kinematics, Tree, centroidal_momentum_matrix, rotation};

/// Largest offset of a foothold from the planned one, m.
const STEP_M: f64 = 0.25;

/// Corrections of a tick.
#[derive(Clone, Debug)]
pub(crate) struct Correction {
    gains: Gains,
    error: DVector<f64>,
    input: DVector<f64>,
    momentum: Matrix6xX<f64>,
    /// Acceleration of the centre of mass, m/s².
    pub com_m_s2: Vector3<f64>,
    /// Angular acceleration of the body, rad/s².
    pub body_rad_s2: Vector3<f64>,
    /// Ground force on each end effector, N.
    pub force_n: Vec<Vector3<f64>>,
    /// Speed of each end effector, m/s.
    pub speed_m_s: Vec<Vector3<f64>>,
    /// Offset of each foothold from the planned one, m. For an end effector in the air it is the desired offset.
    pub foothold_m: Vec<Vector3<f64>>,
    /// Foothold offsets after the previous tick that had a solution, m.
    last_m: Vec<Vector3<f64>>,
}

/// Contact or lowest point of an end effector.
pub(crate) struct TrackedPoint {
    /// Planned position, m.
    pub planned: Vector3<f64>,
    /// Measured position, m.
    pub measured: Vector3<f64>,
    /// Planned ground force, N; `None` in the air.
    pub force_n: Option<Vector3<f64>>,
}

impl Correction {
    /// Creates zero corrections for a plan with the given gains.
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

    /// Changes to the gains of a plan that begins where the previous one ends. Foothold offsets are kept.
    pub fn change_gains(&mut self, gains: Gains) {
        self.gains = gains;
    }

    /// Updates the corrections from the planned and the measured motion.
    ///
    /// `time_s` is the time of the plan, s, and `tick_s` the duration of the next tick, s. `mass` is the mass matrix of the
    /// measured motion.
    pub fn update(
        &mut self,
        tree: &Tree,
        [time_s, tick_s]: [f64; 2],
        [planned, measured]: [&Kinematics; 2],
        mass: &DMatrix<f64>,
        places: impl Iterator<Item = TrackedPoint> + Clone,
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

    /// Stores the foothold offsets for the next tick. Call it after a tick with a solution; `shift_m` is the displacement of
    /// the plan since, m.
    pub fn keep(&mut self, shift_m: Vector2<f64>) {
        self.last_m.copy_from_slice(&self.foothold_m);
        // Footholds stay where they are in the world.
        for last_m in &mut self.last_m {
            last_m.x -= shift_m.x;
            last_m.y -= shift_m.y;
        }
    }
}
