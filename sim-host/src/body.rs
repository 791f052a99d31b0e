//! Motors of a robot: servos in channel order. On a stand they are loaded with the links that they move; on the ground they
//! move the simulated world.

use crate::clock::SimTime;
use crate::ground::Grounded;
use crate::load::{JointLoad, motor_loads};
use crate::plant::Plant;
use crate::servo::Servo;
use rollwalk_drives::Answer;
use rollwalk_multibody::Tree;
use rollwalk_multibody::ground::Ground;
use rollwalk_physics::StepError;
use rollwalk_physics::push::Shove;
use rollwalk_protocol::can::Frame;
use rollwalk_robot::{Channel, Robot};
use std::sync::Arc;

/// Motors of a robot.
#[derive(Debug)]
pub struct Body {
    tree: Tree,
    /// Servos in channel order: joints with a motor, then actuated wheels.
    servos: Vec<Servo>,
    addresses: Vec<(u8, u8)>,
    /// World of a robot on the ground; `None` if a stand holds the body level and still.
    ground: Option<Grounded>,
}

impl Body {
    /// Creates a robot at rest in its nominal pose on a stand, with torque off.
    pub fn new(robot: &Robot) -> Self {
        let nominal: Vec<_> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
        let nominal = robot.transmission().motors(&nominal);
        let mut nominal = robot.of_driven_joints(&nominal);
        let servos = robot.channels().map(|channel| {
            let config = channel.config(robot);
            let plant = match channel {
                Channel::Joint(joint) => {
                    let position_rad = nominal.next().unwrap_or(joint.nominal_rad);
                    let [min_rad, max_rad] = [config.min, config.max].map(f64::from);
                    let [min_rad, max_rad] = match joint.is_coupled() {
                        true => [min_rad, max_rad],
                        false => [joint.position_min_rad, joint.position_max_rad],
                    };
                    Plant::new(&joint.actuator, position_rad).with_stops(min_rad, max_rad)
                }
                // In the robot file, the wheel is part of its link. Only its rotor is separate.
                Channel::Wheel(_, actuator) => Plant::new(actuator, 0.0),
            };
            let bus = robot.buses.get(&channel.actuator().bus).copied().unwrap_or_default();
            Servo::new(&bus, &config, plant)
        });
        let servos = servos.collect();
        let addresses = robot.channels().map(|c| (c.actuator().bus, c.actuator().id)).collect();
        let mut body = Self { tree: Tree::new(robot), servos, addresses, ground: None };
        body.update_loads();
        body
    }

    /// Creates a robot like [`Self::new`], but on the ground. Times of pushes count from the start of the simulation.
    pub fn on_ground(robot: &Robot, ground: &Arc<dyn Ground>, shoves: Vec<Shove>) -> Self {
        Self { ground: Some(Grounded::new(robot, ground, shoves)), ..Self::new(robot) }
    }

    /// Creates a robot like [`Self::on_ground`], for a controller in another process. Its clips are not known here.
    pub fn motors_on_ground(robot: &Robot, ground: &Arc<dyn Ground>, shoves: Vec<Shove>) -> Self {
        Self { ground: Some(Grounded::of_motors(robot, ground, shoves)), ..Self::new(robot) }
    }

    /// World of a robot on the ground; `None` on a stand.
    pub fn ground(&self) -> Option<&Grounded> {
        self.ground.as_ref()
    }

    /// Mutable world of a robot on the ground, with its current clip and its travels; `None` on a stand.
    pub fn ground_mut(&mut self) -> Option<&mut Grounded> {
        self.ground.as_mut()
    }

    /// Bus and address of each servo, in channel order.
    pub fn addresses(&self) -> &[(u8, u8)] {
        &self.addresses
    }

    /// Servos in channel order.
    pub fn servos(&self) -> &[Servo] {
        &self.servos
    }

    /// True value of each channel, rad for a joint, rad/s for a wheel.
    pub fn values(&self) -> Vec<f32> {
        let joints = self.tree.robot().driven_joints().count();
        let value = |(channel, servo): (usize, &Servo)| {
            let Plant { position_rad, speed_rad_s, .. } = servo.plant;
            (if channel < joints { position_rad } else { speed_rad_s }) as f32
        };
        self.servos.iter().enumerate().map(value).collect()
    }

