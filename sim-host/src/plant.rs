//! Physics of one motor: an inertia driven by a clamped torque.
//!
//! ```text
//!   I q'' = clamp(kp (q* - q) + kd (v* - q') + tau, ±tau_max) + tau_load - k_load q - d_load q'
//! ```
//!
//! `I` is the sum of the armature (rotor and gearbox at the output) and the load's inertia. `k_load` and `d_load` are those of
//! springs and dampers at joints. A motor at its top speed has no torque left to accelerate, but a load can still drive it
//! faster. A joint stops at its mechanical limits without bouncing. Current loop and electrical time constant are not simulated,
//! since they are an order of magnitude faster than the control law. Backlash, friction, encoder quantisation and temperature are
//! not simulated either.
//!
//! The integrator is the implicit midpoint rule with a fixed step. It is of second order, stable for any gains, and without
//! numerical damping, so that overshoot comes from the control law alone. Tests compare it with the closed form of the step
//! response.

use rollwalk_drives::{Law, Shaft};
use rollwalk_robot::Actuator;

/// Motor with its load.
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    armature_kg_m2: f64,
    torque_max_nm: f64,
    speed_max_rad_s: f64,
    stops_rad: [f64; 2],
    /// Inertia of the load on the shaft, kg·m².
    pub load_inertia_kg_m2: f64,
    /// Torque of the load on the shaft at angle and speed 0, N·m, such as its weight.
    pub load_torque_nm: f64,
    /// Stiffness of the load on the shaft, N·m/rad.
    pub load_stiffness_nm_rad: f64,
    /// Damping of the load on the shaft, N·m·s/rad.
    pub load_damping_nm_s_rad: f64,
    /// Angle q, rad.
    pub position_rad: f64,
    /// Speed q', rad/s.
    pub speed_rad_s: f64,
    /// Torque of the motor over the previous step, N·m.
    pub torque_nm: f64,
    /// True if the control law required more torque than the motor has.
    pub torque_limited: bool,
}

impl Plant {
    /// Creates an actuator at rest at `position_rad`, without load or stops.
    pub fn new(actuator: &Actuator, position_rad: f64) -> Self {
        Self {
            armature_kg_m2: actuator.armature_kg_m2,
            torque_max_nm: actuator.torque_max_nm,
            speed_max_rad_s: actuator.speed_max_rad_s,
            stops_rad: [f64::NEG_INFINITY, f64::INFINITY],
            load_inertia_kg_m2: 0.0,
            load_torque_nm: 0.0,
            load_stiffness_nm_rad: 0.0,
            load_damping_nm_s_rad: 0.0,
            position_rad,
            speed_rad_s: 0.0,
            torque_nm: 0.0,
            torque_limited: false,
        }
    }

    /// Adds mechanical stops at two angles.
    pub fn with_stops(self, min_rad: f64, max_rad: f64) -> Self {
        Self { stops_rad: [min_rad, max_rad], ..self }
    }

    /// Inertia I of motor and load, kg·m².
    pub fn inertia_kg_m2(&self) -> f64 {
        self.armature_kg_m2 + self.load_inertia_kg_m2
    }

    /// Maximum torque of the motor, N·m.
    pub fn torque_max_nm(&self) -> f64 {
        self.torque_max_nm
    }

    /// Measurements at the shaft, as taken by a drive.
    pub fn shaft(&self) -> Shaft {
        let &Self { position_rad, speed_rad_s, torque_nm, torque_limited, .. } = self;
        Shaft { position_rad, speed_rad_s, torque_nm, torque_limited }
    }

