//! Simulated robot in the page: the firmware with its buses and servos, on level ground, synchronised with the page's clock.

use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_host::operator::Operator;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_robot::{InvalidRobot, Robot};
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::ground::Grounded;
use rollwalk_sim_host::rig::Rig;
use std::sync::Arc;

/// Maximum time simulated in one call, µs. The robot's time therefore halts if the page is in the background or the computer is
/// slow.
const MOST_LAG_US: u64 = 100_000;
/// Interval between exchanges of frames, µs.
const STEP_US: u64 = 1_000;

pub struct Simulated {
    rig: Rig,
    /// Page time of the previous call of [`run`](Self::run), µs.
    page_us: Option<u64>,
}

impl Simulated {
    /// Creates a robot just after power-on, held by its hoist, without a library.
    ///
    /// # Errors
    /// Returns an error if the robot breaks a rule of controllers.
    pub fn new(robot: &Robot) -> Result<Self, InvalidRobot> {
        let ground: Arc<dyn Ground> = Arc::new(Plane::level());
        let rig = Rig::new(robot)?.onto_ground(robot, &ground, Vec::new());
        Ok(Self { rig, page_us: None })
    }

    /// Time of the robot, µs.
    pub fn now_us(&self) -> u64 {
        self.rig.now_us()
    }

    /// Robot in its simulated world.
    pub fn grounded(&self) -> Option<&Grounded> {
        self.rig.body().ground()
    }

    /// Runs the robot until the time of the page's clock, with an operator on the link.
    pub fn run(&mut self, page_us: u64, operator: &mut Operator) {
        let before_us = self.page_us.replace(page_us).unwrap_or(page_us);
        let end_us = self.now_us() + page_us.saturating_sub(before_us).min(MOST_LAG_US);
        loop {
            self.exchange(operator);
            let now_us = self.now_us();
            if now_us >= end_us {
                break;
            }
            self.rig.run_until(SimTime::from_us(end_us.min(now_us + STEP_US)));
        }
        // Discarded: no request reads the log, and it would grow without bound.
        self.rig.take_log();
    }

    fn exchange(&mut self, operator: &mut Operator) {
        let now_us = self.now_us();
        loop {
            match self.rig.receive(now_us) {
                Ok(Some(frame)) => operator.on_frame(now_us, &frame),
                Ok(None) => break,
                Err(error) => return operator.on_bus_lost(now_us, &error.to_string()),
            }
        }
        while let Some(frame) = operator.poll(now_us) {
            match self.rig.send(&frame) {
                Ok(()) => {}
                Err(LinkError::Busy) => return operator.not_sent(frame),
                Err(LinkError::Down(why)) => return operator.on_bus_lost(now_us, &why),
            }
        }
    }
}