    /// Recomputes the inertia and weight on every motor from the present pose. Has no effect on a robot on the ground.
    pub fn update_loads(&mut self) {
        if self.ground.is_some() {
            return;
        }
        let robot = self.tree.robot();
        let plants = || self.servos.iter().map(|servo| &servo.plant);
        // On the stand, springs of passive joints are relaxed.
        let angles = robot.all_joints(plants().map(|plant| plant.position_rad), |_, joint| {
            let rest_rad = joint.spring.unwrap_or_default().rest_rad;
            rest_rad.clamp(joint.position_min_rad, joint.position_max_rad)
        });
        let speeds = robot.all_joints(plants().map(|plant| plant.speed_rad_s), |_, _| 0.0);
        let loads = motor_loads(&self.tree, &angles, &speeds);
        let loads: Vec<_> = robot.of_driven_joints(&loads).collect();
        for (servo, load) in self.servos.iter_mut().zip(loads) {
            let JointLoad { inertia_kg_m2, torque_nm, stiffness_nm_rad, damping_nm_s_rad } = load;
            let plant = &mut servo.plant;
            plant.load_inertia_kg_m2 = inertia_kg_m2;
            plant.load_stiffness_nm_rad = stiffness_nm_rad;
            plant.load_damping_nm_s_rad = damping_nm_s_rad;
            // Between updates, the torques of springs and dampers follow angle and speed.
            plant.load_torque_nm = torque_nm
                + stiffness_nm_rad * plant.position_rad
                + damping_nm_s_rad * plant.speed_rad_s;
        }
    }

    /// Advances the motors by `dt_s` up to the time `now`.
    ///
    /// # Errors
    /// Returns an error if a step of the world has no solution. The world then stays at that time.
    pub fn step(&mut self, now: SimTime, dt_s: f64) -> Result<(), StepError> {
        let Some(ground) = &mut self.ground else {
            self.servos.iter_mut().for_each(|servo| servo.step(now, dt_s));
            return Ok(());
        };
        self.servos.iter_mut().for_each(|servo| servo.on_time(now));
        ground.step(now, &mut self.servos)
    }

    /// Cuts the power of the motor of `channel`, which gives no torque and loses its state.
    pub fn cut_power(&mut self, channel: usize) {
        self.servos[channel].cut_power();
    }

    /// Passes a frame to the servo of `channel`. Returns its answer; `None` if the frame was not for it.
    pub fn on_frame(&mut self, channel: usize, now: SimTime, frame: &Frame) -> Option<Frame> {
        self.servos[channel].on_frame(now, frame)
    }

    /// Removes the next packet from the bytes that the servos of a serial line received; `channel` is any of these servos.
    pub fn take_packet(&self, channel: usize, line: &mut Vec<u8>) -> Option<Vec<u8>> {
        self.servos[channel].take_packet(line)
    }

    /// Passes a packet to the servo of `channel`. Returns the set-point in it, if it was for this servo, and the answer.
    pub fn on_packet(
        &mut self,
        channel: usize,
        now: SimTime,
        packet: &[u8],
    ) -> (Option<f32>, Option<Answer>) {
        self.servos[channel].on_packet(now, packet)
    }

    /// Value of the set-point in a frame for the servo of `channel`, rad or rad/s; `None` for any other frame.
    pub fn commanded(&self, channel: usize, frame: &Frame) -> Option<f32> {
        self.servos[channel].commanded(frame)
    }

    /// Time of the next unsolicited frame of any servo; `None` if they send none.
    pub fn next_timer(&self) -> Option<SimTime> {
        self.servos.iter().filter_map(Servo::next_timer).min()
    }

    /// Returns the next unsolicited frame that is due at `now`, with its channel; call it until it returns `None`.
    pub fn on_timer(&mut self, now: SimTime) -> Option<(usize, Frame)> {
        let mut servos = self.servos.iter_mut().enumerate();
        servos.find_map(|(channel, servo)| Some((channel, servo.on_timer(now)?)))
    }
}