    /// Advances by `dt_s` under the control law `law`.
    pub fn step(&mut self, law: &Law, dt_s: f64) {
        // With v the mean of old and new speed, the midpoint angle is q + v dt/2, and the rule is v = v0 + dt/(2I) (kp (q* - q
        // - v dt/2) + kd (v* - v) + tau + tau_load - k_load (q + v dt/2) - d_load v).
        let half = 0.5 * dt_s;
        let gain = half / self.inertia_kg_m2();
        let &Law { kp_nm_rad: kp, kd_nm_s_rad: kd, .. } = law;
        let load_nm = self.load_torque_nm - self.load_stiffness_nm_rad * self.position_rad;
        let load_by_speed = self.load_damping_nm_s_rad + half * self.load_stiffness_nm_rad;
        let still = kp * (law.position_rad - self.position_rad)
            + kd * law.speed_rad_s
            + law.torque_nm
            + load_nm;
        let by_speed = kd + half * kp;
        let mean = (self.speed_rad_s + gain * still) / (1.0 + gain * (by_speed + load_by_speed));
        let wanted = still - load_nm - by_speed * mean;
        self.torque_nm =
            self.available(wanted, law.torque_limit_nm, gain, [load_nm, load_by_speed]);
        self.torque_limited = self.torque_nm != wanted;
        // Without clamping, this equals `mean`.
        let mean =
            (self.speed_rad_s + gain * (self.torque_nm + load_nm)) / (1.0 + gain * load_by_speed);
        self.position_rad += dt_s * mean;
        self.speed_rad_s = 2.0 * mean - self.speed_rad_s;

        let [min, max] = self.stops_rad;
        if self.position_rad < min {
            self.position_rad = min;
            self.speed_rad_s = self.speed_rad_s.max(0.0);
        } else if self.position_rad > max {
            self.position_rad = max;
            self.speed_rad_s = self.speed_rad_s.min(0.0);
        }
    }

