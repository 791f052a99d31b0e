//! A robot in the page: the firmware with its buses and servos, on level ground, in time with the page's clock.

use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_host::operator::Operator;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_robot::{InvalidRobot, Robot};
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::ground::Grounded;
use rollwalk_sim_host::rig::Rig;
use std::sync::Arc;

/// Longest time that the robot makes up for at once, µs. A page in the background, or a slow computer, halts the robot's time.
const MOST_LAG_US: u64 = 100_000;
/// Interval at which frames change hands, µs.
const STEP_US: u64 = 1_000;

pub struct Simulated {
    rig: Rig,
    /// The page's clock at the last run, µs.
    page_us: Option<u64>,
}

impl Simulated {
    /// A robot just after power-on, in its hoist, without a library.
    ///
    /// # Errors
    /// The robot breaks a rule of controllers.
    pub fn new(robot: &Robot) -> Result<Self, InvalidRobot> {
        let ground: Arc<dyn Ground> = Arc::new(Plane::level());
        let rig = Rig::new(robot)?.onto_ground(robot, &ground, Vec::new());
        Ok(Self { rig, page_us: None })
    }

    /// The robot's time, µs.
    pub fn now_us(&self) -> u64 {
        self.rig.now_us()
    }

    /// The robot in its world.
    pub fn grounded(&self) -> Option<&Grounded> {
        self.rig.body().ground()
    }

    /// Runs until the page's clock, with an operator at the link.
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
