//! Pilot and planner in the loop of a program that steers a robot.

use crate::pilot::{Pilot, SteeringRequest};
use crate::plans::{PlannedStretch, Planner, Route};
use rollwalk_host::operator::{ExitStage, Intent, Operator, Weight};
use rollwalk_planner::receding::Steering;
use std::sync::mpsc::TryRecvError;
use std::time::Duration;

/// Timeout for stopping and disarming a robot before the program ends, µs. When it expires, the program switches torque off in
/// the present pose.
pub const END_US: u64 = 15_000_000;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fastest {
    /// Limit of the forward and sideways velocity, m/s.
    pub speed_m_s: f64,
    /// Limit of the turning rate, rad/s.
    pub turn_rad_s: f64,
}

impl Fastest {
    /// Clamps each velocity of the steering to its limit.
    pub fn limit(&self, steering: Steering) -> Steering {
        let Self { speed_m_s, turn_rad_s } = *self;
        Steering {
            forward_m_s: steering.forward_m_s.clamp(-speed_m_s, speed_m_s),
            left_m_s: steering.left_m_s.clamp(-speed_m_s, speed_m_s),
            turn_rad_s: steering.turn_rad_s.clamp(-turn_rad_s, turn_rad_s),
        }
    }
}

/// Steered robot.
#[derive(Debug)]
pub struct SteeredRobot {
    /// Pilot that decides when to arm, to plan and to stop.
    pub pilot: Pilot,
    planner: Planner,
    has_gait: bool,
}

impl SteeredRobot {
    /// Creates a steered robot on a route. A plan takes at most `budget`, rounded up to a whole iteration.
    pub fn new(pilot: Pilot, route: Route, budget: Duration) -> Self {
        let has_gait = route.gait.is_some();
        Self { pilot, planner: Planner::start(route, budget), has_gait }
    }

    /// Sets the steering. A robot with a gait walks unless the steering is zero.
    pub fn steer(&mut self, steering: Steering) {
        self.pilot.steer(SteeringRequest::of(steering, self.has_gait));
    }

    /// Sends commands to the robot, receives plans and requests the next plans. Call it often. `took` is called with the planning
    /// time of each plan.
    pub fn turn(&mut self, now_us: u64, operator: &mut Operator, mut took: impl FnMut(Duration)) {
        self.pilot.update(now_us, operator);
        loop {
            match self.planner.planned.try_recv() {
                Ok(PlannedStretch { request, stretch, took: time }) => {
                    took(time);
                    self.pilot.on_stretch(now_us, request, stretch, operator);
                }
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => {
                    let text = "the planner has ended: the robot halts";
                    if operator.leaving() == ExitStage::No {
                        operator.notify(now_us, Weight::Warning, text);
                        operator.request(now_us, Intent::Quit);
                    }
                    break;
                }
            }
        }
        if let Some(request) = self.pilot.request(operator) {
            // If the planner has ended, the next poll for plans reports it.
            let _ = self.planner.requests.send(request);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_part_of_the_steering_is_faster_than_the_fastest() {
        let fastest = Fastest { speed_m_s: 0.2, turn_rad_s: 0.5 };
        let steering =
            |forward_m_s, left_m_s, turn_rad_s| Steering { forward_m_s, left_m_s, turn_rad_s };
        assert_eq!(fastest.limit(steering(3.0, -3.0, 3.0)), steering(0.2, -0.2, 0.5));
        assert_eq!(fastest.limit(steering(0.1, 0.0, -0.4)), steering(0.1, 0.0, -0.4));
    }

    #[test]
    fn a_robot_with_a_gait_walks_unless_it_stands() {
        let (rest, on) =
            (Steering::default(), Steering { forward_m_s: 0.1, ..Steering::default() });
        for (steering, has_gait, walks) in
            [(on, true, true), (on, false, false), (rest, true, false)]
        {
            assert_eq!(
                SteeringRequest::of(steering, has_gait),
                SteeringRequest { steering, walks }
            );
        }
    }
}