    /// Clamps the required torque to the torque that the motor has at the speed after the step. `load` is the torque of the load
    /// at speed 0, and the decrease of this torque per unit of speed.
    fn available(&self, wanted: f64, limit_nm: f64, gain: f64, load: [f64; 2]) -> f64 {
        let most = self.torque_max_nm.min(limit_nm);
        let torque = wanted.clamp(-most, most);
        // Torque with which this step ends exactly at the maximum speed, in the direction of `torque`.
        let top = self.speed_max_rad_s.copysign(torque);
        let [load_nm, load_by_speed] = load;
        let mean = 0.5 * (top + self.speed_rad_s);
        let to_top = (top - self.speed_rad_s) / (2.0 * gain) - load_nm + load_by_speed * mean;
        if torque > 0.0 { torque.min(to_top.max(0.0)) } else { torque.max(to_top.min(0.0)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DT_S: f64 = 0.5e-3;
    const FREE: Law = Law {
        position_rad: 0.0,
        speed_rad_s: 0.0,
        kp_nm_rad: 0.0,
        kd_nm_s_rad: 0.0,
        torque_nm: 0.0,
        torque_limit_nm: f64::INFINITY,
    };

    fn actuator() -> Actuator {
        Actuator {
            model: "test".into(),
            speed_max_rad_s: 1e9,
            torque_max_nm: 1e9,
            torque_speed: None,
            kp_nm_rad: 0.0,
            kd_nm_s_rad: 0.0,
            armature_kg_m2: 0.004,
            bus: 0,
            id: 1,
        }
    }

    /// Step response of I q'' + kd q' + kp q = kp, in the textbook form for every damping.
    fn closed_form(inertia: f64, kp: f64, kd: f64, t: f64) -> f64 {
        let omega = (kp / inertia).sqrt();
        let zeta = kd / (2.0 * (kp * inertia).sqrt());
        if zeta < 1.0 {
            let damped = omega * (1.0 - zeta * zeta).sqrt();
            let (sin, cos) = (damped * t).sin_cos();
            1.0 - (-zeta * omega * t).exp() * (cos + zeta * omega / damped * sin)
        } else if zeta == 1.0 {
            1.0 - (-omega * t).exp() * (1.0 + omega * t)
        } else {
            let root = omega * (zeta * zeta - 1.0).sqrt();
            let (slow, fast) = (-zeta * omega + root, -zeta * omega - root);
            1.0 + (fast * (slow * t).exp() - slow * (fast * t).exp()) / (slow - fast)
        }
    }

    /// Largest distance from the closed form over half a second.
    fn worst_step_error(kd: f64, dt: f64) -> f64 {
        let mut plant = Plant { load_inertia_kg_m2: 0.012, ..Plant::new(&actuator(), 0.0) };
        let law = Law { position_rad: 1.0, kp_nm_rad: 25.0, kd_nm_s_rad: kd, ..FREE };
        let steps = (0.5 / dt).round() as usize;
        (1..=steps).fold(0.0, |worst: f64, k| {
            plant.step(&law, dt);
            let expected = closed_form(0.016, 25.0, kd, k as f64 * dt);
            worst.max((plant.position_rad - expected).abs())
        })
    }

    #[test]
    fn step_response_follows_the_closed_form() {
        // omega = 39.5 rad/s; zeta = kd / 1.265: 0.2, 0.6, 1, 2.5.
        for kd in [0.253, 0.759, 2.0 * (25.0f64 * 0.016).sqrt(), 3.16] {
            let error = worst_step_error(kd, DT_S);
            // Phase error of the midpoint rule: (omega dt)^2 / 12 per radian of phase, 20 rad long,
            // gives 7e-4 at the lightest damping if nothing decayed.
            assert!(error < 3e-4, "kd {kd}: {error:e}");
            // Second order: half the step, a quarter of the error.
            let ratio = error / worst_step_error(kd, DT_S / 2.0);
            assert!((3.8..4.2).contains(&ratio), "kd {kd}: ratio {ratio}");
        }
    }

    #[test]
    fn an_undamped_motor_neither_gains_nor_loses_energy() {
        let mut plant = Plant::new(&actuator(), 0.3);
        let law = Law { kp_nm_rad: 10.0, ..FREE };
        let energy =
            |p: &Plant| 10.0 * p.position_rad.powi(2) + p.inertia_kg_m2() * p.speed_rad_s.powi(2);
        let before = energy(&plant);
        for _ in 0..20_000 {
            plant.step(&law, DT_S);
        }
        // The midpoint rule conserves quadratic energies exactly; only rounding remains.
        assert!((energy(&plant) / before - 1.0).abs() < 1e-10);
    }

    #[test]
    fn a_spring_and_damper_on_the_shaft_move_a_free_motor_as_its_own_gains_would() {
        let law = Law { position_rad: 0.4, kp_nm_rad: 10.0, kd_nm_s_rad: 0.1, ..FREE };
        let mut driven = Plant::new(&actuator(), 0.0);
        let mut sprung = Plant {
            load_torque_nm: 0.4 * law.kp_nm_rad,
            load_stiffness_nm_rad: law.kp_nm_rad,
            load_damping_nm_s_rad: law.kd_nm_s_rad,
            ..driven.clone()
        };
        for _ in 0..200 {
            driven.step(&law, DT_S);
            sprung.step(&FREE, DT_S);
            assert!((driven.position_rad - sprung.position_rad).abs() < 1e-12, "rounding only");
        }
        assert!((sprung.position_rad - 0.4).abs() > 1e-3, "the shaft still moves");
    }

    #[test]
    fn a_motor_against_a_spring_does_not_exceed_its_top_speed() {
        let motor = Actuator { speed_max_rad_s: 3.0, ..actuator() };
        let mut plant = Plant {
            load_stiffness_nm_rad: 10.0,
            load_damping_nm_s_rad: 0.1,
            ..Plant::new(&motor, 0.0)
        };
        let law = Law { position_rad: 10.0, kp_nm_rad: 500.0, ..FREE };
        for _ in 0..400 {
            plant.step(&law, DT_S);
            assert!(plant.speed_rad_s < 3.0 + 1e-9, "{}", plant.speed_rad_s);
        }
        assert!(plant.speed_rad_s > 3.0 - 1e-9, "{}", plant.speed_rad_s);
    }

    #[test]
    fn weight_sags_a_servo_by_torque_over_kp() {
        let mut plant = Plant { load_torque_nm: -0.5, ..Plant::new(&actuator(), 0.0) };
        let law = Law { kp_nm_rad: 20.0, kd_nm_s_rad: 0.5, ..FREE };
        for _ in 0..4000 {
            plant.step(&law, DT_S);
        }
        assert!((plant.position_rad + 0.025).abs() < 1e-9);
        assert!((plant.torque_nm - 0.5).abs() < 1e-9, "the motor carries the weight");
    }

    #[test]
    fn a_clamped_motor_accelerates_at_torque_over_inertia() {
        let mut plant = Plant::new(&Actuator { torque_max_nm: 2.0, ..actuator() }, 0.0);
        let law = Law { position_rad: 100.0, kp_nm_rad: 50.0, ..FREE };
        for _ in 0..100 {
            plant.step(&law, DT_S);
        }
        // 2 N·m act on 0.004 kg·m² for 50 ms.
        assert!((plant.speed_rad_s - 25.0).abs() < 1e-9, "{}", plant.speed_rad_s);
        assert!((plant.position_rad - 0.625).abs() < 1e-9, "{}", plant.position_rad);
    }

    #[test]
    fn a_torque_on_top_carries_a_weight_without_sagging() {
        let mut plant = Plant { load_torque_nm: -0.5, ..Plant::new(&actuator(), 0.2) };
        let law = Law { position_rad: 0.2, kp_nm_rad: 20.0, torque_nm: 0.5, ..FREE };
        for _ in 0..100 {
            plant.step(&law, DT_S);
        }
        assert!((plant.position_rad - 0.2).abs() < 1e-12);
        // A torque alone accelerates: 0.5 N·m on 0.004 kg·m² for 50 ms.
        let mut plant = Plant::new(&actuator(), 0.0);
        let law = Law { torque_nm: 0.5, ..FREE };
        for _ in 0..100 {
            plant.step(&law, DT_S);
        }
        assert!((plant.speed_rad_s - 6.25).abs() < 1e-9, "{}", plant.speed_rad_s);
    }

    #[test]
    fn top_speed_stops_the_motor_but_not_a_stronger_load() {
        let limited = Actuator { torque_max_nm: 2.0, speed_max_rad_s: 8.0, ..actuator() };
        let law = Law { position_rad: 100.0, kp_nm_rad: 50.0, ..FREE };
        let mut plant = Plant::new(&limited, 0.0);
        for _ in 0..200 {
            plant.step(&law, DT_S);
            assert!(plant.speed_rad_s <= 8.0 + 1e-9);
        }
        assert!((plant.speed_rad_s - 8.0).abs() < 1e-9);
        plant.load_torque_nm = 1.0;
        plant.step(&law, DT_S);
        assert!(plant.speed_rad_s > 8.0);
        assert_eq!(plant.torque_nm, 0.0, "the motor does not brake for its speed limit");
    }

    #[test]
    fn a_limit_below_the_motors_own_holds() {
        let mut plant = Plant::new(&actuator(), 0.0);
        let law = Law { position_rad: 1.0, kp_nm_rad: 50.0, torque_limit_nm: 0.3, ..FREE };
        plant.step(&law, DT_S);
        assert_eq!(plant.torque_nm, 0.3);
        plant.step(&Law::default(), DT_S);
        assert_eq!(plant.torque_nm, 0.0);
    }

    #[test]
    fn a_joint_ends_at_its_stop_and_leaves_it_again() {
        let mut plant = Plant::new(&actuator(), 0.0).with_stops(-0.2, 0.5);
        let mut law = Law { position_rad: 1.0, kp_nm_rad: 5.0, kd_nm_s_rad: 0.3, ..FREE };
        for _ in 0..2000 {
            plant.step(&law, DT_S);
            assert!(plant.position_rad <= 0.5);
        }
        assert_eq!((plant.position_rad, plant.speed_rad_s), (0.5, 0.0));
        law.position_rad = 0.1;
        for _ in 0..2000 {
            plant.step(&law, DT_S);
        }
        assert!((plant.position_rad - 0.1).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn torque_never_exceeds_the_clamp_and_motion_stays_finite(
            position in -10.0..10.0f64,
            kp in 0.0..500.0f64,
            kd in 0.0..5.0f64,
            speed in -50.0..50.0f64,
            load in -3.0..3.0f64,
        ) {
            let limited = Actuator { torque_max_nm: 2.0, speed_max_rad_s: 8.0, ..actuator() };
            let mut plant = Plant { load_torque_nm: load, ..Plant::new(&limited, 0.0) };
            let law = Law {
                position_rad: position,
                speed_rad_s: speed,
                kp_nm_rad: kp,
                kd_nm_s_rad: kd,
                ..FREE
            };
            for _ in 0..500 {
                plant.step(&law, DT_S);
                prop_assert!(plant.torque_nm.abs() <= 2.0);
                prop_assert!(plant.position_rad.is_finite() && plant.speed_rad_s.is_finite());
            }
        }
    }
}
